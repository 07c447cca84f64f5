"""What a correction has moved, so that it can be taken back."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Singles = NDArray[np.float32]
Ids = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class Moved:
    """Some vertices that were moved.

    Attributes:
        ids: Which, shape (n,).
        before: Where they were, shape (n, 3).
        farthest: How far any was moved at most.
    """

    ids: Ids
    before: Singles
    farthest: float


def moved_by(vertices: Singles, ids: Ids, before: Singles, move: NDArray[np.floating]) -> Moved:
    """Move the ``ids``, (n,), of ``vertices``, (N, 3), from ``before``, (n, 3), by ``move``, rows (3, n), in place."""
    vertices[ids] = before + move.T.astype(np.float32)
    x, y, z = move
    return Moved(ids, before, float(np.sqrt((x * x + y * y + z * z).max(initial=0.0))))
