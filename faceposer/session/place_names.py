"""Names for places on the face, so that a list of points reads "left mouth corner" and not "triangle 10085"."""

import numpy as np

from faceposer.geometry.picking import SurfacePoint, SurfacePoints, surface_positions
from faceposer.model.subject import Subject
from faceposer.solve.constraints.registry import Constraint

# Farther from a feature point than this share of the head's height, a place is named by its region.
_NEAR = 0.05
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


class PointNames:
    """Names the places of one subject."""

    def __init__(self, subject: Subject) -> None:
        """Prepare for ``subject``."""
        self._subject = subject
        self._ids = ids = [name for name in subject.feature_points if name in subject.feature_titles]
        self._titles = [subject.feature_titles[name] for name in ids]
        self._positions = subject.vertices[[subject.feature_points[name] for name in ids]] if ids else np.zeros((0, 3))
        by_size = sorted(subject.regions.items(), key=lambda item: len(item[1]), reverse=True)
        self._region_of: dict[int, str] = {}
        for region, vertices in by_size:
            self._region_of.update(dict.fromkeys(vertices.tolist(), region))
        self._known: dict[SurfacePoint | int, str] = {}

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

    def area(self, points: SurfacePoints) -> str:
        """Return what people call the area that ``points`` cover: the regions with most of them."""
        counts: dict[str, int] = {}
        for corner in points.corners(self._subject.triangles)[:, 0].tolist():
            region = self._region_of.get(corner, "face")
            counts[region] = counts.get(region, 0) + 1
        names = sorted(counts, key=lambda name: -counts[name])
        plain = list(dict.fromkeys(_without_side(name) for name in names if counts[name] * 5 >= len(points)))
        if len(names) == 1:
            plain = [_readable(names[0])]
        return ", ".join(plain[:3]) or "nothing"

    def _nearest(self, point: SurfacePoint | int) -> str | None:
        """Return the feature point that lies at ``point``, or None."""
        position = surface_positions(self._subject.vertices, self._subject.triangles, [point])[0]
        if not len(self._positions):
            return None
        distances = np.linalg.norm(self._positions - position, axis=1)
        nearest = int(np.argmin(distances))
        return self._ids[nearest] if distances[nearest] < _AT * self._subject.height else None

    def name(self, point: SurfacePoint | int) -> str:
        """Return what people call the place ``point``, a surface point or the index of a vertex."""
        if point not in self._known:
            self._known[point] = self._find(point)
        return self._known[point]

    def _find(self, point: SurfacePoint | int) -> str:
        position = surface_positions(self._subject.vertices, self._subject.triangles, [point])[0]
        if len(self._positions):
            distances = np.linalg.norm(self._positions - position, axis=1)
            nearest = int(np.argmin(distances))
            if distances[nearest] < _NEAR * self._subject.height:
                return self._titles[nearest]
        if isinstance(point, SurfacePoint):
            vertex = int(self._subject.triangles[point.face, int(np.argmax(point.barycentric))])
        else:
            vertex = point
        region = self._region_of.get(vertex)
        return "face" if region is None else _readable(region)


def _without_side(region: str) -> str:
    """Return "lids" for "lids_left", and "mouth" for a lip."""
    word = region.replace("_", " ").split(maxsplit=1)[0]
    return "mouth" if word == "lip" else word


def _readable(region: str) -> str:
    """Return "left cheek" for "cheek_left", and for "cheek left", as regions of examples are called."""
    words = region.replace("_", " ").split()
    side = [word for word in words if word in ("left", "right", "upper", "lower")]
    return " ".join(side + [word for word in words if word not in side])
