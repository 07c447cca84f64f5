"""Places on a surface at which contact is looked for: vertices, middles of edges and centroids of triangles."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from faceposer.geometry.mesh import Ints

Array = NDArray[np.float64]
Ids = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class SurfaceSamples:
    """Samples of some triangles: V vertices, then E middles of edges, then F centroids.

    Between its vertices a triangle cuts through a convex obstacle that they only touch; the samples find that.

    Attributes:
        ids: The vertices, shape (V,), in rising order.
        edges: Ends of the edges as indices into ``ids``, shape (E, 2).
        triangles: Corners as indices into ``ids``, shape (F, 3).
    """

    ids: Ids
    edges: Ids
    triangles: Ids

    @classmethod
    def of(cls, triangles: Ints, extra: Ids | None = None) -> "SurfaceSamples":
        """Return the samples of ``triangles``, shape (F, 3), with the vertices ``extra`` even if in none of them."""
        corners = np.asarray(triangles, dtype=np.intp).reshape(-1, 3)
        ids = np.unique(corners if extra is None else np.concatenate([corners.ravel(), extra]))
        local = np.searchsorted(ids, corners)
        sides = np.sort(np.concatenate([local[:, [0, 1]], local[:, [1, 2]], local[:, [2, 0]]]), axis=1)
        return cls(ids, np.unique(sides, axis=0).reshape(-1, 2), local)

    def __len__(self) -> int:
        return len(self.ids) + len(self.edges) + len(self.triangles)

    def places(self, vertices: NDArray[np.floating]) -> Array:
        """Return where the samples lie, shape (V + E + F, 3), for ``vertices`` of the whole face, (N, 3)."""
        return self.interpolated(vertices[self.ids].astype(np.float64))

    def interpolated(self, values: Array) -> Array:
        """Return ``values`` at the V vertices, shape (V, k), with those in between, shape (V + E + F, k)."""
        first, second = self._ends
        a, b, c = self._corners
        middles = 0.5 * (values[first] + values[second])
        return np.concatenate([values, middles, (values[a] + values[b] + values[c]) / 3.0])

    def greatest(self, points: Array, own: Array, near: NDArray[np.bool_], of: Callable[[Array, Ids], Array]) -> Array:
        """Return the greatest value at each vertex and at the samples next to it, shape (V,).

        Args:
            points: The vertices' positions, shape (V, 3).
            own: Their values, shape (V,); changed in place.
            near: Which vertices may have samples with a value beside them, shape (V,).
            of: Returns the values of samples from their positions, (n, 3), and their numbers, (n,).
        """
        first, second = self._ends
        a, b, c = self._corners
        edges = np.flatnonzero(near[first] | near[second])
        triangles = np.flatnonzero(near[a] | near[b] | near[c])
        first, second, a, b, c = first[edges], second[edges], a[triangles], b[triangles], c[triangles]
        places = np.concatenate([0.5 * (points[first] + points[second]), (points[a] + points[b] + points[c]) / 3.0])
        numbers = np.concatenate([len(self.ids) + edges, len(self.ids) + len(self.edges) + triangles])
        values = of(places, numbers)
        found = np.flatnonzero(values)
        on_edge, on_triangle = found[found < len(edges)], found[found >= len(edges)]
        for ends in (first, second):
            np.maximum.at(own, ends[on_edge], values[on_edge])
        for corners in (a, b, c):
            np.maximum.at(own, corners[on_triangle - len(edges)], values[on_triangle])
        return own

    @cached_property
    def _ends(self) -> tuple[Ids, Ids]:
        return np.ascontiguousarray(self.edges[:, 0]), np.ascontiguousarray(self.edges[:, 1])

    @cached_property
    def _corners(self) -> tuple[Ids, Ids, Ids]:
        a, b, c = (np.ascontiguousarray(self.triangles[:, k]) for k in range(3))
        return a, b, c


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
        i, j = np.meshgrid(np.arange(n + 1), np.arange(n + 1), indexing="ij")
        inside = i + j <= n
        weights = np.stack([i[inside], j[inside], n - i[inside] - j[inside]], axis=1) / n
        points.append(np.einsum("kc,fcd->fkd", weights, corners[steps == n]).reshape(-1, 3))
    return np.concatenate(points) if points else np.zeros((0, 3))
