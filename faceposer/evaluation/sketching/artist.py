"""An artist who draws the features of a true face: which of them, and along which lines."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from faceposer.evaluation.sketching.hand_errors import HandErrors, drawn
from faceposer.geometry.camera import Camera
from faceposer.geometry.picking import pick_pixels
from faceposer.model.character import Character
from faceposer.model.feature_curves import FEATURES, feature_curves
from faceposer.sketch.curve_density import GAPS
from faceposer.sketch.recognition import DrawnStroke

Array = NDArray[np.float64]

#: Distance of lips or lids, in pixels of a view 960 pixels high, below which they are drawn as one line.
ONE_LINE = 12.0
# Least share of a line that must be visible, and how far behind the skin a visible point may be, by height.
_LEAST_VISIBLE, _BEHIND = 0.6, 0.012


@dataclass(frozen=True, eq=False)
class TrueStroke:
    """A stroke with what it depicts.

    Attributes:
        stroke: The stroke with its true feature.
        parameters: Parameter of the feature's chain at each of its points, shape (n,).
        span: Least and greatest parameter of the line that was drawn; whole turns of a closed line.
    """

    stroke: DrawnStroke
    parameters: Array
    span: tuple[float, float]

    @property
    def feature(self) -> str:
        """Name of the true feature."""
        assert self.stroke.feature is not None
        return self.stroke.feature


class Artist:
    """The lines that can be drawn of a true face in a view."""

    def __init__(self, character: Character, vertices: NDArray[np.float32], camera: Camera) -> None:
        """Project the features of the face with ``vertices``, shape (N, 3)."""
        self._camera = camera
        curves = feature_curves(character)
        triangles = character.triangles
        self.lines: dict[str, tuple[Array, Array]] = {}
        places: dict[str, list[tuple[Array, Array]]] = {}
        for name, chains in curves.items():
            places[name] = [(chain.points.positions(vertices, triangles), chain.parameters) for chain in chains]
        open_gaps = {
            gap: _distance(places[upper][0], places[lower][0], camera) >= ONE_LINE
            for gap, (upper, lower) in GAPS.items()
            if upper in places and lower in places
        }
        chosen = {name: _middle(chains) for name, chains in places.items() if _is_drawn(name, open_gaps)}
        seen_of = self._visible(character, vertices, {name: place for name, (place, _) in chosen.items()})
        for name, (place, parameters) in chosen.items():
            seen = seen_of[name]
            if FEATURES[name].closed:
                if seen.mean() >= 0.9:
                    self.lines[name] = camera.project(place), parameters
                continue
            first, last = _longest_run(seen)
            if last - first >= _LEAST_VISIBLE * len(place):
                self.lines[name] = camera.project(place[first:last]), parameters[first:last]

    def _visible(
        self, character: Character, vertices: NDArray[np.float32], lines: dict[str, Array]
    ) -> dict[str, NDArray[np.bool_]]:
        """Return the masks of the points of ``lines`` that no skin hides."""
        solid = character.triangles[character.solid_triangles]
        places = np.concatenate(list(lines.values()))
        points, met = pick_pixels(vertices, solid, self._camera, self._camera.project(places))
        nearest = np.full(len(places), np.inf)
        nearest[met] = self._camera.to_camera(points.positions(vertices, solid))[:, 2]
        seen = self._camera.to_camera(places)[:, 2] <= nearest + _BEHIND * character.height
        ends = np.cumsum([len(place) for place in lines.values()])[:-1]
        return dict(zip(lines, np.split(seen, ends), strict=True))

    def draw(self, feature: str, errors: HandErrors, rng: np.random.Generator) -> TrueStroke:
        """Return a stroke along ``feature``, a key of ``lines``."""
        line, parameters = self.lines[feature]
        result = drawn(line, parameters, FEATURES[feature].closed, errors, rng)
        stroke = DrawnStroke(result.pixels, self._camera, feature)
        return TrueStroke(stroke, result.parameters, (float(parameters[0]), float(parameters[-1])))


def _middle(chains: list[tuple[Array, Array]]) -> tuple[Array, Array]:
    """Return the line between the ``chains`` of a feature, with its parameters."""
    place, parameters = chains[0]
    for other, known in chains[1:]:
        place = 0.5 * (place + _interpolated(parameters, known, other))
    return place, parameters


def _is_drawn(feature: str, open_gaps: dict[str, bool]) -> bool:
    """Return True if ``feature`` is drawn: one line for a closed mouth or eye, and two for an open one."""
    if feature == "mouth line":
        return not open_gaps.get("mouth", False)
    if feature.startswith("inner"):
        return open_gaps.get("mouth", True)
    if "lower lid" in feature or "eye outline" in feature:
        return open_gaps.get("left eye" if feature.startswith("left") else "right eye", True)
    return True


def _distance(upper: tuple[Array, Array], lower: tuple[Array, Array], camera: Camera) -> float:
    """Return the mean distance of the middles of two lines in the image."""
    share = np.linspace(0.25, 0.75, 5)
    ends = [_interpolated(share * known[-1], known, places) for places, known in (upper, lower)]
    return float(np.hypot(*(camera.project(ends[0]) - camera.project(ends[1])).T).mean())


def _interpolated(parameters: Array, known: Array, values: Array) -> Array:
    return np.stack([np.interp(parameters, known, axis) for axis in values.T], axis=1)


def _longest_run(seen: NDArray[np.bool_]) -> tuple[int, int]:
    padded = np.concatenate([[False], seen, [False]]).astype(np.int8)
    begins, ends = np.flatnonzero(np.diff(padded) == 1), np.flatnonzero(np.diff(padded) == -1)
    if not len(begins):
        return 0, 0
    longest = int(np.argmax(ends - begins))
    return int(begins[longest]), int(ends[longest])
