"""Readable names of places on the face for lists of constraints: "left mouth corner", not "triangle 10085"."""

from collections import Counter
from collections.abc import Sequence
from functools import lru_cache
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from faceposer.geometry.picking import SurfacePoint, SurfacePoints, surface_positions
from faceposer.model.character import Character
from faceposer.solve.constraints.registry import Constraint

Array = NDArray[np.float64]

# Shares of the head's height. A place closer than _NEAR to a feature point has its name; closer than _ON_LINE to a brow
# or lid, a line between feature points, the name of that; closer than _AROUND to a feature point of another part of the
# face, again its name; farther than _STRAY from all vertices with a region, none.
_NEAR, _ON_LINE, _AROUND, _STRAY = 0.03, 0.035, 0.05, 0.08
# Where the lips meet: their inner edge names only places closer than this share, and otherwise the outer edge does.
_LIP_LINE = 0.008
# A place closer than this share is identified with the feature point.
_AT = 0.004
#: Distances with a name, by the feature points of their ends.
MEASURES: dict[str, tuple[str, str]] = {
    "mouth height": ("2.2", "2.3"),
    "mouth width": ("8.3", "8.4"),
    "left eye height": ("3.1", "3.3"),
    "left eye width": ("3.7", "3.11"),
    "right eye height": ("3.2", "3.4"),
    "right eye width": ("3.8", "3.12"),
}
# Vertices farther from all lips than this share are not part of the mouth.
_MOUTH = 0.15
# Vertices farther from all lips than this share are not a lip, even if the region says so.
_LIP = 0.045
# Number of nearest vertices that vote on the region of a place.
_VOTERS = 7
# Feature points of the inner edge of the lips.
_INNER_LIPS = frozenset(("2.2", "2.3", "2.4", "2.5", "2.6", "2.7", "2.8", "2.9"))
# Brows and lids, by the feature points along them.
_LINES: dict[str, tuple[str, ...]] = {
    "left brow": ("4.5", "4.3", "4.1"),
    "right brow": ("4.6", "4.4", "4.2"),
    "left upper lid": ("3.7", "3.13", "3.11"),
    "right upper lid": ("3.12", "3.14", "3.8"),
    "left lower lid": ("3.7", "3.9", "3.11"),
    "right lower lid": ("3.12", "3.10", "3.8"),
}
# Outer corner of the eye and outer end of the brow; the temple is outside of both, in front of the ear.
_TEMPLES: dict[str, tuple[str, str]] = {"left temple": ("3.7", "4.5"), "right temple": ("3.12", "4.6")}
# Regions whose borders between brow and lid differ from character to character.
_AROUND_BROW = ("forehead", "brow", "lids", "face")
# Samples of a stroke, share from which its most frequent part names it, and share of one side from which it is sided.
_SAMPLES, _MAJORITY, _ONE_SIDED = 25, 0.5, 0.8
# Regions with less than this share of an area are not named.
_NOTABLE = 0.2
# Regions that extend into the temple, where their own names would mislead.
_AROUND_TEMPLE = ("cheek", "forehead", "scalp", "brow", "lids", "face")
# Largest numbers of names that are cached, of points and of areas.
_MOST_NAMES, _MOST_AREAS = 4096, 64


class PointNames:
    """Names of the places on one character."""

    def __init__(self, character: Character) -> None:
        """Prepare the names for ``character``."""
        self._character = character
        self._ids = ids = [name for name in character.feature_points if name in character.feature_titles]
        self._inner = np.array([name in _INNER_LIPS for name in ids], dtype=np.bool_)
        self._titles = [character.feature_titles[name] for name in ids]
        self._positions = (
            character.vertices[[character.feature_points[name] for name in ids]] if ids else np.zeros((0, 3))
        )
        by_size = sorted(character.regions.items(), key=lambda item: len(item[1]), reverse=True)
        self._region_of: dict[int, str] = {}
        for region, vertices in by_size:
            plausible = vertices[self._plausible(region, vertices)]
            self._region_of.update(dict.fromkeys(plausible.tolist(), region))
        # The list of constraints asks for all names in every frame.
        self.name = lru_cache(maxsize=_MOST_NAMES)(self._find)
        self.area = lru_cache(maxsize=_MOST_AREAS)(self._find_area)
        self._labelled = np.array(sorted(self._region_of), dtype=np.int64)
        self._tree: Any = None

    def _plausible(self, region: str, vertices: NDArray[np.integer]) -> NDArray[np.bool_]:
        """Return a mask of the ``vertices`` that can belong to ``region``, shape (n,): the mouth is near the lips."""
        mouth = [i for i, name in enumerate(self._ids) if name.split(".")[0] == "8"]
        if not mouth or region.replace("_", " ").split()[0] not in ("mouth", "lip"):
            return np.ones(len(vertices), dtype=bool)
        offsets = self._character.vertices[vertices][:, None] - self._positions[mouth][None]
        near: NDArray[np.bool_] = np.linalg.norm(offsets, axis=2).min(axis=1) < _MOUTH * self._character.height
        return near

    def of(self, constraint: Constraint) -> str:
        """Return the name of the place of ``constraint``."""
        return constraint.place(self)

    def pair(self, anchors: tuple[SurfacePoint | int, SurfacePoint | int]) -> str:
        """Return the name of the distance between two places."""
        first, second = (self._nearest(anchor) for anchor in anchors)
        for title, (one, other) in MEASURES.items():
            if {first, second} == {one, other}:
                return title
        return f"{self.name(anchors[0])} to {self.name(anchors[1])}"

    def all_of(self, constraints: Sequence[Constraint]) -> list[str]:
        """Return the names of the places of ``constraints``; those of one kind at the same place are numbered."""
        names = [self.of(constraint) for constraint in constraints]
        keys = [(constraint.noun, name) for constraint, name in zip(constraints, names, strict=True)]
        totals, seen = Counter(keys), Counter[tuple[str, str]]()
        for i, key in enumerate(keys):
            seen[key] += 1
            if totals[key] > 1:
                names[i] = f"{names[i]} {seen[key]}"
        return names

    def span(self, points: SurfacePoints) -> str:
        """Return the name of the part along ``points``: "upper lip" for a stroke from one corner to the other."""
        if not len(points):
            return "nothing"
        chosen = np.unique(np.linspace(0, len(points) - 1, min(len(points), _SAMPLES)).round().astype(np.int64))
        names = [self.name(points[int(i)]) for i in chosen]
        if len(set(names)) == 1:
            return names[0]
        parts = [_part(name) for name in names]
        counts = Counter(part for part, _ in parts)
        frequent = [part for part, _ in counts.most_common(2)]
        if counts[frequent[0]] >= _MAJORITY * len(parts):
            frequent = frequent[:1]
        return " and ".join(_sided(part, [side for other, side in parts if other == part]) for part in frequent)

    def _find_area(self, points: SurfacePoints) -> str:
        """Return the name of the area covered by ``points``: the regions with most of them."""
        counts = Counter[str]()
        for corner in points.corners(self._character.triangles)[:, 0].tolist():
            region = self._region_of.get(corner)
            if region is None:
                region = self._region_of[corner] = self._region(self._character.vertices[corner])
            counts[region] += 1
        if len(counts) == 1:
            return _readable(next(iter(counts)))
        notable = [(region, count) for region, count in counts.most_common() if count >= _NOTABLE * len(points)]
        sides: dict[str, list[str]] = {}
        for region, count in notable:
            sides.setdefault(_without_side(region), []).extend([_side_of(region)] * count)
        return ", ".join([_sided(part, found) for part, found in sides.items()][:3]) or "nothing"

    def _nearest(self, point: SurfacePoint | int) -> str | None:
        """Return the feature point at ``point``, or None."""
        position = surface_positions(self._character.vertices, self._character.triangles, [point])[0]
        if not len(self._positions):
            return None
        distances = np.linalg.norm(self._positions - position, axis=1)
        nearest = int(np.argmin(distances))
        return self._ids[nearest] if distances[nearest] < _AT * self._character.height else None

    def _find(self, point: SurfacePoint | int) -> str:
        """Return the name of ``point``, a surface point or the index of a vertex."""
        position = surface_positions(self._character.vertices, self._character.triangles, [point])[0]
        if isinstance(point, SurfacePoint):
            vertex = int(self._character.triangles[point.face, int(np.argmax(point.barycentric))])
        else:
            vertex = point
        own = self._region_of.get(vertex, "")
        if own.startswith("eye"):
            return _readable(own)
        height = self._character.height
        nearest, distance = self._feature_at(position)
        if distance < _NEAR * height:
            return self._titles[nearest]
        line = self._line(position)
        if line is not None:
            return line
        # Feature points of eyes and brows name only themselves, not their surroundings.
        if distance < _AROUND * height and self._ids[nearest].split(".")[0] not in ("3", "4"):
            return self._titles[nearest]
        region = self._region(position)
        word = region.replace("_", " ").split()[0]
        if word == "cheek" and self._between_eyes(position):
            return "root of the nose"
        temple = self._temple(position) if word in _AROUND_TEMPLE else None
        if temple is None and word in _AROUND_BROW:
            temple = self._around_brow(position)
        if word == "lip" and distance > _LIP * height:
            return "mouth"
        return temple or _readable(region)

    def _feature_at(self, position: Array) -> tuple[int, float]:
        """Return index and distance of the feature point that names ``position``, or -1 and infinity."""
        if not len(self._positions):
            return -1, np.inf
        distances = np.linalg.norm(self._positions - position, axis=1)
        inner = self._inner
        distances[inner & (distances > _LIP_LINE * self._character.height)] = np.inf
        # The outer edge of a lip comes first where a character has one vertex for both.
        distances[inner] += 1e-6 * self._character.height
        nearest = int(np.argmin(distances))
        return nearest, float(distances[nearest])

    def _around_brow(self, position: Array) -> str | None:
        """Return brow, upper lid or forehead for a place above an eye, by the lines of brow and lid; None elsewhere."""
        x, y = float(position[0]), float(position[1])
        for side in ("left", "right"):
            lines = (_LINES[f"{side} brow"], _LINES[f"{side} upper lid"])
            brow, lid = ([place for name in line if (place := self._place(name)) is not None] for line in lines)
            if len(brow) < 2 or len(lid) < 2:
                continue
            ends = sorted((float(brow[0][0]), float(brow[-1][0])))
            above, below = (_height_at(line, x) for line in (brow, lid))
            if not ends[0] <= x <= ends[1] or y < below:
                continue
            if y > above:
                return f"{side} brow" if y - above < _ON_LINE * self._character.height else "forehead"
            return f"{side} brow" if above - y < y - below else f"{side} upper lid"
        return None

    def _region(self, position: Array) -> str:
        """Return the region of ``position`` by a vote of the nearest vertices, since single ones may be mislabelled."""
        if not len(self._labelled):
            return "face"
        if self._tree is None:
            # Imported late: it loads slowly, and the first frame of the window does not need it.
            from scipy.spatial import cKDTree

            self._tree = cKDTree(self._character.vertices[self._labelled])
        count = min(_VOTERS, len(self._labelled))
        distances, indices = self._tree.query(position, k=np.arange(1, count + 1))
        if distances[0] > _STRAY * self._character.height:
            return "face"
        regions = [self._region_of[int(self._labelled[index])] for index in indices]
        # A tie goes to the nearest vertex.
        return max(dict.fromkeys(regions), key=regions.count)

    def _place(self, feature: str) -> Array | None:
        vertex = self._character.feature_points.get(feature)
        return None if vertex is None else np.asarray(self._character.vertices[vertex], dtype=np.float64)

    def _line(self, position: Array) -> str | None:
        """Return the brow or lid at ``position``, or None."""
        best, found = _ON_LINE * self._character.height, None
        for title, features in _LINES.items():
            places = [place for feature in features if (place := self._place(feature)) is not None]
            for begin, end in pairwise(places):
                along = end - begin
                share = np.clip((position - begin) @ along / max(float(along @ along), 1e-12), 0.0, 1.0)
                distance = float(np.linalg.norm(begin + share * along - position))
                if distance < best:
                    best, found = distance, title
        return found

    def _between_eyes(self, position: Array) -> bool:
        """Return True if ``position`` is between the eyes, not below their inner corners."""
        corners = [corner for name in ("3.11", "3.8") if (corner := self._place(name)) is not None]
        if len(corners) < 2:
            return False
        low, high = sorted((float(corners[0][0]), float(corners[1][0])))
        level = min(float(corner[1]) for corner in corners)
        return low < float(position[0]) < high and float(position[1]) > level - 0.01 * self._character.height

    def _temple(self, position: Array) -> str | None:
        """Return the temple that contains ``position``, up and back from the outer corner of the eye, or None."""
        height = self._character.height
        for title, (corner, brow) in _TEMPLES.items():
            eye, end = self._place(corner), self._place(brow)
            if eye is None or end is None:
                continue
            side = 1.0 if eye[0] > 0.0 else -1.0
            outside = side * position[0] > side * eye[0] + 0.01 * height
            between = eye[1] - 0.03 * height < position[1] < end[1] + 0.06 * height
            if outside and between and eye[2] - position[2] < 0.35 * height:
                return title
        return None


def _without_side(region: str) -> str:
    """Return "lids" for "lids_left", and "mouth" for a lip."""
    word = region.replace("_", " ").split(maxsplit=1)[0]
    return "mouth" if word == "lip" else word


def _side_of(region: str) -> str:
    """Return "left", "right" or ""."""
    return next((word for word in region.replace("_", " ").split() if word in ("left", "right")), "")


def _part(name: str) -> tuple[str, str]:
    """Return part and side of a place: "upper lip" and "left" for "left half of the outer upper lip"."""
    words = name.rpartition(" of the ")[2].split()
    return " ".join(word for word in words if word not in ("left", "right", "inner", "outer")), _side_of(name)


def _sided(part: str, sides: Sequence[str]) -> str:
    """Return the name of ``part``, with a side if nearly all of it is on that side."""
    side, count = Counter(sides).most_common(1)[0]
    return f"{side} {part}" if side and count >= _ONE_SIDED * len(sides) else part


def _height_at(line: Sequence[Array], x: float) -> float:
    """Return the height of a line of points at ``x``, that of its ends beyond them."""
    ordered = sorted(line, key=lambda point: float(point[0]))
    return float(np.interp(x, [point[0] for point in ordered], [point[1] for point in ordered]))


def _readable(region: str) -> str:
    """Return "left cheek" for "cheek_left" or "cheek left"; regions of trained characters have the latter form."""
    words = region.replace("_", " ").split()
    side = [word for word in words if word in ("left", "right", "upper", "lower")]
    return " ".join(side + [word for word in words if word not in side])
