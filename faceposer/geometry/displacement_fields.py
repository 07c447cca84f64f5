"""Smoothness of displacement fields on meshes, which tells expressions from offsets in another vertex order."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Edges = NDArray[np.integer]

# Displacements below this share of the largest one are ignored, and fields of fewer vertices are not judged.
_STRONG = 0.25
_FEWEST = 16
#: Unevenness of offsets in a random order is 1, and that of single rows of vertices on coarse meshes below 0.8.
RANDOM_ORDER = 0.85
# Smallest displacement, as a share of the size of the face, of a field that is judged.
_LEAST = 0.02
_MOST_EDGES = 200_000
# Longest edge, as a share of the size of the face, between neighbours.
_LONGEST = 0.15


def edges_of(polygons: NDArray[np.integer], vertices: Array) -> Edges:
    """Return the vertices at both ends of the edges of a mesh, shape (E, 2), without very long edges.

    Of very many edges, an even sample is returned.

    Args:
        polygons: Vertex ids, shape (F, K), padded with -1.
        vertices: Positions, shape (N, 3).
    """
    corners = np.where(polygons >= 0, polygons, polygons[:, :1])
    step = max(1, corners.size // _MOST_EDGES)
    corners = corners[::step]
    edges = np.stack([corners, np.roll(corners, -1, axis=1)], axis=2).reshape(-1, 2)
    lengths = np.linalg.norm(vertices[edges[:, 0]] - vertices[edges[:, 1]], axis=1)
    size = float(np.ptp(vertices, axis=0).max(initial=0.0)) if len(vertices) else 0.0
    kept: Edges = edges[(edges[:, 0] != edges[:, 1]) & (lengths < _LONGEST * size)]
    return kept


def unevenness(offsets: NDArray[np.floating], edges: Edges) -> float:
    """Return the mean squared difference of neighbouring displacements, relative to that in a random order.

    Only displacements of at least a quarter of the largest one count. Returns 0 for fields of few vertices.

    Args:
        offsets: Displacements, shape (N, 3).
        edges: Vertices at both ends of the edges, shape (E, 2).
    """
    lengths = np.linalg.norm(offsets, axis=1)
    strong = lengths >= _STRONG * lengths.max(initial=0.0)
    if not lengths.any() or not _FEWEST <= int(strong.sum()) <= len(edges):
        return 0.0
    field = np.where(strong[:, None], offsets, 0.0).astype(np.float64)
    a, b = field[edges[:, 0]], field[edges[:, 1]]
    energy = float(np.einsum("ed,ed->", a, a) + np.einsum("ed,ed->", b, b))
    difference = a - b
    in_random_order = 1.0 - float((field.mean(axis=0) ** 2).sum()) / float(np.einsum("nd,nd->", field, field)) * len(
        field
    )
    if energy <= 0.0 or in_random_order <= 0.0:
        return 0.0
    return float(np.einsum("ed,ed->", difference, difference)) / energy / in_random_order


def in_random_order(offsets: NDArray[np.floating], edges: Edges, size: float) -> bool:
    """Return True if neighbouring vertices move in unrelated directions, as with offsets in another vertex order.

    Args:
        offsets: Displacements, shape (N, 3).
        edges: Vertices at both ends of the edges, shape (E, 2).
        size: Size of the face, against which tiny displacements are not judged.
    """
    largest = float(np.abs(offsets).max(initial=0.0))
    return largest > _LEAST * size and unevenness(offsets, edges) > RANDOM_ORDER
