"""Curves along the features of a face: brows, lids, lips, nose wings, cheeks and jaw.

A feature is a chain of MPEG-4's feature points. Its curve follows the surface of the neutral face from point to point;
as points of the surface, it moves with every pose. From point to point it takes the path along the mesh's edges that
costs least, where an edge of length l at the distance d from a smooth curve through the feature points costs
l (1 + (d / s)^2) with s a tenth of the distance of the two feature points. The path stays on one lip where both touch,
because it follows edges. It is then smoothed and laid on the adjacent triangles again.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from faceposer.geometry.nearest_surface import NearestSurface
from faceposer.geometry.picking import SurfacePoints
from faceposer.model.character import Character

Array = NDArray[np.float64]
Ids = NDArray[np.intp]

# Spacing of the points of a curve as a share of the head's height, and rounds of smoothing.
_SPACING, _SMOOTHING = 0.006, 12
# Extent of the search for a path around its two ends, as a multiple of their distance, and the tolerance s as a share.
_SEARCH, _TOLERANCE = 1.5, 0.1


@dataclass(frozen=True)
class Feature:
    """A drawable feature of the face.

    Attributes:
        name: Stable English name, such as "left upper lid"; left is the character's.
        chains: Names of feature points from end to end. One stroke along the closed mouth is on both inner lips, which
            are two chains; all others have one.
        closed: True if the last point of a chain is connected to the first.
        mirror: Name of the feature on the other side; its own for a feature that crosses the middle.
        components: Features that this one consists of, such as both lids of the outline of an eye; empty for most.
    """

    name: str
    chains: tuple[tuple[str, ...], ...]
    closed: bool = False
    mirror: str = ""
    components: tuple[str, ...] = ()

    @property
    def points(self) -> tuple[str, ...]:
        """Names of all its feature points, without repetitions."""
        return tuple(dict.fromkeys(name for chain in self.chains for name in chain))


def _sided(name: str, left: tuple[str, ...], right: tuple[str, ...]) -> tuple[Feature, Feature]:
    names = f"left {name}", f"right {name}"
    return Feature(names[0], (left,), mirror=names[1]), Feature(names[1], (right,), mirror=names[0])


_OUTER_UPPER = ("8.4", "8.6", "8.9", "8.1", "8.10", "8.5", "8.3")
_OUTER_LOWER = ("8.4", "8.8", "8.2", "8.7", "8.3")
_INNER_UPPER = ("2.5", "2.7", "2.2", "2.6", "2.4")
_INNER_LOWER = ("2.5", "2.9", "2.3", "2.8", "2.4")

#: All drawable features in a fixed order, by name.
FEATURES: Mapping[str, Feature] = {
    feature.name: feature
    for feature in (
        *_sided("brow", ("4.1", "4.3", "4.5"), ("4.2", "4.4", "4.6")),
        *_sided("upper lid", ("3.11", "3.1", "3.7"), ("3.8", "3.2", "3.12")),
        *_sided("lower lid", ("3.11", "3.3", "3.7"), ("3.8", "3.4", "3.12")),
        Feature(
            "left eye outline",
            (("3.11", "3.1", "3.7", "3.3"),),
            closed=True,
            mirror="right eye outline",
            components=("left upper lid", "left lower lid"),
        ),
        Feature(
            "right eye outline",
            (("3.8", "3.2", "3.12", "3.4"),),
            closed=True,
            mirror="left eye outline",
            components=("right upper lid", "right lower lid"),
        ),
        Feature("outer upper lip", (_OUTER_UPPER,), mirror="outer upper lip"),
        Feature("outer lower lip", (_OUTER_LOWER,), mirror="outer lower lip"),
        Feature("inner upper lip", (_INNER_UPPER,), mirror="inner upper lip"),
        Feature("inner lower lip", (_INNER_LOWER,), mirror="inner lower lip"),
        Feature(
            "mouth line",
            (_INNER_UPPER, _INNER_LOWER),
            mirror="mouth line",
            components=("inner upper lip", "inner lower lip"),
        ),
        Feature(
            "mouth outline",
            ((*_OUTER_UPPER, *_OUTER_LOWER[-2:0:-1]),),
            closed=True,
            mirror="mouth outline",
            components=("outer upper lip", "outer lower lip"),
        ),
        *_sided("nose wing", ("9.1", "9.5", "9.15"), ("9.2", "9.4", "9.15")),
        *_sided("cheek line", ("5.3", "5.1", "8.3"), ("5.4", "5.2", "8.4")),
        Feature("jaw line", (("2.14", "2.12", "2.1", "2.11", "2.13"),), mirror="jaw line"),
    )
}


def _mirrored_points() -> dict[str, str]:
    pairs: dict[str, str] = {}
    for feature in FEATURES.values():
        for chain, other in zip(feature.chains, FEATURES[feature.mirror].chains, strict=True):
            if feature.mirror != feature.name:
                pairs.update(zip(chain, other, strict=True))
            elif not feature.closed:
                pairs.update(zip(chain, reversed(chain), strict=True))
    return pairs


#: Feature points of the drawable features with their images on the other side of the face.
MIRRORED_POINTS: Mapping[str, str] = _mirrored_points()


@dataclass(frozen=True, eq=False)
class FeatureCurve:
    """The curve along one chain of feature points of a character.

    Attributes:
        points: Points of the surface in order, about evenly spaced, shape (m,); those of a closed curve end where they
            begin.
        parameters: Parameter of each point: i at the i-th feature point, in proportion to the length on the neutral
            face between two of them, shape (m,).
        names: Names of the feature points; a closed curve ends with its first again.
    """

    points: SurfacePoints
    parameters: Array
    names: tuple[str, ...]

    @cached_property
    def knots(self) -> Ids:
        """Index of each feature point among the points, shape (k,)."""
        return np.searchsorted(self.parameters, np.arange(len(self.names)) - 1e-9).astype(np.intp)


@lru_cache(maxsize=2)
def drawable_features(character: Character) -> tuple[str, ...]:
    """Return the names of the features whose points the ``character`` has, not all at one place, in a fixed order."""
    known = character.feature_points
    if not character.height > 0.0:
        return ()
    return tuple(
        feature.name
        for feature in FEATURES.values()
        if all(name in known for name in feature.points)
        and np.ptp(character.vertices[[known[name] for name in feature.points]], axis=0).any()
    )


@lru_cache(maxsize=2)
def feature_curves(character: Character) -> Mapping[str, tuple[FeatureCurve, ...]]:
    """Return the curves of all features whose feature points the ``character`` has, by name, one per chain."""
    known = character.feature_points
    tracer = _Tracer(character)
    return {
        feature.name: tuple(tracer.curve(chain, feature.closed) for chain in feature.chains)
        for feature in FEATURES.values()
        if all(name in known for name in feature.points)
    }


class _Tracer:
    """Paths on the skin of a character, each segment computed once."""

    def __init__(self, character: Character) -> None:
        self._character = character
        self._vertices = character.vertices.astype(np.float64)
        self._triangles = character.triangles
        self._solid = character.solid_triangles
        self._spacing = _SPACING * character.height
        self._paths: dict[tuple[int, int], Ids] = {}

    def curve(self, chain: tuple[str, ...], closed: bool) -> FeatureCurve:
        """Return the curve along ``chain``."""
        names = (*chain, chain[0]) if closed else chain
        ids = [self._character.feature_points[name] for name in names]
        knots = self._vertices[ids]
        paths = [self._found(a, b, _smooth_through(knots, i, closed)) for i, (a, b) in enumerate(pairwise(ids))]
        places, parameters = [knots[:1]], [np.zeros(1)]
        for i, path in enumerate(paths):
            even, share = _even(_smoothed(self._vertices[path]), self._spacing)
            places.append(even[1:])
            parameters.append(i + share[1:])
        on_path = np.zeros(len(self._vertices), dtype=bool)
        on_path[np.concatenate(paths)] = True
        near = self._solid[on_path[self._triangles[self._solid]].any(axis=1)]
        points, _ = NearestSurface(self._vertices, self._triangles, near).points(np.concatenate(places))
        return FeatureCurve(points, np.concatenate(parameters), names)

    def _found(self, begin: int, end: int, guide: Array) -> Ids:
        """Return ``_path``, the same in both directions and for all features that share it."""
        if (end, begin) in self._paths:
            return self._paths[end, begin][::-1]
        if (begin, end) not in self._paths:
            self._paths[begin, end] = self._path(begin, end, guide)
        return self._paths[begin, end]

    def _path(self, begin: int, end: int, guide: Array) -> Ids:
        """Return the vertices of the best path from ``begin`` to ``end`` along the polyline ``guide``, shape (g, 3)."""
        # Imported late to shorten the start of the window.
        from scipy.sparse import csr_array
        from scipy.sparse.csgraph import dijkstra
        from scipy.spatial import cKDTree

        ends = self._vertices[[begin, end]]
        span = float(np.linalg.norm(ends[1] - ends[0]))
        solid = self._triangles[self._solid]
        near = np.linalg.norm(self._vertices - ends.mean(axis=0), axis=1) < max(_SEARCH * span, 4.0 * self._spacing)
        triangles = solid[near[solid].all(axis=1)]
        sides = np.sort(triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1).astype(np.int64)
        coded = np.unique(sides[:, 0] * len(self._vertices) + sides[:, 1])
        edges = np.stack(np.divmod(coded, len(self._vertices)), axis=1)
        if not len(edges):
            return np.array([begin, end])
        ids = np.unique(edges)
        distance, _ = cKDTree(guide).query(self._vertices[edges].mean(axis=1))
        length = np.linalg.norm(np.diff(self._vertices[edges], axis=1)[:, 0], axis=1)
        cost = np.maximum(length, 1e-9) * (1.0 + (distance / (_TOLERANCE * max(span, 1e-9))) ** 2)
        local = np.searchsorted(ids, edges)
        graph = csr_array((cost, (local[:, 0], local[:, 1])), shape=(len(ids), len(ids)))
        first, last = np.searchsorted(ids, [begin, end])
        if max(first, last) >= len(ids) or ids[first] != begin or ids[last] != end:
            return np.array([begin, end])
        _, before = dijkstra(graph, directed=False, indices=first, return_predecessors=True)
        path = [int(last)]
        while path[-1] != first:
            step = int(before[path[-1]])
            if step < 0:
                return np.array([begin, end])
            path.append(step)
        return ids[path[::-1]].astype(np.intp)


def _smooth_through(knots: Array, i: int, closed: bool) -> Array:
    """Return a cardinal spline through ``knots``, shape (k, 3), from knot ``i`` to the next, shape (32, 3)."""
    count = len(knots)
    if closed:
        before, after = knots[(i - 1) % (count - 1)], knots[(i + 2) % (count - 1)]
    else:
        before, after = knots[max(i - 1, 0)], knots[min(i + 2, count - 1)]
    a, b = knots[i], knots[i + 1]
    t = np.linspace(0.0, 1.0, 32)[:, None]
    leave, arrive = 0.5 * (b - before), 0.5 * (after - a)
    return np.asarray(
        (2.0 * t**3 - 3.0 * t**2 + 1.0) * a
        + (t**3 - 2.0 * t**2 + t) * leave
        + (3.0 * t**2 - 2.0 * t**3) * b
        + (t**3 - t**2) * arrive
    )


def _smoothed(line: Array) -> Array:
    """Return the polyline ``line``, shape (n, 3), smoothed between its ends."""
    line = line.copy()
    for _ in range(_SMOOTHING):
        line[1:-1] = 0.5 * line[1:-1] + 0.25 * (line[:-2] + line[2:])
    return line


def _even(line: Array, spacing: float) -> tuple[Array, Array]:
    """Return points about ``spacing`` apart on the polyline ``line``, (n, 3), with their shares of its length, (m,)."""
    steps = np.linalg.norm(np.diff(line, axis=0), axis=1)
    along = np.concatenate([[0.0], np.cumsum(steps)])
    if not along[-1] > 0.0:
        # Feature points may coincide.
        return np.repeat(line[:1], 4, axis=0), np.linspace(0.0, 1.0, 4)
    share = np.linspace(0.0, 1.0, max(4, round(along[-1] / spacing) + 1))
    places = np.stack([np.interp(share * along[-1], along, axis) for axis in line.T], axis=1)
    return places, share
