"""Feature points on strokes that show all of a feature, as those of drawings do."""

import numpy as np
from numpy.typing import NDArray

from faceposer.model.face_model import FaceModel
from faceposer.model.feature_curves import FEATURES, FeatureCurve, feature_curves
from faceposer.sketch.polyline import at_lengths, lengths_along
from faceposer.sketch.recognition import DrawnStroke, MatchedPoint

Array = NDArray[np.float64]


def matched_whole(model: FaceModel, stroke: DrawnStroke, name: str) -> tuple[MatchedPoint, ...]:
    """Return the feature points of the feature ``name`` along ``stroke``, at the shares of their neutral lengths.

    An open stroke goes from end to end. A closed one has corners at its left and right ends; both parts between them
    are matched by themselves.
    """
    character = model.character
    points: dict[str, MatchedPoint] = {}
    for curve in feature_curves(character)[name]:
        pixels = stroke.camera.project(curve.points.positions(character.vertices, model.triangles))
        places = (
            _around(curve, pixels, stroke.pixels) if FEATURES[name].closed else _along(curve, pixels, stroke.pixels)
        )
        for point, (u, v) in zip(curve.names, places.tolist(), strict=True):
            points.setdefault(point, MatchedPoint(point, (u, v)))
    return tuple(points.values())


def _along(curve: FeatureCurve, pixels: Array, line: Array) -> Array:
    """Return the places of the knots of an open ``curve``, seen at ``pixels``, on ``line``."""
    ends = pixels[[0, -1]]
    if np.linalg.norm(line[[0, -1]] - ends) > np.linalg.norm(line[[-1, 0]] - ends):
        line = line[::-1]
    along, lengths = lengths_along(pixels), lengths_along(line)
    return at_lengths(line, lengths, along[curve.knots] / max(float(along[-1]), 1e-9) * lengths[-1])


def _around(curve: FeatureCurve, pixels: Array, line: Array) -> Array:
    """Return the places of the knots of a closed ``curve``, seen at ``pixels``, on ``line``."""
    places = np.zeros((len(curve.knots), 2))
    knots = pixels[curve.knots[:-1]]
    corners = int(np.argmin(knots[:, 0])), int(np.argmax(knots[:, 0]))
    upper, lower = _parts(line)
    for begin, end in (corners, corners[::-1]):
        # From corner to corner in the order of the curve.
        count = (end - begin) % len(knots)
        order = (begin + np.arange(count + 1)) % len(knots)
        a, b = int(curve.knots[begin]), int(curve.knots[end])
        whole = len(pixels) - 1
        samples = (a + np.arange((b - a) % whole + 1)) % whole
        part = pixels[samples]
        along = lengths_along(part)
        offsets = (curve.knots[order] - a) % whole
        middle = 0.5 * (part[0] + part[-1])
        side = upper if part[:, 1].mean() < middle[1] else lower
        if (part[0, 0] > part[-1, 0]) != (side[0, 0] > side[-1, 0]):
            side = side[::-1]
        lengths = lengths_along(side)
        places[order] = at_lengths(side, lengths, along[offsets] / max(float(along[-1]), 1e-9) * lengths[-1])
    places[-1] = places[0]
    return places


def _parts(line: Array) -> tuple[Array, Array]:
    """Return the upper and the lower part of a closed ``line``, each from its left to its right end."""
    ring = line[:-1] if np.array_equal(line[0], line[-1]) else line
    ring = np.roll(ring, -int(np.argmin(ring[:, 0])), axis=0)
    right = int(np.argmax(ring[:, 0]))
    first, second = ring[: right + 1], np.concatenate([ring[right:], ring[:1]])[::-1]
    return (first, second) if _height(first) < _height(second) else (second, first)


def _height(part: Array) -> float:
    """Return the mean v of ``part`` by length."""
    steps = np.linalg.norm(np.diff(part, axis=0), axis=1)
    return float((0.5 * (part[1:, 1] + part[:-1, 1]) * steps).sum() / max(float(steps.sum()), 1e-9))
