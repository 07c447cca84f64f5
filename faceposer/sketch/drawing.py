"""Whole drawings: all strokes recognised together, aligned to a face, and freed from the drawing's proportions."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from faceposer.errors import FacePoserError
from faceposer.geometry.camera import Camera
from faceposer.model.feature_curves import FEATURES
from faceposer.progress import Progress
from faceposer.sketch.drawing_alignment import Assignment, StrokeEvidence, aligned, assigned, similar
from faceposer.sketch.feature_templates import LOOSE, NOSE_BASE, ViewedFeatures, no_feature
from faceposer.sketch.hand import SAMPLES
from faceposer.sketch.joint_density import JointDensity
from faceposer.sketch.outlines import is_closed
from faceposer.sketch.polyline import evenly, lengths_along
from faceposer.sketch.proportions import GROUPS, NEED_NEUTRAL, Frame, GroupMap, by_neutral, by_statistics
from faceposer.sketch.recognition import Candidate, DrawnStroke
from faceposer.sketch.sketcher import Sketcher
from faceposer.sketch.svg_file import SvgDrawing, SvgStroke
from faceposer.sketch.whole_features import matched_whole

Array = NDArray[np.float64]

# Features by which drawings are aligned; the others are too much like hair, ears and wrinkles.
_LEFT_OUT = ("jaw line", "cheek line", "nose wing")
# Number of alignments that are compared by the joint density.
_COMPARED = 2
# Sizes from which the search for the best assignment starts again, relative to that of its first result.
_SIZES = (0.6, 0.75, 1.0, 1.3)
# Width of the line below a mouth, as a share of that of the mouth, up to which it is a shadow.
_SHADOW = 0.6
# Fewest features of a face.
_FEWEST = 2
# Fewest features whose middles tell the size of a drawing.
_SETTLED = 4
# Least probability of a runner-up.
_LEAST = 1e-3
# Gap of two pieces of a feature, as a share of their length, and number of points of a joined stroke.
_GAP, _POINTS = 0.15, 300


@dataclass(frozen=True, eq=False)
class RecognisedStroke:
    """What a line of a drawing depicts.

    Attributes:
        name: Its name in the file, or "".
        stroke: The line in the image, in the proportions of the face if it has a feature.
        candidate: Its feature with the matched points, or None.
        runner_up: The second feature, or None.
        only_aligns: True for the nose, which tells where the face is but shapes nothing.
        joined: Index of the line that it continues, or None.
    """

    name: str
    stroke: DrawnStroke
    candidate: Candidate | None
    runner_up: Candidate | None = None
    only_aligns: bool = False
    joined: int | None = None


@dataclass(frozen=True, eq=False)
class RecognisedDrawing:
    """What a drawing depicts.

    Attributes:
        strokes: Its lines, in the order of the file; those of a neutral face are left out.
        scale: Pixels of the image per pixel of the drawing.
        rotation: Rotation from the drawing to the image, in radians, clockwise.
        relative: "assumed" or "drawn" for the neutral face by which it is judged, or "off".
        remarks: Phrases on what was left out of the file.
    """

    strokes: tuple[RecognisedStroke, ...]
    scale: float
    rotation: float
    relative: str
    remarks: tuple[str, ...] = ()


@dataclass(frozen=True)
class _Aligned:
    """Lines of a drawing that are assigned to features."""

    lines: tuple[Array, ...]
    theta: Array
    features: Mapping[str, int]
    probabilities: Mapping[int, tuple[float, tuple[str, float] | None]]
    joined: Mapping[int, int]

    def by_feature(self) -> dict[str, Array]:
        """Return the lines in units of the hand by feature."""
        return {name: similar(self.lines[i], self.theta) for name, i in self.features.items()}


def recognise_drawing(
    sketcher: Sketcher,
    drawing: SvgDrawing,
    camera: Camera,
    relative: bool = True,
    neutral: SvgDrawing | None = None,
    progress: Progress | None = None,
) -> RecognisedDrawing:
    """Return what the lines of ``drawing`` depict and where they lie in the image of ``camera``.

    Args:
        sketcher: The sketcher of the character.
        drawing: The lines; those of its neutral layer are the neutral face unless ``neutral`` is given.
        camera: The view of the face.
        relative: True to free the lines from the drawing's proportions.
        neutral: A drawing of the same face without an expression; not used unless ``relative``.
        progress: Receives the progress, and may stop the work.

    Raises:
        FacePoserError: If no face is found.
    """
    progress = progress or Progress()
    features = ViewedFeatures(sketcher.model, sketcher.training.coefficients, camera)
    aligner = _Aligner(features)
    strokes = [stroke for stroke in drawing.strokes if not stroke.neutral]
    layer = [stroke for stroke in drawing.strokes if stroke.neutral]
    if not strokes:
        raise FacePoserError("All lines of the drawing are in its layer 'neutral'; draw the expression in another one.")
    rest: _Aligned | None = None
    if neutral is not None and relative:
        rest = aligner.align(neutral.strokes, Progress(), "neutral drawing")
    if neutral is None and layer and relative:
        # Both are drawn on one page: one similarity aligns them.
        rest = aligner.align(layer, Progress(), "layer 'neutral'")
        found = aligner.align(strokes, progress, "drawing", rest.theta)
    else:
        found = aligner.align(strokes, progress, "drawing")
    maps: Mapping[str, GroupMap] = {}
    if relative:
        maps = by_statistics(features, found.by_feature())
        if rest is not None:
            maps = {**maps, **by_neutral(features, rest.by_feature())}
    recognised = _recognised(sketcher, features, strokes, found, maps, relative, progress)
    a, b = found.theta[:2]
    kind = ("drawn" if rest is not None else "assumed") if relative else "off"
    scale = float(np.hypot(a, b)) * features.unit / _normalisation(strokes)[1]
    return RecognisedDrawing(recognised, scale, float(np.arctan2(b, a)), kind, drawing.remarks)


def _recognised(
    sketcher: Sketcher,
    features: ViewedFeatures,
    strokes: Sequence[SvgStroke],
    found: _Aligned,
    maps: Mapping[str, GroupMap],
    relative: bool,
    progress: Progress,
) -> tuple[RecognisedStroke, ...]:
    of_stroke = {stroke: name for name, stroke in found.features.items()}
    result = []
    for i, stroke in enumerate(strokes):
        progress.at("Matching points", 0.8 + 0.2 * i / len(strokes))
        name = of_stroke.get(i)
        line = similar(found.lines[i], found.theta)
        group = None if name is None else next(g for g, names in GROUPS.items() if name in names)
        # Only a neutral face that has the feature, too, tells its proportions.
        unknown = relative and group in NEED_NEUTRAL and group not in maps
        left_out = unknown or (name == "outer lower lip" and _is_shadow(found))
        if group is not None and group in maps:
            line = maps[group](line)
        drawn = DrawnStroke(features.pixels(line), features.camera, None if name == NOSE_BASE else name)
        first = second = None
        if name is not None and name in FEATURES and not left_out:
            probability, other = found.probabilities[i]
            points = matched_whole(sketcher.model, drawn, name)
            if points:
                first = Candidate(name, probability, points)
                second = None if other is None else Candidate(other[0], other[1], ())
        only = name == NOSE_BASE or (name is not None and left_out)
        result.append(RecognisedStroke(stroke.name, drawn, first, second, only, found.joined.get(i)))
    return tuple(result)


def _is_shadow(found: _Aligned) -> bool:
    """Return True if the line of the lower lip is but the short shadow below it, as many artists draw it."""
    lines = found.by_feature()
    line, mouth = lines["outer lower lip"], lines.get("mouth line")
    return mouth is not None and float(np.ptp(line[:, 0])) < _SHADOW * float(np.ptp(mouth[:, 0]))


def _normalisation(strokes: Sequence[SvgStroke]) -> tuple[Array, float]:
    """Return the middle and the size of a drawing."""
    points = np.concatenate([stroke.points for stroke in strokes])
    low, high = points.min(axis=0), points.max(axis=0)
    return 0.5 * (low + high), max(float((high - low).max()), 1e-9)


class _Aligner:
    """Alignment of drawings to the features of one character in one view."""

    def __init__(self, features: ViewedFeatures) -> None:
        self._features = features
        self._joint = JointDensity(features)
        self._density = features.density(LOOSE)
        self._nothing = no_feature()

    def align(
        self, strokes: Sequence[SvgStroke], progress: Progress, noun: str, theta: Array | None = None
    ) -> _Aligned:
        """Return the joint assignment of ``strokes``, aligned by ``theta`` if it is given.

        Raises:
            FacePoserError: If there are too few features.
        """
        middle, size = _normalisation(strokes)
        lines = [(stroke.points - middle) / size for stroke in strokes]
        known = {i: stroke.feature for i, stroke in enumerate(strokes) if stroke.feature is not None}
        evidence = self._evidence(lines, known)
        starts = aligned(evidence, progress)
        fitted = [(*self._joint.fitted(evidence, start, found.features), found) for start, found in starts]
        fitted.sort(key=lambda item: -item[1])
        best: tuple[Array, Assignment] | None = None
        for i, (start, _, found) in enumerate(fitted[:_COMPARED]):
            progress.at("Comparing alignments", 0.7 + 0.1 * i / _COMPARED)
            refined, assignment = self._joint.best(evidence, start, found)
            if best is None or assignment.score > best[1].score:
                best = refined, assignment
            # Exchanges alone do not lead from one size to another.
            settled = _settled(refined, lines, assignment.features, self._features.neutral)
            for factor in _SIZES:
                again = settled * (factor, factor, 1.0, 1.0)
                nearest = assigned(evidence.by_stroke(again), evidence.names)
                refined, assignment = self._joint.best(evidence, again, nearest)
                if assignment.score > best[1].score:
                    best = refined, assignment
        if best is None or len(best[1].features) < _FEWEST:
            raise FacePoserError(
                f"No face was found in the {noun}: brows, eyes and a mouth, upright, must be lines of their own."
            )
        if theta is None:
            theta = _settled(best[0], lines, best[1].features, self._features.neutral)
        features = best[1].features
        lines, joined = self._with_pieces(lines, known, theta, features)
        evidence = self._evidence(lines, known)
        probabilities = {}
        for name, i in features.items():
            among = self._joint.alternatives(evidence, theta, features, i)
            other = next(((n, p) for n, p in among if n not in {None, name, NOSE_BASE} and p > _LEAST), None)
            probabilities[i] = dict(among).get(name, 1.0), None if other is None else (str(other[0]), other[1])
        return _Aligned(tuple(lines), theta, features, probabilities, joined)

    def _evidence(self, lines: Sequence[Array], known: Mapping[int, str]) -> StrokeEvidence:
        density = {
            name: gaussian
            for name, gaussian in self._density.items()
            if not name.endswith(_LEFT_OUT) or name in known.values()
        }
        known = {i: name for i, name in known.items() if name in density}
        return StrokeEvidence(lines, density, self._features.closed, self._nothing, known)

    def _with_pieces(
        self, lines: Sequence[Array], known: Mapping[int, str], theta: Array, features: Mapping[str, int]
    ) -> tuple[list[Array], dict[int, int]]:
        """Return the lines with pieces of one feature joined, if that is more probable than one piece alone.

        The second result is the index of the line that each joined piece continues.
        """
        lines, joined = list(lines), {}
        for i in range(len(lines)):
            if i in features.values() or is_closed(lines[i]):
                continue
            for feature, j in features.items():
                whole = None if is_closed(lines[j]) or feature == NOSE_BASE else _end_to_end(lines[j], lines[i])
                if whole is None:
                    continue
                # Lines that are not assigned do not count.
                pair = self._evidence([lines[j], whole], {0: feature, 1: feature} if feature in known.values() else {})
                before = self._joint.score(pair, theta, {feature: 0})
                after = self._joint.score(pair, theta, {feature: 1})
                if after > before:
                    lines[j], joined[i] = whole, j
                    break
        return lines, joined


def _settled(theta: Array, lines: Sequence[Array], features: Mapping[str, int], neutral: Mapping[str, Array]) -> Array:
    """Return ``theta`` with the size, angle and place of the neutral face.

    Densities favour large drawings. The size is the ratio of the spreads of the features' middles instead, and the
    corners of both eyes are level, since a raised brow or corner of the mouth is no rotation.
    """
    drawn = {name: similar(lines[i], theta) for name, i in features.items()}
    left, right = Frame.of("left eye", drawn), Frame.of("right eye", drawn)
    angle = 0.0
    if left is not None and right is not None and left.x > right.x:
        angle = float(np.arctan2(left.y - right.y, left.x - right.x))
    own = np.array([evenly(line, SAMPLES).mean(axis=0) for line in drawn.values()])
    head = np.array([neutral[name].mean(axis=0) for name in drawn])
    spread = [float(np.square(points - points.mean(axis=0)).sum()) for points in (own, head)]
    scale = float(np.sqrt(spread[1] / spread[0])) if len(own) >= _SETTLED and min(spread) > 0.0 else 1.0
    back = scale * np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    return np.concatenate([back @ theta[:2], back @ (theta[2:] - own.mean(axis=0)) + head.mean(axis=0)])


def _end_to_end(first: Array, second: Array) -> Array | None:
    """Return two lines as one if an end of one is near an end of the other, and it goes on in the same direction."""
    total = float(lengths_along(first)[-1] + lengths_along(second)[-1])
    for a in (first, first[::-1]):
        for b in (second, second[::-1]):
            if np.linalg.norm(b[0] - a[-1]) > _GAP * total:
                continue
            near_a, near_b = evenly(a, 16), evenly(b, 16)
            leaving, arriving = near_a[-1] - near_a[-4], near_b[3] - near_b[0]
            if float(leaving @ arriving) > 0.7 * float(np.linalg.norm(leaving) * np.linalg.norm(arriving)):
                return evenly(np.concatenate([a, b]), _POINTS)
    return None
