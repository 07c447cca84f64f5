"""Displacements of vertices that can be undone."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Singles = NDArray[np.float32]
Ids = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class Displacement:
    """A displacement of some vertices.

    Attributes:
        ids: Vertex ids, shape (n,).
        before: Positions before the displacement, shape (n, 3).
        farthest: Length of the largest displacement.
    """

    ids: Ids
    before: Singles
    farthest: float


def move_vertices(vertices: Singles, ids: Ids, before: Singles, move: NDArray[np.floating]) -> Displacement:
    """Move the ``ids``, (n,), of ``vertices``, (N, 3), from ``before``, (n, 3), by ``move``, rows (3, n), in place."""
    vertices[ids] = before + move.T.astype(np.float32)
    x, y, z = move
    return Displacement(ids, before, float(np.sqrt((x * x + y * y + z * z).max(initial=0.0))))
