"""Scans of too many triangles, made coarser: vertices in one cell of a grid become one (Rossignac and Borrel 1993)."""

import numpy as np
from numpy.typing import NDArray

from faceposer.geometry.mesh import TriangleMesh

Array = NDArray[np.float64]

_ROUNDS = 8


def simplified(mesh: TriangleMesh, most: int) -> TriangleMesh:
    """Return ``mesh`` with at most about ``most`` vertices; `mesh` itself if it has no more.

    The vertices of each cell of a grid become their mean, and triangles that keep three different corners remain.
    """
    vertices, triangles = np.asarray(mesh.vertices, dtype=np.float64), np.asarray(mesh.triangles)
    if len(vertices) <= most:
        return mesh
    low = vertices.min(axis=0)
    extent = float(np.ptp(vertices, axis=0).max())
    # A surface has about (extent / cell)² cells times a small number.
    cell = extent * (2.0 / most) ** 0.5
    for _ in range(_ROUNDS):
        of_vertex, count = _cells(vertices, low, cell)
        if count <= most:
            break
        cell *= max((count / most) ** 0.5, 1.02)
    total = np.bincount(of_vertex, minlength=count)
    means = np.stack([np.bincount(of_vertex, axis, count) / total for axis in vertices.T], axis=1)
    corners = of_vertex[triangles]
    corners = corners[(corners != np.roll(corners, 1, axis=1)).all(axis=1)]
    _, first = np.unique(np.sort(corners, axis=1), axis=0, return_index=True)
    return TriangleMesh(means, corners[np.sort(first)])


def _cells(vertices: Array, low: Array, cell: float) -> tuple[NDArray[np.int64], int]:
    """Return the number of the cell of each vertex, shape (N,), and the number of cells."""
    index = np.floor((vertices - low) / cell).astype(np.int64)
    size = index.max(axis=0) + 1
    keys = (index[:, 0] * size[1] + index[:, 1]) * size[2] + index[:, 2]
    found, of_vertex = np.unique(keys, return_inverse=True)
    return of_vertex.reshape(-1), len(found)
