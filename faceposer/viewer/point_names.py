"""Names for places on the face, so that a list of points reads "left mouth corner" and not "triangle 10085"."""

import numpy as np

from faceposer.geometry.picking import SurfacePoint, surface_positions
from faceposer.model.subject import Subject

# Farther from a feature point than this share of the head's height, a place is named by its region.
_NEAR = 0.05


class PointNames:
    """Names the places of one subject."""

    def __init__(self, subject: Subject) -> None:
        """Prepare for ``subject``."""
        self._subject = subject
        ids = [name for name in subject.feature_points if name in subject.feature_titles]
        self._titles = [subject.feature_titles[name] for name in ids]
        self._positions = subject.vertices[[subject.feature_points[name] for name in ids]] if ids else np.zeros((0, 3))
        by_size = sorted(subject.regions.items(), key=lambda item: len(item[1]), reverse=True)
        self._region_of: dict[int, str] = {}
        for region, vertices in by_size:
            self._region_of.update(dict.fromkeys(vertices.tolist(), region))
        self._known: dict[SurfacePoint, str] = {}

    def name(self, point: SurfacePoint) -> str:
        """Return what people call the place ``point``."""
        if point not in self._known:
            self._known[point] = self._find(point)
        return self._known[point]

    def _find(self, point: SurfacePoint) -> str:
        position = surface_positions(self._subject.vertices, self._subject.triangles, [point])[0]
        if len(self._positions):
            distances = np.linalg.norm(self._positions - position, axis=1)
            nearest = int(np.argmin(distances))
            if distances[nearest] < _NEAR * self._subject.height:
                return self._titles[nearest]
        corner = int(np.argmax(point.barycentric))
        region = self._region_of.get(int(self._subject.triangles[point.face, corner]))
        return "face" if region is None else _readable(region)


def _readable(region: str) -> str:
    """Return "left cheek" for "cheek_left"."""
    words = region.split("_")
    side = [word for word in words if word in ("left", "right", "upper", "lower")]
    return " ".join(side + [word for word in words if word not in side])
