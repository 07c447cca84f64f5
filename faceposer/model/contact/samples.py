"""Samples of a surface at which contact is tested: vertices, and points on the triangles between them."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Self

import numpy as np
from numpy.typing import NDArray

from faceposer.geometry.mesh import Ints

Array = NDArray[np.float64]
Singles = NDArray[np.float32]
Ids = NDArray[np.intp]


# Number of steps along an edge of the lattice of samples on large triangles.
_STEPS = 4


@dataclass(frozen=True, eq=False)
class SurfaceSamples:
    """Samples of some triangles: V vertices, then B points on the triangles.

    A triangle can cut through a convex obstacle that its vertices merely touch, which the additional samples detect.
    They are the midpoints of edges and the centroids, and on large triangles a lattice.

    Attributes:
        ids: Ids of the vertices, shape (V,), in ascending order within each surface.
        corners: Corners of the triangle of each point, as indices into ``ids``, shape (3, B).
        weights: Barycentric coordinates of each point, shape (3, B); the last is 0 for midpoints of edges.
        spans: Length of the longest neutral edge of the triangles at each vertex, shape (V,).
        starts: Index into ``adjacent`` of the first point of each vertex, followed by its length, shape (V + 1,).
        adjacent: Points on the triangles at the first vertex, at the second and so on, shape (k,).
    """

    ids: Ids
    corners: NDArray[np.int32]
    weights: NDArray[np.float32]
    spans: Array
    starts: Ids
    adjacent: NDArray[np.int32]

    @classmethod
    def of(cls, vertices: NDArray[np.floating], triangles: Ints, extra: Ids, large: float) -> Self:
        """Return the samples of ``triangles``.

        Args:
            vertices: Vertices of the whole neutral face, shape (N, 3).
            triangles: Triangles to sample, shape (F, 3).
            extra: Vertices that are samples even without a triangle, shape (k,).
            large: Edge length from which a triangle is large.
        """
        faces = np.asarray(triangles, dtype=np.intp).reshape(-1, 3)
        ids = np.unique(np.concatenate([faces.ravel(), extra]))
        local = np.searchsorted(ids, faces)
        places = vertices[faces].astype(np.float64)
        longest = np.linalg.norm(places - places[:, [1, 2, 0]], axis=2).max(axis=1, initial=0.0)
        sides = np.sort(np.concatenate([local[:, [0, 1]], local[:, [1, 2]], local[:, [2, 0]]]), axis=1)
        edges = np.unique(sides, axis=0).reshape(-1, 2)
        third = np.full(len(local), 1.0 / 3.0)
        corners = [np.column_stack([edges, edges[:, 0]]).T, local.T]
        weights = [np.repeat([[0.5], [0.5], [0.0]], len(edges), axis=1), np.stack([third, third, third])]
        i, j = np.meshgrid(np.arange(_STEPS + 1), np.arange(_STEPS + 1), indexing="ij")
        between = (i + j <= _STEPS) & (np.maximum(np.maximum(i, j), _STEPS - i - j) < _STEPS)
        for a, b in zip(i[between] / _STEPS, j[between] / _STEPS, strict=True):
            count = int((longest >= large).sum())
            corners.append(local[longest >= large].T)
            weights.append(np.repeat([[a], [b], [1.0 - a - b]], count, axis=1))
        spans = np.zeros(len(ids))
        np.maximum.at(spans, local, longest[:, None])
        between = np.ascontiguousarray(np.hstack(corners), dtype=np.int32)
        shares = np.ascontiguousarray(np.hstack(weights), dtype=np.float32)
        # Midpoints repeat their first corner as the third, with a weight of 0.
        flat = between[shares > 0.0]
        order = np.argsort(flat, kind="stable")
        starts = np.concatenate([[0], np.cumsum(np.bincount(flat, minlength=len(ids)))])
        adjacent = np.nonzero(shares > 0.0)[1][order].astype(np.int32)
        return cls(ids, between, shares, spans, starts.astype(np.intp), adjacent)

    @classmethod
    def concatenated(cls, parts: Sequence[Self]) -> Self:
        """Return the samples of several surfaces as one: all vertices, then all points on triangles."""
        vertices = np.cumsum([0, *(len(part.ids) for part in parts)])
        points = np.cumsum([0, *(part.corners.shape[1] for part in parts)])
        entries = np.cumsum([0, *(len(part.adjacent) for part in parts)])
        return cls(
            np.concatenate([part.ids for part in parts]),
            np.hstack([part.corners + np.int32(vertices[i]) for i, part in enumerate(parts)]),
            np.hstack([part.weights for part in parts]),
            np.concatenate([part.spans for part in parts]),
            np.concatenate([*(part.starts[:-1] + entries[i] for i, part in enumerate(parts)), entries[-1:]]),
            np.concatenate([part.adjacent + np.int32(points[i]) for i, part in enumerate(parts)]),
        )

    def __len__(self) -> int:
        return len(self.ids) + self.corners.shape[1]

    def places(self, vertices: NDArray[np.floating]) -> Array:
        """Return the positions of the samples, shape (V + B, 3), for ``vertices`` of the whole face, (N, 3)."""
        points = vertices[self.ids].astype(np.float32)
        between = _interpolated(np.ascontiguousarray(points.T), self.corners, self.weights).T
        return np.concatenate([points, between]).astype(np.float64)

    def vertex_maxima(self, rows: Singles, near: Ids, values_at: Callable[[Singles, Ids], Singles]) -> Singles:
        """Return the maximum, at least 0, of values at each vertex and at its adjacent samples, shape (V,).

        Args:
            rows: Positions of the vertices by coordinate, shape (3, V).
            near: Indices into ``ids`` of the vertices at which, or next to which, values may be positive, shape (n,).
            values_at: Function from the positions, (3, n), and the numbers, (n,), of samples to their values, (n,).
        """
        greatest = np.zeros(len(self.ids), dtype=np.float32)
        starts = self.starts.take(near)
        counts = self.starts.take(near + 1) - starts
        ends = np.cumsum(counts)
        chosen = np.zeros(self.corners.shape[1], dtype=bool)
        chosen[self.adjacent.take(np.arange(ends[-1]) + np.repeat(starts - ends + counts, counts))] = True
        between = np.flatnonzero(chosen)
        corners = self.corners.take(between, axis=1)
        points = np.empty((3, len(near) + len(between)), dtype=np.float32)
        rows.take(near, axis=1, out=points[:, : len(near)])
        points[:, len(near) :] = _interpolated(rows, corners, self.weights.take(between, axis=1))
        values = values_at(points, np.concatenate([near, len(self.ids) + between]))
        greatest[near] = values[: len(near)]
        found = np.flatnonzero(values[len(near) :])
        if len(found):
            values = values[len(near) :].take(found)
            for corner in corners:
                np.maximum.at(greatest, corner.take(found), values)
        return greatest


def _interpolated(rows: Singles, corners: NDArray[np.int32], weights: Singles) -> Singles:
    a, b, c = (rows.take(corner, axis=1) * weight for corner, weight in zip(corners, weights, strict=True))
    a += b
    a += c
    return a


def lattice(corners: Array, spacing: float, at_most: int = 40) -> Array:
    """Return points on triangles that are at most ``spacing`` apart, shape (n, 3).

    Args:
        corners: Positions of the triangles' corners, shape (F, 3, 3).
        spacing: Distance between neighbouring points.
        at_most: Largest number of steps along an edge, which takes precedence over ``spacing``.
    """
    longest = np.linalg.norm(corners - corners[:, [1, 2, 0]], axis=2).max(axis=1, initial=0.0)
    steps = np.clip(np.ceil(longest / spacing), 1, at_most).astype(int)
    points = []
    for n in np.unique(steps):
        # A single matrix product takes a fifth of the time of many small ones.
        flat = corners[steps == n].transpose(2, 0, 1).reshape(-1, 3) @ _lattice_weights(int(n)).T
        points.append(flat.reshape(3, -1).T)
    return np.concatenate(points) if points else np.zeros((0, 3))


@lru_cache(maxsize=64)
def _lattice_weights(steps: int) -> Array:
    """Return the barycentric coordinates of the points of a triangular lattice, shape (n, 3)."""
    i, j = np.meshgrid(np.arange(steps + 1), np.arange(steps + 1), indexing="ij")
    inside = i + j <= steps
    return np.stack([i[inside], j[inside], steps - i[inside] - j[inside]], axis=1) / steps
