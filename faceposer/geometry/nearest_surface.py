"""Nearest points on a surface."""

from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from faceposer.geometry.mesh import Floats, Ints
from faceposer.geometry.picking import SurfacePoints

if TYPE_CHECKING:
    from scipy.spatial import cKDTree

Array = NDArray[np.float64]

# Number of triangles, those with the nearest middles, that are tested for the nearest point.
_CANDIDATES = 32
# Triangles so many times larger than usual are found by the middles of equal parts, up to so many along an edge.
_LARGE, _MOST_PARTS = 2.5, 24


class NearestSurface:
    """Nearest point queries on some triangles of a mesh."""

    def __init__(
        self, vertices: Floats, triangles: Ints, chosen: NDArray[np.integer], candidates: int = _CANDIDATES
    ) -> None:
        """Prepare queries on the ``triangles``, (T, 3), with indices ``chosen``, shape (n,), n > 0.

        Only the ``candidates`` triangles with the nearest middles are tested; fewer are faster.
        """
        self._n_candidates = candidates
        self._vertices = np.asarray(vertices, dtype=np.float64)
        self._triangles = np.asarray(triangles)
        self._chosen = np.asarray(chosen, dtype=np.int64)

    @cached_property
    def _middles(self) -> "tuple[cKDTree, NDArray[np.int64]]":
        """The middles of triangles, or of parts of large ones, and the triangle of each."""
        # Imported late to shorten the start of the window.
        from scipy.spatial import cKDTree

        corners = self._vertices[self._triangles[self._chosen]]
        radii = np.linalg.norm(corners - corners.mean(axis=1, keepdims=True), axis=2).max(axis=1)
        usual = max(_LARGE * float(np.median(radii)), 1e-300)
        parts = np.clip(np.ceil(radii / usual), 1, _MOST_PARTS).astype(np.int64)
        places, owners = [], []
        for number in np.unique(parts):
            own = np.flatnonzero(parts == number)
            shares = _part_middles(int(number))
            places.append(np.einsum("pc,ncd->npd", shares, corners[own]).reshape(-1, 3))
            owners.append(np.repeat(self._chosen[own], len(shares)))
        return cKDTree(np.concatenate(places)), np.concatenate(owners)

    @cached_property
    def _own_vertices(self) -> NDArray[np.int64]:
        return np.unique(self._triangles[self._chosen]).astype(np.int64)

    @cached_property
    def _vertex_tree(self) -> "cKDTree":
        from scipy.spatial import cKDTree

        return cKDTree(self._vertices[self._own_vertices])

    def points(self, places: Array) -> tuple[SurfacePoints, Array]:
        """Return the points on the surface nearest to ``places``, shape (n, 3), and their distances, shape (n,)."""
        tree, owners = self._middles
        _, near = tree.query(places, k=min(self._n_candidates, len(owners)))
        candidates = owners[np.asarray(near).reshape(len(places), -1)]
        faces, weights = candidates[:, 0], np.zeros((len(places), 3))
        least = np.full(len(places), np.inf)
        # One candidate at a time: arrays of all of them at once do not fit the processor's cache.
        for candidate in candidates.T:
            own, distances = closest_on_triangles(self._vertices[self._triangles[candidate]], places)
            nearer = distances < least
            faces = np.where(nearer, candidate, faces)
            weights[nearer], least[nearer] = own[nearer], distances[nearer]
        return SurfacePoints(faces, weights), least

    def at_vertices(self, places: Array) -> tuple[SurfacePoints, Array]:
        """Return the vertices of the surface nearest to ``places``, shape (n, 3), and their distances, shape (n,)."""
        distances, near = self._vertex_tree.query(places)
        return SurfacePoints.at_vertices(self._own_vertices[near]), np.asarray(distances, dtype=np.float64)


def closest_on_triangles(corners: Array, places: Array) -> tuple[Array, Array]:
    """Return the barycentric coordinates of the closest point of one triangle to each place, and its distance.

    The regions of Voronoi around corners, edges and the inside tell where it is (Ericson, *Real-Time Collision
    Detection*, 2005, section 5.1.5).

    Args:
        corners: Corners of each triangle, shape (n, 3, 3).
        places: Positions, shape (n, 3).

    Returns:
        Barycentric coordinates, shape (n, 3), and distances, shape (n,).
    """
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    edge1, edge2 = b - a, c - a
    (d1, d2), (d3, d4), (d5, d6) = (
        (np.einsum("nd,nd->n", edge1, places - corner), np.einsum("nd,nd->n", edge2, places - corner))
        for corner in (a, b, c)
    )
    at_a, at_b, at_c = d3 * d6 - d5 * d4, d5 * d2 - d1 * d6, d1 * d4 - d3 * d2
    weights = _shares(at_b, at_c, at_a + at_b + at_c)
    zero, one = np.zeros(len(places)), np.ones(len(places))
    # Later rules take precedence: corners over edges, edges over the inside.
    along = _ratio(d4 - d3, (d4 - d3) + (d5 - d6))
    rules = (
        ((at_a <= 0.0) & (d4 >= d3) & (d5 >= d6), (zero, 1.0 - along, along)),
        ((at_b <= 0.0) & (d2 >= 0.0) & (d6 <= 0.0), (1.0 - _ratio(d2, d2 - d6), zero, _ratio(d2, d2 - d6))),
        ((at_c <= 0.0) & (d1 >= 0.0) & (d3 <= 0.0), (1.0 - _ratio(d1, d1 - d3), _ratio(d1, d1 - d3), zero)),
        ((d6 >= 0.0) & (d5 <= d6), (zero, zero, one)),
        ((d3 >= 0.0) & (d4 <= d3), (zero, one, zero)),
        ((d1 <= 0.0) & (d2 <= 0.0), (one, zero, zero)),
    )
    for here, shares in rules:
        weights[here] = np.stack(shares, axis=1)[here]
    return weights, np.linalg.norm(np.einsum("nc,ncd->nd", weights, corners) - places, axis=1)


def _part_middles(n: int) -> Array:
    """Return barycentric coordinates of the middles of the n² equal parts of a triangle, shape (n², 3)."""
    i, j = (index.ravel() for index in np.meshgrid(np.arange(n), np.arange(n), indexing="ij"))
    upright, inverted = i + j < n, i + j < n - 1
    first = np.concatenate([i[upright] + 1 / 3, i[inverted] + 2 / 3]) / n
    second = np.concatenate([j[upright] + 1 / 3, j[inverted] + 2 / 3]) / n
    return np.stack([1.0 - first - second, first, second], axis=1)


def _shares(at_b: Array, at_c: Array, total: Array) -> Array:
    second, third = _ratio(at_b, total), _ratio(at_c, total)
    return np.stack([1.0 - second - third, second, third], axis=1)


def _ratio(part: Array, whole: Array) -> Array:
    """Return ``part`` / ``whole``, 0 where the triangle has no extent."""
    return np.where(whole != 0.0, part / np.where(whole != 0.0, whole, 1.0), 0.0)
