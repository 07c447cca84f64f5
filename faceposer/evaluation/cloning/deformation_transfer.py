"""Deformation transfer for triangle meshes (Sumner and Popović, SIGGRAPH 2004), a rival.

Each triangle of the target takes the deformation gradient of the corresponding triangle of the source; the vertices are
those whose gradients are nearest. The system is written with the gradient operator of the target (Botsch et al.,
"Deformation transfer for detail-preserving surface editing", 2006), which gives the same result without the paper's
fourth vertices.
"""

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse import linalg

from faceposer.evaluation.cloning.correspondence import Skin, facing_triangles, fitted, triangle_normals
from faceposer.geometry.mesh import VertexNormals

Array = NDArray[np.float64]

# Pull to the neutral places, relative to the mean of the diagonal: it makes the system regular, and holds the vertices
# that do not move, as the paper's constraints do.
_PULL, _HOLD = 1e-9, 0.1


class DeformationTransfer:
    """Transfer of deformations from one skin to another."""

    def __init__(self, source: Skin, target: Skin, still: NDArray[np.bool_]) -> None:
        """Find corresponding triangles, and factorise the system of the target.

        Args:
            source: Skin of the source.
            target: Skin of the target.
            still: Mask of the source's vertices that no expression moves, shape (N,); they hold the target in place.
        """
        on_target = fitted(source, target)
        centres = target.vertices[target.triangles].mean(axis=1)
        normals = triangle_normals(target.vertices, target.triangles)
        self._faces, _, shares = facing_triangles(centres, normals, on_target, source.triangles, target.height)
        self._shares = shares[:, None, None]
        self._source_triangles = source.triangles
        self._inverse = np.linalg.inv(_with_normals(source.vertices, source.triangles))
        gradient, areas = _gradient(target.vertices, target.triangles)
        self._weighted = (gradient.T @ sparse.diags_array(np.repeat(areas, 3))).tocsr()
        system = self._weighted @ gradient
        directions = VertexNormals(target.triangles, len(target.vertices))(target.vertices)
        faces, _, shares = facing_triangles(target.vertices, directions, on_target, source.triangles, target.height)
        held = still[source.triangles[faces]].all(axis=1) | (shares == 0.0)
        pull = np.where(held, _HOLD, _PULL) * system.diagonal().mean()
        self._pulled = pull[:, None] * target.vertices
        self._solve = linalg.splu((system + sparse.diags_array(pull)).tocsc()).solve

    def clone(self, vertices: Array) -> Array:
        """Return the target's skin, (N', 3), for the source's ``vertices``, shape (N, 3)."""
        # Row-vector convention: edges @ S = deformed edges.
        deformation = self._inverse @ _with_normals(vertices, self._source_triangles)
        # The gradient of the coordinates x^k over a triangle is column k.
        rest = np.eye(3)
        wanted = (rest + self._shares * (deformation[self._faces] - rest)).reshape(-1, 3)
        result: Array = self._solve(self._weighted @ wanted + self._pulled)
        return result


def _with_normals(vertices: Array, triangles: NDArray[np.integer]) -> Array:
    """Return two edges and the scaled normal of each triangle as rows, shape (T, 3, 3)."""
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    normals = np.cross(b - a, c - a)
    length = np.sqrt(np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300))
    return np.stack([b - a, c - a, normals / length], axis=1)


def _gradient(vertices: Array, triangles: NDArray[np.integer]) -> tuple[sparse.csr_array, Array]:
    """Return the gradient operator of functions on the vertices, (3 T, N), and the areas of the triangles, (T,)."""
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    normals = np.cross(b - a, c - a)
    doubled = np.maximum(np.linalg.norm(normals, axis=1), 1e-12)
    unit = normals / doubled[:, None]
    # The gradient of the hat function of a corner is the opposite edge turned by a right angle, over twice the area.
    hats = (
        np.stack([np.cross(unit, c - b), np.cross(unit, a - c), np.cross(unit, b - a)], axis=1) / doubled[:, None, None]
    )
    rows = np.repeat(np.arange(3 * len(triangles)).reshape(-1, 1, 3), 3, axis=1)
    columns = np.repeat(triangles[:, :, None], 3, axis=2)
    shape = (3 * len(triangles), len(vertices))
    return sparse.csr_array((hats.ravel(), (rows.ravel(), columns.ravel())), shape=shape), 0.5 * doubled
