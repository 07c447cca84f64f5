"""Weights of shapes by name, as stored in files."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class NamedWeights:
    """Weights of shapes by name, frame by frame.

    Attributes:
        names: Names of the S shapes.
        frames: Weights, shape (F, S).
        rate: Frames per second; None if the file does not state it, as for a single pose.
        notes: Assumptions, losses and omissions, one sentence each.
    """

    names: tuple[str, ...]
    frames: NDArray[np.float64]
    rate: float | None
    notes: tuple[str, ...] = ()
