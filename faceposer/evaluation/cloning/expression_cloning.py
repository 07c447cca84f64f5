"""Expression cloning by motion vectors (Noh and Neumann, SIGGRAPH 2001), a rival.

Each motion vector of the source is rotated by the change of the local frame, and scaled by the change of the local
size, between the source and the source fitted to the target. Vertices of the target take the motion of the nearest
place.
"""

import numpy as np
from numpy.typing import NDArray

from faceposer.evaluation.cloning.correspondence import Skin, facing_triangles, fitted
from faceposer.geometry.mesh import VertexNormals

Array = NDArray[np.float64]

# Local scales are kept within this factor of the global one, as the paper discards implausible ones.
_MOST_SCALE = 2.0


class ExpressionCloning:
    """Cloning from one skin to another by motion vectors."""

    def __init__(self, source: Skin, target: Skin) -> None:
        """Fit ``source`` to ``target``, and find the local rotations and scales."""
        self._source, self._target = source, target
        on_target = fitted(source, target)
        edges = _first_edges(source.triangles, len(source.vertices))
        before, after = (_frames(vertices, source.triangles, edges) for vertices in (source.vertices, on_target))
        sizes = [
            _sizes(vertices, source.triangles, frames)
            for vertices, frames in ((source.vertices, before), (on_target, after))
        ]
        scale = target.height / source.height
        ratio = np.clip(sizes[1] / np.maximum(sizes[0], 1e-9), scale / _MOST_SCALE, scale * _MOST_SCALE)
        # Into the local frame, scaled along its axes, and out of the frame of the fitted source.
        self._turns = np.einsum("nij,ni,nik->njk", after, ratio, before)
        normals = VertexNormals(target.triangles, len(target.vertices))(target.vertices)
        faces, weights, shares = facing_triangles(target.vertices, normals, on_target, source.triangles, target.height)
        self._weights = shares[:, None] * weights
        self._corners = source.triangles[faces]

    def clone(self, vertices: Array) -> Array:
        """Return the target's skin, (N', 3), for the source's ``vertices``, shape (N, 3)."""
        moved = np.einsum("njk,nk->nj", self._turns, vertices - self._source.vertices)
        motion: Array = np.einsum("nc,ncd->nd", self._weights, moved[self._corners])
        return self._target.vertices + motion


def _first_edges(triangles: NDArray[np.integer], count: int) -> NDArray[np.intp]:
    """Return a neighbour of each of ``count`` vertices, or the vertex itself without one, shape (count,)."""
    edges = np.arange(count, dtype=np.intp)
    for a, b in ((2, 0), (1, 2), (0, 1)):
        edges[triangles[:, a]] = triangles[:, b]
    return edges


def _frames(vertices: Array, triangles: NDArray[np.integer], edges: NDArray[np.intp]) -> Array:
    """Return the local frame of each vertex: normal, tangent along an edge, and their product, shape (N, 3, 3)."""
    normals = VertexNormals(triangles, len(vertices))(vertices).astype(np.float64)
    along = vertices[edges] - vertices
    tangents = along - np.einsum("nd,nd->n", along, normals)[:, None] * normals
    tangents /= np.maximum(np.linalg.norm(tangents, axis=1, keepdims=True), 1e-12)
    return np.stack([normals, tangents, np.cross(normals, tangents)], axis=1)


def _sizes(vertices: Array, triangles: NDArray[np.integer], frames: Array) -> Array:
    """Return the extent of the triangles around each vertex along the axes of its frame, shape (N, 3)."""
    low, high = np.zeros((len(vertices), 3)), np.zeros((len(vertices), 3))
    for a in range(3):
        for b in range(3):
            ids = triangles[:, a]
            local = np.einsum("nij,nj->ni", frames[ids], vertices[triangles[:, b]] - vertices[ids])
            np.minimum.at(low, ids, local)
            np.maximum.at(high, ids, local)
    sizes = high - low
    # A ring is nearly flat: along the normal, the size of the tangents counts.
    sizes[:, 0] = np.sqrt(np.maximum(sizes[:, 1] * sizes[:, 2], 0.0))
    return sizes
