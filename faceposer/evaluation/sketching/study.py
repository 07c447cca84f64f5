"""The study of sketching: features, points and faces from strokes on unseen poses."""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from faceposer.evaluation.setting import StudyContext
from faceposer.evaluation.sketching.artist import Artist, TrueStroke
from faceposer.evaluation.sketching.hand_errors import HandErrors
from faceposer.evaluation.sketching.points import point_errors, true_points
from faceposer.evaluation.sketching.scribbles import KINDS, scribble
from faceposer.evaluation.trials import region_vertices
from faceposer.geometry.camera import Camera
from faceposer.geometry.strokes import smoothed
from faceposer.model.feature_curves import FEATURES, feature_curves
from faceposer.model.framing import face_view
from faceposer.session.sketching import library_poses, sketch_of
from faceposer.sketch.recognition import Candidate, DrawnStroke
from faceposer.sketch.sketcher import Sketcher
from faceposer.solve.constraints.registry import Constraint
from faceposer.solve.constraints.sketch import SketchConstraint
from faceposer.solve.constraints.stroke import StrokeConstraint, as_pixels
from faceposer.solve.map_solver import solve
from faceposer.solve.problem import RECORDED_SPREAD, SPREAD, PoseProblem

Array = NDArray[np.float64]

VIEWS = ("front", "three-quarter")
COUNTS = (1, 2, 4, 8)
#: Features of the largest trials: both brows, the lids and the lips.
WHOLE_FACE = (
    "left brow",
    "right brow",
    "left upper lid",
    "right upper lid",
    "left lower lid",
    "right lower lid",
    "outer upper lip",
    "outer lower lip",
    "inner upper lip",
    "inner lower lip",
    "mouth line",
)
# Size of the image, and standard deviation of the places of scribbles, in pixels.
_SIZE, _SCRIBBLED = (960, 960), 150.0
# Brush of the stroke tool, in pixels.
_BRUSH = 6.0
# Least mean motion of a frame's face from neutral, as a share of the largest, to count as an expression.
_LEAST_MOTION = 0.15


@dataclass(frozen=True, eq=False)
class Trial:
    """Strokes of one pose.

    Attributes:
        number: Number of the pose.
        view: Name of the view.
        count: Number of strokes asked for.
        strokes: The strokes in the order of drawing.
        truth: Vertices of the true face, shape (N, 3).
    """

    number: int
    view: str
    count: int
    strokes: tuple[TrueStroke, ...]
    truth: NDArray[np.float32]


@dataclass
class Tally:
    """What was measured in one condition, over trials.

    Attributes:
        features: For each stroke, the true feature, the recognised one or None, the probability, and its number in
            the trial.
        points: Errors of points, in distances of neighbours.
        errors: Error and neutral error of the face by method, each a list over trials.
        ms: Milliseconds of processor time of recognition, by stroke, and of the pose, by method.
    """

    features: list[tuple[str, str | None, float, int]] = field(default_factory=list)
    points: list[float] = field(default_factory=list)
    errors: dict[str, list[tuple[float, float]]] = field(default_factory=dict)
    ms: dict[str, list[float]] = field(default_factory=dict)


class SketchingStudy:
    """Trials on one character with one set of training poses."""

    def __init__(self, setting: StudyContext, training: int) -> None:
        """Initialise for the face of ``setting`` and a number of ``training`` poses."""
        self.setting, self.training = setting, training
        self.model = setting.model
        self.sketcher = Sketcher(self.model, library_poses(self.model), training)

    @cached_property
    def _measured(self) -> NDArray[np.intp]:
        regions = region_vertices(self.setting.character)
        return np.unique(np.concatenate(list(regions.values())))

    def run(self, trial: Trial, recognition: str, tally: Tally) -> None:
        """Recognise the strokes of ``trial`` one after the other and pose the face; add the results to ``tally``."""
        recogniser = self.sketcher.recogniser(recognition)
        pose = self.model.neutral()
        others: list[DrawnStroke] = []
        sketches: list[SketchConstraint] = []
        corrected: list[SketchConstraint] = []
        for number, true in enumerate(trial.strokes):
            began = time.process_time()
            found = recogniser.recognise(DrawnStroke(true.stroke.pixels, true.stroke.camera), pose, others)
            tally.ms.setdefault("recognition", []).append(1e3 * (time.process_time() - began))
            best = found.best
            probability = found.candidates[0].probability if found.candidates else 0.0
            tally.features.append((true.feature, best.feature if best else None, probability, number))
            tally.points += point_errors(true, best)
            if best is not None and best.feature == true.feature:
                corrected += self._sketch(true, best)
            elif named := recogniser.recognise(true.stroke, pose, others, true.feature).best:
                corrected += self._sketch(true, named)
            if best is None or not best.points:
                continue
            others.append(DrawnStroke(true.stroke.pixels, true.stroke.camera, best.feature))
            sketches += self._sketch(true, best)
            pose, _ = self._solved(sketches)
        for method, spread in (("map", RECORDED_SPREAD), ("map-local", SPREAD)):
            pose, ms = self._solved(sketches, spread)
            self._add(tally, method, pose, trial, ms)
        pose, ms = self._solved(corrected)
        self._add(tally, "map-corrected", pose, trial, ms)
        began = time.process_time()
        pose = self.sketcher.paper_pose(sketches, self.model.neutral())
        self._add(tally, "paper", pose, trial, 1e3 * (time.process_time() - began))

    def run_given(self, trial: Trial, tally: Tally) -> None:
        """Pose the face from the true correspondences, and with the stroke tool from the true sources."""
        sketches: list[SketchConstraint] = []
        for true in trial.strokes:
            sketches += self._sketch(true, Candidate(true.feature, 1.0, true_points(true)))
        pose, ms = self._solved(sketches)
        self._add(tally, "true-points", pose, trial, ms)
        pose, ms = self._solved([self._stroke(true) for true in trial.strokes])
        self._add(tally, "stroke-tool", pose, trial, ms)

    def _sketch(self, true: TrueStroke, candidate: Candidate) -> list[SketchConstraint]:
        """Return the constraint of a stroke, or none if the stroke does not meet the feature."""
        if not candidate.points:
            return []
        try:
            return [sketch_of(true.stroke, candidate).resolved(self.model, self.model.neutral())]
        except ValueError:
            return []

    def _stroke(self, true: TrueStroke) -> StrokeConstraint:
        """Return the constraint of the stroke tool with the true part of the feature's curve as source."""
        curve = feature_curves(self.setting.character)[true.feature][0]
        low, high = true.span
        inside = (curve.parameters >= low - 1e-6) & (curve.parameters <= high + 1e-6)
        target = smoothed(true.stroke.pixels)
        return StrokeConstraint(curve.points.subset(inside), as_pixels(target), _BRUSH, true.stroke.camera)

    def _solved(self, constraints: Sequence[Constraint], spread: float = RECORDED_SPREAD) -> tuple[Array, float]:
        """Return the pose of ``constraints`` and the milliseconds of processor time that it took.

        Drawings of a real face show how all of it moved, like other measurements.
        """
        began = time.process_time()
        if not constraints:
            return self.model.neutral(), 0.0
        pose = solve(PoseProblem(self.model, list(constraints), spread=spread)).coefficients
        return pose, 1e3 * (time.process_time() - began)

    def _add(self, tally: Tally, method: str, pose: Array, trial: Trial, ms: float) -> None:
        error = np.linalg.norm(self.model.instance(pose) - trial.truth, axis=1)[self._measured].mean()
        neutral = np.linalg.norm(self.setting.character.vertices - trial.truth, axis=1)[self._measured].mean()
        tally.errors.setdefault(method, []).append((float(error), float(neutral)))
        tally.ms.setdefault(method, []).append(ms)

    def accepted(self, camera: Camera, per_kind: int, rng: np.random.Generator, recognition: str) -> dict[str, float]:
        """Return the share of scribbles of each kind that are accepted as features."""
        recogniser, character = self.sketcher.recogniser(recognition), self.setting.character
        middle = camera.project(character.vertices[list(character.feature_points.values())].mean(axis=0)[None])[0]
        shares = {}
        for kind in KINDS:
            accepted = [
                recogniser.recognise(
                    DrawnStroke(scribble(kind, middle, _SCRIBBLED, rng), camera), self.model.neutral()
                ).accepted
                for _ in range(per_kind)
            ]
            shares[kind] = float(np.mean(accepted))
        return shares


def expressions(setting: StudyContext, frames: Array, count: int, seed: int) -> Array:
    """Return up to ``count`` random frames that show an expression, rig weights of shape (n, S)."""
    measured = np.unique(np.concatenate(list(region_vertices(setting.character).values())))[::7]
    shapes = setting.character.shapes[:, measured].reshape(len(setting.character.shapes), -1)
    sparse = frames[:: max(len(frames) // 1500, 1)]
    motion = np.linalg.norm((sparse @ shapes).reshape(len(sparse), -1, 3), axis=2).mean(axis=1)
    moving = sparse[motion > _LEAST_MOTION * motion.max()]
    return moving[np.random.default_rng(seed).permutation(len(moving))[:count]]


def trials_of(
    setting: StudyContext,
    frames: Array,
    errors: HandErrors,
    seed: int,
    counts: Sequence[int] = COUNTS,
    any_order: bool = False,
) -> list[Trial]:
    """Return the trials of each of ``frames``, (n, S), in each of ``VIEWS`` with each number of strokes.

    The features of a trial are drawn at random, without parts of one another; with eight strokes, they are the brows,
    lids and lips. Strokes follow each other from top to bottom and from outside to inside, or in ``any_order``.
    """
    rng = np.random.default_rng(seed)
    trials = []
    for number, weights in enumerate(frames):
        truth = setting.vertices_of(weights)
        for view in VIEWS:
            artist = Artist(setting.character, truth, view_camera(setting, view))
            for count in counts:
                chosen = _chosen(artist, count, rng)
                names = chosen if any_order else sorted(chosen, key=list(FEATURES).index)
                strokes = tuple(artist.draw(name, errors, rng) for name in names)
                trials.append(Trial(number, view, count, strokes, truth))
    return trials


def view_camera(setting: StudyContext, view: str) -> Camera:
    """Return the camera of the study for a view."""
    return face_view(setting.character, view).camera(_SIZE)


def _chosen(artist: Artist, count: int, rng: np.random.Generator) -> list[str]:
    """Return the names of the features that are drawn, in random order."""
    possible = [name for name in artist.lines if count < COUNTS[-1] or name in WHOLE_FACE]
    chosen: list[str] = []
    for index in rng.permutation(len(possible)):
        name = possible[index]
        if any(_overlap(name, other) for other in chosen):
            continue
        chosen.append(name)
        if len(chosen) == count:
            break
    return chosen


def _overlap(a: str, b: str) -> bool:
    return a in FEATURES[b].components or b in FEATURES[a].components


def row_of(
    tally: Tally, method: str, key: dict[str, Any], given: Tally, progress: Callable[[str], None] | None = None
) -> dict[str, Any]:
    """Return the row of one method in one condition.

    Args:
        tally: The results of the condition.
        method: "paper", "map", "map-corrected" (wrong features are corrected, as by a click),
            "map-local" (the spread of new sessions), "true-points" or "stroke-tool".
        key: Character, view, strokes, recognition and training.
        given: The results with true correspondences.
        progress: Called with a line about the row.
    """
    source = given if method in ("true-points", "stroke-tool") else tally
    errors = np.array(source.errors[method])
    right = [true == found for true, found, _, _ in tally.features]
    rng = np.random.default_rng(0)
    picks = rng.integers(len(errors), size=(2000, len(errors)))
    resampled = errors[picks].sum(axis=1)
    interval = np.percentile(resampled[:, 0] / resampled[:, 1], [2.5, 97.5])
    row = {
        **key,
        "method": method,
        "feature_accuracy": round(float(np.mean(right)), 4),
        "point_accuracy": round(float(np.mean(np.array(tally.points) <= 1.0)), 4),
        "error_3d_relative": round(float(errors[:, 0].sum() / errors[:, 1].sum()), 4),
        "ci95": [round(float(value), 4) for value in interval],
        "ms": round(float(np.median(source.ms[method])), 2),
        "ms_recognition": round(float(np.median(tally.ms["recognition"])), 2),
        "trials": len(errors),
    }
    if progress is not None:
        progress(str(row))
    return row
