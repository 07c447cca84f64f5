"""Linear maps of the surroundings of points from one head to another, which carry expressions between heads.

A map between two heads that takes x to y takes a small motion of x to its derivative times that motion: Noh and
Neumann, "Expression cloning" (2001), with least-squares maps of neighbourhoods in place of local bounding boxes. They
are linear functions of the head's vertices.
"""

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.spatial import cKDTree

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

#: Radius of the neighbourhoods, and of the wide ones that determine what is not in them, such as the direction across
#: flat skin; distances between samples of the surface, all in centimetres.
_NEAR, _WIDE = 1.6, 5.0
_NEAR_SPACING, _WIDE_SPACING = 0.35, 1.1
#: Number of samples in a neighbourhood at least, and at most.
_FEWEST, _MOST_SAMPLES = 24, 110
#: Weights of the wide map in the near one, and of uniform scaling in the wide one, in square centimetres.
_NEAR_RIDGE, _WIDE_RIDGE = 0.06, 0.1
#: A direction is stretched or shrunk by at most this factor relative to the whole head.
_MOST = 2.2


class LocalMaps:
    """Maps of the neighbourhoods of some points, from a reference head to others of the same topology."""

    def __init__(self, vertices: Floats, surface: Ints, n_points: int) -> None:
        """Prepare the maps at the first ``n_points`` of ``vertices``, (N, 3); ``surface`` are those that form skin."""
        self._rest = vertices[surface]
        self._surface = surface
        self._near = _operator(vertices[:n_points], vertices, surface, _NEAR, _NEAR_SPACING, _NEAR_RIDGE)
        self._wide = _operator(vertices[:n_points], vertices, surface, _WIDE, _WIDE_SPACING, _WIDE_RIDGE)

    def __call__(self, vertices: Floats) -> Floats:
        """Return the maps to the head with ``vertices``, shape (N, 3), as matrices, shape (n, 3, 3)."""
        head = vertices[self._surface]
        size = float(np.sqrt(head.var(axis=0).sum() / self._rest.var(axis=0).sum()))
        gathered, rest = self._wide
        maps = _applied(gathered, vertices) + size * rest
        gathered, rest = self._near
        maps = _applied(gathered, vertices) + maps @ rest
        u, stretch, vt = np.linalg.svd(maps)
        clipped: Floats = (u * np.clip(stretch, size / _MOST, size * _MOST)[:, None, :]) @ vt
        return clipped


def _operator(
    points: Floats, vertices: Floats, surface: Ints, radius: float, spacing: float, ridge: float
) -> tuple[sparse.csr_array, Floats]:
    """Return what multiplies vertices of another head, (3 n, N), and the map that is preferred, (n, 3, 3)."""
    cells = np.floor(vertices[surface] / spacing).astype(int)
    ids = surface[np.unique(cells, axis=0, return_index=True)[1]]
    distance, near = cKDTree(vertices[ids]).query(points, k=_MOST_SAMPLES)
    reach = np.clip(radius, distance[:, _FEWEST], distance[:, -1])[:, None]
    weight = np.maximum(1.0 - (distance / reach) ** 2, 0.0) ** 2
    weight /= weight.sum(axis=1, keepdims=True)
    around = vertices[ids][near]
    around = around - np.einsum("nk,nkd->nd", weight, around)[:, None]
    spread = np.einsum("nk,nki,nkj->nij", weight, around, around)
    inverse = np.linalg.inv(spread + ridge * np.eye(3))
    # after = map @ before: map = (sum of weight * after before^T + ridge * preferred) inverse.
    values = np.einsum("nk,nki,nij->njk", weight, around, inverse)
    rows = np.broadcast_to(np.arange(3 * len(points)).reshape(-1, 3, 1), values.shape)
    columns = np.broadcast_to(ids[near][:, None, :], values.shape)
    kept = values != 0.0
    shape = (3 * len(points), len(vertices))
    return sparse.csr_array((values[kept], (rows[kept], columns[kept])), shape=shape), ridge * inverse


def _applied(operator: sparse.csr_array, vertices: Floats) -> Floats:
    maps: Floats = (operator @ vertices).reshape(-1, 3, 3).transpose(0, 2, 1)
    return maps
