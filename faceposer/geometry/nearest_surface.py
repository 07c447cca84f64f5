"""Nearest points on a surface."""

from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from faceposer.geometry.mesh import Floats, Ints
from faceposer.geometry.mirror import nearest_on_triangles
from faceposer.geometry.picking import SurfacePoints

if TYPE_CHECKING:
    from scipy.spatial import cKDTree

Array = NDArray[np.float64]

# Number of triangles, those with the nearest centroids, that are tested for the nearest point.
_CANDIDATES = 32


class NearestSurface:
    """Nearest point queries on some triangles of a mesh."""

    def __init__(self, vertices: Floats, triangles: Ints, chosen: NDArray[np.integer]) -> None:
        """Prepare queries on the ``triangles``, (T, 3), with indices ``chosen``, shape (n,), n > 0."""
        self._vertices = np.asarray(vertices, dtype=np.float64)
        self._triangles = np.asarray(triangles)
        self._chosen = np.asarray(chosen, dtype=np.int64)

    @cached_property
    def _centroids(self) -> "cKDTree":
        # Imported late to shorten the start of the window.
        from scipy.spatial import cKDTree

        return cKDTree(self._vertices[self._triangles[self._chosen]].mean(axis=1))

    @cached_property
    def _own_vertices(self) -> NDArray[np.int64]:
        return np.unique(self._triangles[self._chosen]).astype(np.int64)

    @cached_property
    def _vertex_tree(self) -> "cKDTree":
        from scipy.spatial import cKDTree

        return cKDTree(self._vertices[self._own_vertices])

    def points(self, places: Array) -> tuple[SurfacePoints, Array]:
        """Return the points on the surface nearest to ``places``, shape (n, 3), and their distances, shape (n,)."""
        _, near = self._centroids.query(places, k=min(_CANDIDATES, len(self._chosen)))
        candidates = self._chosen[np.asarray(near).reshape(len(places), -1)]
        weights, distances = nearest_on_triangles(self._vertices[self._triangles[candidates]], places)
        rows, best = np.arange(len(places)), np.argmin(distances, axis=1)
        return SurfacePoints(candidates[rows, best], weights[rows, best]), distances[rows, best]

    def at_vertices(self, places: Array) -> tuple[SurfacePoints, Array]:
        """Return the vertices of the surface nearest to ``places``, shape (n, 3), and their distances, shape (n,)."""
        distances, near = self._vertex_tree.query(places)
        return SurfacePoints.at_vertices(self._own_vertices[near]), np.asarray(distances, dtype=np.float64)
