"""Triangle meshes, vertex normals and vertex areas."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

Floats = NDArray[np.floating]
Ints = NDArray[np.integer]

#: Bound on coordinates in files, which keeps sums of their squares over a mesh within single precision.
FARTHEST = 1e12


@dataclass(frozen=True, eq=False)
class TriangleMesh:
    """A mesh of triangles over shared vertices.

    Attributes:
        vertices: Positions, shape (N, 3).
        triangles: Vertex indices, counter-clockwise seen from outside, shape (T, 3).
    """

    vertices: Floats
    triangles: Ints

    def __post_init__(self) -> None:
        if self.vertices.ndim != 2 or self.vertices.shape[1] != 3:
            raise ValueError(f"vertices must have shape (N, 3), not {self.vertices.shape}")
        if self.triangles.ndim != 2 or self.triangles.shape[1] != 3:
            raise ValueError(f"triangles must have shape (T, 3), not {self.triangles.shape}")
        if self.triangles.size and not 0 <= self.triangles.min() <= self.triangles.max() < len(self.vertices):
            raise ValueError("triangles refer to vertices that do not exist")


def first_unusable(values: Floats) -> int | None:
    """Return the first row of ``values``, (N, k), with a number that is not finite or beyond ``FARTHEST``, or None."""
    # Comparisons with NaN are False.
    usable = np.abs(values) <= FARTHEST
    return None if usable.all() else int(np.argmin(usable.all(axis=1)))


class VertexNormals:
    """Area-weighted vertex normals of a fixed topology for any vertex positions.

    The sum over the triangles of each vertex is a sparse matrix, built once. The length of a triangle's cross product
    is twice its area, so that the plain sum is the area-weighted normal.
    """

    def __init__(self, triangles: Ints, n_vertices: int) -> None:
        """Prepare for ``triangles`` of shape (T, 3) over ``n_vertices`` vertices."""
        corners = np.ascontiguousarray(triangles.T)
        self._corners = tuple(np.ascontiguousarray(c, dtype=np.intp) for c in corners)
        n_triangles = triangles.shape[0]
        columns = np.tile(np.arange(n_triangles, dtype=np.int32), 3)
        ones = np.ones(3 * n_triangles, dtype=np.float32)
        self._sum = sparse.csr_array((ones, (corners.ravel(), columns)), shape=(n_vertices, n_triangles))

    def __call__(self, vertices: Floats) -> NDArray[np.float32]:
        """Return the unit normals of ``vertices``, shape (N, 3); zero for vertices without a triangle of any area."""
        positions = np.asarray(vertices, dtype=np.float32)
        a, b, c = (positions.take(corner, axis=0) for corner in self._corners)
        b -= a
        c -= a
        # Written out per component, the cross product is several times faster than numpy.cross.
        bx, by, bz = b.T
        cx, cy, cz = c.T
        face = np.empty((len(a), 3), dtype=np.float32)
        face[:, 0] = by * cz - bz * cy
        face[:, 1] = bz * cx - bx * cz
        face[:, 2] = bx * cy - by * cx
        normals: NDArray[np.float32] = self._sum @ face
        squared = np.einsum("ij,ij->i", normals, normals)
        normals *= (1.0 / np.sqrt(np.maximum(squared, np.float32(1e-30))))[:, None]
        return normals


def vertex_areas(vertices: Floats, triangles: Ints) -> NDArray[np.float64]:
    """Return the area of each of the ``vertices``, (N, 3), a third of that of its ``triangles``, shape (N,)."""
    corners = vertices[triangles].astype(np.float64)
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    areas = 0.5 * np.sqrt(np.einsum("ij,ij->i", cross, cross))
    shares = np.repeat(areas / 3.0, 3)
    return np.bincount(np.ravel(triangles), shares, minlength=len(vertices)).astype(np.float64)
