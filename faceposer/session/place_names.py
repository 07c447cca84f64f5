"""Names for places on the face, so that a list of points reads "left mouth corner" and not "triangle 10085"."""

from functools import lru_cache
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from faceposer.geometry.picking import SurfacePoint, SurfacePoints, surface_positions
from faceposer.model.character import Character
from faceposer.solve.constraints.registry import Constraint

Array = NDArray[np.float64]

# Shares of the head's height. Nearer to a feature point than the first, a place has its name; nearer to a brow or a lid
# than the second, which are lines between feature points, it is that; nearer than the third, a feature point of another
# part of the face names it; farther than the fourth from all vertices with a region, it has none.
_NEAR, _ON_LINE, _AROUND, _STRAY = 0.03, 0.035, 0.05, 0.08
# Nearer than this share, a place is that feature point.
_AT = 0.004
#: Distances that have a name, by the feature points between which they are measured.
MEASURES: dict[str, tuple[str, str]] = {
    "mouth height": ("2.2", "2.3"),
    "mouth width": ("8.3", "8.4"),
    "left eye height": ("3.1", "3.3"),
    "left eye width": ("3.7", "3.11"),
    "right eye height": ("3.2", "3.4"),
    "right eye width": ("3.8", "3.12"),
}
# Farther from all lips than this share, nothing is of the mouth.
_MOUTH = 0.15
# How many vertices say in which region a place is.
_VOTERS = 7
# Brows and lids, by the feature points that they run through.
_LINES: dict[str, tuple[str, ...]] = {
    "left brow": ("4.5", "4.3", "4.1"),
    "right brow": ("4.6", "4.4", "4.2"),
    "left upper lid": ("3.7", "3.13", "3.11"),
    "right upper lid": ("3.12", "3.14", "3.8"),
    "left lower lid": ("3.7", "3.9", "3.11"),
    "right lower lid": ("3.12", "3.10", "3.8"),
}
# Outer corner of the eye, and outer end of the brow: beside them, before the ear, is the temple.
_TEMPLES: dict[str, tuple[str, str]] = {"left temple": ("3.7", "4.5"), "right temple": ("3.12", "4.6")}
# Regions that reach into the temple, whose own name would mislead there.
_AROUND_TEMPLE = ("cheek", "forehead", "scalp", "brow", "lids", "face")


# Largest numbers of names that are cached, of points and of areas.
_MOST_NAMES, _MOST_AREAS = 4096, 64


class PointNames:
    """Names the places of one character."""

    def __init__(self, character: Character) -> None:
        """Prepare for ``character``."""
        self._character = character
        self._ids = ids = [name for name in character.feature_points if name in character.feature_titles]
        self._titles = [character.feature_titles[name] for name in ids]
        self._positions = (
            character.vertices[[character.feature_points[name] for name in ids]] if ids else np.zeros((0, 3))
        )
        by_size = sorted(character.regions.items(), key=lambda item: len(item[1]), reverse=True)
        self._region_of: dict[int, str] = {}
        for region, vertices in by_size:
            sound = vertices[self._plausible(region, vertices)]
            self._region_of.update(dict.fromkeys(sound.tolist(), region))
        # The list of constraints asks for all names in every frame.
        self.name = lru_cache(maxsize=_MOST_NAMES)(self._find)
        self.area = lru_cache(maxsize=_MOST_AREAS)(self._find_area)
        self._labelled = np.array(sorted(self._region_of), dtype=np.int64)
        self._tree: Any = None

    def _plausible(self, region: str, vertices: NDArray[np.integer]) -> NDArray[np.bool_]:
        """Return which of ``vertices`` can be of ``region``, shape (n,): the mouth is nowhere but at the lips."""
        mouth = [i for i, name in enumerate(self._ids) if name.split(".")[0] == "8"]
        if not mouth or region.replace("_", " ").split()[0] not in ("mouth", "lip"):
            return np.ones(len(vertices), dtype=bool)
        offsets = self._character.vertices[vertices][:, None] - self._positions[mouth][None]
        near: NDArray[np.bool_] = np.linalg.norm(offsets, axis=2).min(axis=1) < _MOUTH * self._character.height
        return near

    def of(self, constraint: Constraint) -> str:
        """Return the name of the place that ``constraint`` speaks of."""
        return constraint.place(self)

    def pair(self, anchors: tuple[SurfacePoint | int, SurfacePoint | int]) -> str:
        """Return what people call the distance between two places."""
        first, second = (self._nearest(anchor) for anchor in anchors)
        for title, (one, other) in MEASURES.items():
            if {first, second} == {one, other}:
                return title
        return f"{self.name(anchors[0])} to {self.name(anchors[1])}"

    def _find_area(self, points: SurfacePoints) -> str:
        """Return what people call the area that ``points`` cover: the regions with most of them."""
        counts: dict[str, int] = {}
        for corner in points.corners(self._character.triangles)[:, 0].tolist():
            region = self._region_of.get(corner)
            if region is None:
                region = self._region_of[corner] = self._region(self._character.vertices[corner])
            counts[region] = counts.get(region, 0) + 1
        names = sorted(counts, key=lambda name: -counts[name])
        plain = list(dict.fromkeys(_without_side(name) for name in names if counts[name] * 5 >= len(points)))
        if len(names) == 1:
            plain = [_readable(names[0])]
        return ", ".join(plain[:3]) or "nothing"

    def _nearest(self, point: SurfacePoint | int) -> str | None:
        """Return the feature point that lies at ``point``, or None."""
        position = surface_positions(self._character.vertices, self._character.triangles, [point])[0]
        if not len(self._positions):
            return None
        distances = np.linalg.norm(self._positions - position, axis=1)
        nearest = int(np.argmin(distances))
        return self._ids[nearest] if distances[nearest] < _AT * self._character.height else None

    def _find(self, point: SurfacePoint | int) -> str:
        """Return what people call the place ``point``, a surface point or the index of a vertex."""
        position = surface_positions(self._character.vertices, self._character.triangles, [point])[0]
        if isinstance(point, SurfacePoint):
            vertex = int(self._character.triangles[point.face, int(np.argmax(point.barycentric))])
        else:
            vertex = point
        own = self._region_of.get(vertex, "")
        if own.startswith("eye"):
            return _readable(own)
        height = self._character.height
        nearest, distance = -1, np.inf
        if len(self._positions):
            distances = np.linalg.norm(self._positions - position, axis=1)
            nearest = int(np.argmin(distances))
            distance = float(distances[nearest])
        if distance < _NEAR * height:
            return self._titles[nearest]
        line = self._line(position)
        if line is not None:
            return line
        # Points of eyes and brows stand for them alone: a place beside them is something else.
        if distance < _AROUND * height and self._ids[nearest].split(".")[0] not in ("3", "4"):
            return self._titles[nearest]
        region = self._region(position)
        word = region.replace("_", " ").split()[0]
        if word == "cheek" and self._between_eyes(position):
            return "root of the nose"
        temple = self._temple(position) if word in _AROUND_TEMPLE else None
        return temple or _readable(region)

    def _region(self, position: Array) -> str:
        """Return the region around ``position``: that of most of the nearest vertices, some of which may stray."""
        if not len(self._labelled):
            return "face"
        if self._tree is None:
            # Here and not above: the window's first frame needs none, and loading it takes time.
            from scipy.spatial import cKDTree

            self._tree = cKDTree(self._character.vertices[self._labelled])
        count = min(_VOTERS, len(self._labelled))
        distances, indices = self._tree.query(position, k=np.arange(1, count + 1))
        if distances[0] > _STRAY * self._character.height:
            return "face"
        regions = [self._region_of[int(self._labelled[index])] for index in indices]
        # Of equals the nearest.
        return max(dict.fromkeys(regions), key=regions.count)

    def _place(self, feature: str) -> Array | None:
        vertex = self._character.feature_points.get(feature)
        return None if vertex is None else np.asarray(self._character.vertices[vertex], dtype=np.float64)

    def _line(self, position: Array) -> str | None:
        """Return the brow or lid on which ``position`` lies, or None."""
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
        """Whether ``position`` lies between the eyes, not lower than their inner corners."""
        corners = [corner for name in ("3.11", "3.8") if (corner := self._place(name)) is not None]
        if len(corners) < 2:
            return False
        low, high = sorted((float(corners[0][0]), float(corners[1][0])))
        level = min(float(corner[1]) for corner in corners)
        return low < float(position[0]) < high and float(position[1]) > level - 0.01 * self._character.height

    def _temple(self, position: Array) -> str | None:
        """Return the temple on which ``position`` lies, from the eye's outer corner back and up, or None."""
        height = self._character.height
        for title, (corner, brow) in _TEMPLES.items():
            eye, end = self._place(corner), self._place(brow)
            if eye is None or end is None:
                continue
            side = 1.0 if eye[0] > 0.0 else -1.0
            beside = side * position[0] > side * eye[0] + 0.01 * height
            between = eye[1] - 0.03 * height < position[1] < end[1] + 0.06 * height
            if beside and between and eye[2] - position[2] < 0.35 * height:
                return title
        return None


def _without_side(region: str) -> str:
    """Return "lids" for "lids_left", and "mouth" for a lip."""
    word = region.replace("_", " ").split(maxsplit=1)[0]
    return "mouth" if word == "lip" else word


def _readable(region: str) -> str:
    """Return "left cheek" for "cheek_left", and for "cheek left", as regions of examples are called."""
    words = region.replace("_", " ").split()
    side = [word for word in words if word in ("left", "right", "upper", "lower")]
    return " ".join(side + [word for word in words if word not in side])
