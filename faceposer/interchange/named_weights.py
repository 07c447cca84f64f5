"""Weights of shapes by name, as files have them."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class NamedWeights:
    """Weights of shapes by name, frame by frame.

    Attributes:
        names: Of the S shapes.
        frames: Shape (F, S).
        rate: Frames per second; None if the file does not say, as of a single pose.
        notes: What was assumed, lost or left out, one sentence each.
    """

    names: tuple[str, ...]
    frames: NDArray[np.float64]
    rate: float | None
    notes: tuple[str, ...] = ()
