"""Places on a surface at which contact is looked for: vertices, and points of the triangles between them."""

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


# Large triangles are sampled at the points of a lattice with so many steps along an edge.
_STEPS = 4


@dataclass(frozen=True, eq=False)
class SurfaceSamples:
    """Samples of some triangles: V vertices, then B points between them.

    Between its vertices a triangle cuts through a convex obstacle that they only touch; the samples find that. They are
    the middles of edges and the centroids, and in large triangles a lattice.

    Attributes:
        ids: The vertices, shape (V,), of one surface in rising order.
        corners: Vertices that each point between lies between, as indices into ``ids``, shape (3, B).
        weights: Their weights, shape (3, B); those of the middle of an edge end in 0.
        spans: Length of the longest edge of a triangle at each vertex in the neutral face, shape (V,).
        first: Where the points next to each vertex begin in ``beside``, and at last their number, shape (V + 1,).
        beside: The points next to the first vertex, to the second and so on, shape (k,).
    """

    ids: Ids
    corners: NDArray[np.int32]
    weights: NDArray[np.float32]
    spans: Array
    first: Ids
    beside: NDArray[np.int32]

    @classmethod
    def of(cls, vertices: NDArray[np.floating], triangles: Ints, extra: Ids, large: float) -> Self:
        """Return samples.

        Args:
            vertices: Of the whole neutral face, shape (N, 3).
            triangles: That are sampled, shape (F, 3).
            extra: Vertices that are samples even if no triangle has them, shape (k,).
            large: Length of an edge from which on a triangle is large.
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
        # The third corner of the middle of an edge is the first one again.
        flat = between[shares > 0.0]
        order = np.argsort(flat, kind="stable")
        first = np.concatenate([[0], np.cumsum(np.bincount(flat, minlength=len(ids)))])
        beside = np.nonzero(shares > 0.0)[1][order].astype(np.int32)
        return cls(ids, between, shares, spans, first.astype(np.intp), beside)

    @classmethod
    def joined(cls, parts: Sequence[Self]) -> Self:
        """Return the samples of several surfaces as one: the vertices of all, then the points between of all."""
        vertices = np.cumsum([0, *(len(part.ids) for part in parts)])
        points = np.cumsum([0, *(part.corners.shape[1] for part in parts)])
        entries = np.cumsum([0, *(len(part.beside) for part in parts)])
        return cls(
            np.concatenate([part.ids for part in parts]),
            np.hstack([part.corners + np.int32(vertices[i]) for i, part in enumerate(parts)]),
            np.hstack([part.weights for part in parts]),
            np.concatenate([part.spans for part in parts]),
            np.concatenate([*(part.first[:-1] + entries[i] for i, part in enumerate(parts)), entries[-1:]]),
            np.concatenate([part.beside + np.int32(points[i]) for i, part in enumerate(parts)]),
        )

    def __len__(self) -> int:
        return len(self.ids) + self.corners.shape[1]

    def places(self, vertices: NDArray[np.floating]) -> Array:
        """Return where the samples lie, shape (V + B, 3), for ``vertices`` of the whole face, (N, 3)."""
        points = vertices[self.ids].astype(np.float32)
        between = _interpolated(np.ascontiguousarray(points.T), self.corners, self.weights).T
        return np.concatenate([points, between]).astype(np.float64)

    def greatest(self, rows: Singles, near: Ids, of: Callable[[Singles, Ids], Singles]) -> Singles:
        """Return the greatest value at each vertex and at the samples next to it, at least 0, shape (V,).

        Args:
            rows: The vertices' positions, coordinates by rows, shape (3, V).
            near: The vertices that may have a value, or samples with one beside them, as indices into ``ids``, (n,).
            of: Returns the values of samples from their positions, (3, n), and their numbers, (n,).
        """
        greatest = np.zeros(len(self.ids), dtype=np.float32)
        starts = self.first.take(near)
        counts = self.first.take(near + 1) - starts
        ends = np.cumsum(counts)
        chosen = np.zeros(self.corners.shape[1], dtype=bool)
        chosen[self.beside.take(np.arange(ends[-1]) + np.repeat(starts - ends + counts, counts))] = True
        between = np.flatnonzero(chosen)
        corners = self.corners.take(between, axis=1)
        points = np.empty((3, len(near) + len(between)), dtype=np.float32)
        rows.take(near, axis=1, out=points[:, : len(near)])
        points[:, len(near) :] = _interpolated(rows, corners, self.weights.take(between, axis=1))
        values = of(points, np.concatenate([near, len(self.ids) + between]))
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
    """Return points on triangles ``corners``, (F, 3, 3), at most ``spacing`` apart if that takes few enough.

    Args:
        corners: Positions of the corners.
        spacing: Wanted distance between neighbouring points.
        at_most: Greatest number of steps along an edge.
    """
    longest = np.linalg.norm(corners - corners[:, [1, 2, 0]], axis=2).max(axis=1, initial=0.0)
    steps = np.clip(np.ceil(longest / spacing), 1, at_most).astype(int)
    points = []
    for n in np.unique(steps):
        # One product of matrices costs a fifth of many small ones.
        flat = corners[steps == n].transpose(2, 0, 1).reshape(-1, 3) @ _lattice_weights(int(n)).T
        points.append(flat.reshape(3, -1).T)
    return np.concatenate(points) if points else np.zeros((0, 3))


@lru_cache(maxsize=64)
def _lattice_weights(steps: int) -> Array:
    """Return the weights of the corners of a triangle at the points of a lattice, shape (n, 3)."""
    i, j = np.meshgrid(np.arange(steps + 1), np.arange(steps + 1), indexing="ij")
    inside = i + j <= steps
    return np.stack([i[inside], j[inside], steps - i[inside] - j[inside]], axis=1) / steps
