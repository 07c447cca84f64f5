"""Recognition by the evidence of the whole stroke, from the present pose (docs/sketching.md)."""

from collections import OrderedDict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from threading import Lock

import numpy as np
from numpy.typing import ArrayLike, NDArray

from faceposer.geometry.camera import Camera
from faceposer.model.face_model import FaceModel
from faceposer.model.feature_curves import FEATURES
from faceposer.sketch.curve_density import (
    FACE_SIZE,
    FeatureRows,
    PoseMixture,
    ViewedCurves,
    hand_unit,
    visibility,
)
from faceposer.sketch.drawing_order import is_redrawn, log_prior
from faceposer.sketch.evidence import Evidence, evidence, nearer_evidence
from faceposer.sketch.free_hand import is_free, log_free
from faceposer.sketch.habits import Habits, as_drawn, family_of, habits_of
from faceposer.sketch.hand import SAMPLES, HandModel, ScribbleModel
from faceposer.sketch.intervals import candidate_intervals
from faceposer.sketch.openness import log_openness
from faceposer.sketch.placing import placed_points
from faceposer.sketch.plausibility import objection
from faceposer.sketch.polyline import evenly, lengths_along, stroke_line, untidiness
from faceposer.sketch.recognition import Candidate, DrawnStroke, Recognition
from faceposer.sketch.training_poses import TrainingPoses

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Tuning:
    """Constants of the recognition, chosen by cross-validation on one performance.

    Attributes:
        hand: Errors of the hand.
        scribbles: Density of strokes that depict nothing.
        scribble: Prior probability of such a stroke.
        spread: Spread of poses about each training pose, as a share of that of all poses.
        present: Share of poses near the present one.
        others: Factor by which the log evidence of strokes that have been drawn before is divided, since an error of
            the hand or of the poses would else be carried on.
        unseen: Least prior of a feature that faces away.
        finalists: Number of features that are compared exactly.
    """

    hand: HandModel = field(default_factory=HandModel)
    scribbles: ScribbleModel = field(default_factory=ScribbleModel)
    scribble: float = 0.2
    spread: float = 0.3
    present: float = 0.4
    others: float = 3.0
    unseen: float = 0.003
    finalists: int = 4


# Distance of a line's middle from that of a stroke beyond which it is not considered, in units of the hand, and the
# share of the stroke's length that is added.
_REACH, _REACH_LENGTH = 110.0, 0.35
# Number of sequences of earlier strokes whose densities are kept.
_MOST_SEQUENCES = 32
# Log evidence behind that of the likeliest feature at which a feature is given up, before and after its curve is
# linearised at the most probable pose.
_HOPELESS, _NO_FINALIST = 40.0, 60.0
# Share of a feature's length in the image below which a stroke is hardly a drawing of it, and its softness; the same of
# the excess of a stroke's length over that of its samples, and of what smoothing removes, in units of the hand.
_PIECE, _WINDING, _TREMBLING = (0.36, 0.05), (0.08, 0.06), (2.0, 0.5)
# Number of matched points by which a feature is recognised, and the share of its length that replaces the second one.
_LEAST_MATCHED, _LEAST_COVERED = 2, 0.38
# The same shares for a further piece of a feature of which one has been drawn.
_CONTINUED = 0.2
# Mean distance of a stroke from the most probable curve beyond which it is no drawing of it, in units of the hand; that
# of closed strokes is greater, since nothing else looks like them, and so is that of features that are drawn freely.
_FARTHEST, _FARTHEST_CLOSED, _FARTHEST_FREE = 0.03 * FACE_SIZE, 0.05 * FACE_SIZE, 0.07 * FACE_SIZE
# Candidates below this probability are omitted unless they lie close to the likeliest, and those after the first five.
_LEAST, _MOST_CANDIDATES = 0.01, 5


class WholeStrokeRecogniser:
    """Recognises features by the density of their curves in the view of the stroke.

    Safe for use by several threads.
    """

    def __init__(self, model: FaceModel, coefficients: ArrayLike, tuning: Tuning | None = None) -> None:
        """Fit the densities.

        Args:
            model: The face.
            coefficients: Training poses, shape (n, r), n ≥ 2.
            tuning: Constants.
        """
        self.tuning = tuning or Tuning()
        self._character = model.character
        self._rows = FeatureRows.of(model)
        self._poses = PoseMixture.of(np.asarray(coefficients, dtype=np.float64), self._rows, self.tuning.spread)
        self._sequences: OrderedDict[tuple[object, ...], PoseMixture] = OrderedDict()
        self._lock = Lock()

    @classmethod
    def of(cls, model: FaceModel, training: TrainingPoses) -> "WholeStrokeRecogniser":
        """Fit the recogniser to ``training`` poses of ``model``."""
        return cls(model, training.coefficients)

    def recognise(
        self, stroke: DrawnStroke, pose: Array, others: Sequence[DrawnStroke] = (), feature: str | None = None
    ) -> Recognition:
        """Return the recognition of ``stroke``; see ``Recogniser``."""
        if reason := objection(stroke, self._character, feature is not None):
            return Recognition((), False, reason)
        names = list(self._rows.tracks) if feature is None else [feature]
        names = [name for name in names if name in self._rows.tracks]
        samples = self._samples(stroke)
        if not names or samples is None:
            return Recognition((), False)
        camera = stroke.camera
        if feature is None:
            names = self._within_reach(names, samples, pose, camera)
        drawn = {other.feature for other in others if other.feature is not None}
        found = self._found(names, drawn, samples, pose, others, camera)
        habits = habits_of(self._rows, pose, camera, hand_unit(self._rows, camera), samples, drawn)
        free = dict(zip(names, self._free(names, samples, pose, camera), strict=True))
        return self._decided(stroke, samples, found, free, drawn, habits, feature)

    def _found(
        self,
        names: Sequence[str],
        drawn: set[str],
        samples: Array,
        pose: Array,
        others: Sequence[DrawnStroke],
        camera: Camera,
    ) -> list[tuple[Evidence, int]]:
        """Return the evidence for each of ``names``, as the index of a line of an ``Evidence``."""
        # A feature that is drawn again may take any shape, whatever it was before.
        again = [name for name in names if is_redrawn(name, drawn)]
        new = [name for name in names if name not in again]
        before = self._after(tuple(other for other in others if other.feature in self._rows.tracks))
        found = []
        for group, density in ((new, before), (again, self._poses)):
            if not group:
                continue
            mixture = density.with_pose(pose, self._rows, self.tuning.present)
            curves = ViewedCurves(self._rows, mixture, camera, group)
            intervals = [candidate_intervals(self._rows.tracks[name].closed, coarse=True) for name in group]
            of_group = evidence(curves, samples, self.tuning.hand, intervals)
            found += [(of_group, index) for index in range(len(group))]
        totals = [part.log_total(index) for part, index in found]
        for i in np.argsort(totals)[: -1 - self.tuning.finalists : -1]:
            if totals[i] > max(totals) - _NO_FINALIST:
                part, index = found[i]
                found[i] = nearer_evidence(part, index, samples, self.tuning.hand), 0
        return found

    def _samples(self, stroke: DrawnStroke) -> Array | None:
        """Return the samples of ``stroke`` in units of the hand about the principal point, (SAMPLES, 2), or None."""
        if objection(stroke, self._character, named=True):
            return None
        line = stroke_line(stroke, hand_unit(self._rows, stroke.camera))
        return evenly(line, SAMPLES) if len(line) > 1 else None

    def _free(self, names: Sequence[str], samples: Array, pose: Array, camera: Camera) -> Array:
        """Return the log density of ``samples`` as each of ``names`` drawn freely, -inf for those that are not."""
        unit = hand_unit(self._rows, camera)
        poses = np.stack([pose, np.zeros_like(pose)])
        return np.array([log_free(self._rows, name, poses, camera, unit, samples, self.tuning.hand) for name in names])

    def _within_reach(self, names: list[str], samples: Array, pose: Array, camera: Camera) -> list[str]:
        """Return those of ``names`` whose lines, in the present pose, are near the stroke."""
        unit = hand_unit(self._rows, camera)
        places = self._rows.neutral + self._rows.jacobian @ pose
        pixels = (camera.project(places) - camera.principal_point) / unit
        begins = [track.rows.start for track in self._rows.tracks.values()]
        reach = _REACH + _REACH_LENGTH * float(lengths_along(samples)[-1])
        low, high = np.minimum.reduceat(pixels, begins) - reach, np.maximum.reduceat(pixels, begins) + reach
        middle = samples.mean(axis=0)
        near = ((middle >= low) & (middle <= high)).all(axis=1)
        return [name for name, is_near in zip(self._rows.tracks, near, strict=True) if is_near and name in names]

    def _after(self, others: tuple[DrawnStroke, ...]) -> PoseMixture:
        """Return the density of poses given the strokes drawn before."""
        if not others:
            return self._poses
        key = tuple((other.feature, other.camera, np.asarray(other.pixels).tobytes()) for other in others)
        with self._lock:
            known = self._sequences.get(key)
            if known is not None:
                self._sequences.move_to_end(key)
                return known
        before, stroke = self._after(others[:-1]), others[-1]
        samples = self._samples(stroke)
        after = before
        if samples is not None and stroke.feature is not None:
            after = self._updated(before, stroke.feature, samples, stroke.camera)
        with self._lock:
            self._sequences[key] = after
            while len(self._sequences) > _MOST_SEQUENCES:
                self._sequences.popitem(last=False)
        return after

    def _updated(self, density: PoseMixture, name: str, samples: Array, camera: Camera) -> PoseMixture:
        """Return ``density`` given that ``samples`` depict the feature ``name``."""
        curves = ViewedCurves(self._rows, density, camera, [name])
        found = evidence(curves, samples, self.tuning.hand, [candidate_intervals(curves.tracks[0].closed)])
        posterior = found.posterior(0, *found.best(0))
        # The information of the stroke alone, tempered.
        share = 1.0 / self.tuning.others
        identity = np.eye(len(posterior.covariance))
        precision = np.linalg.inv(posterior.covariance)
        tempered = np.asarray(np.linalg.inv(identity + share * (precision - identity)))
        information = posterior.means @ precision - density.means
        means = (density.means + share * information) @ tempered
        return density.updated(share * posterior.log_likelihood, means, tempered)

    def _decided(
        self,
        stroke: DrawnStroke,
        samples: Array,
        found: Sequence[tuple[Evidence, int]],
        free: Mapping[str, float],
        drawn: set[str],
        habits: Habits,
        feature: str | None,
    ) -> Recognition:
        """Return the posterior over features and strokes that depict none."""
        tuning = self.tuning
        seen = visibility(self._rows, stroke.camera)
        names = [part.tracks[index].feature for part, index in found]
        totals = np.array([part.log_total(index) for part, index in found])
        totals = as_drawn(names, np.logaddexp(totals, [free[name] for name in names]), habits)
        logs = totals.copy()
        length, covered = float(lengths_along(samples)[-1]), np.ones(len(found))
        winding, trembling = untidiness(stroke, hand_unit(self._rows, stroke.camera), samples)
        untidy = _beyond(winding, *_WINDING) + _beyond(trembling, *_TREMBLING)
        for i, (part, index) in enumerate(found):
            logs[i] += habits.log_priors.get(names[i], 0.0)
            if totals[i] < totals.max() - _HOPELESS:
                continue
            # A line drawn where the mouth is closed is of a closed mouth, whatever pose is nearest to its ends.
            apart = 1.0 - habits.on_line if names[i] == "mouth line" else 1.0
            logs[i] += apart * log_openness(self._rows, part, index)
            logs[i] += np.log(max(seen[names[i]], tuning.unseen))
            logs[i] += log_prior(names[i], drawn)
            if feature is None:
                line = part.curves.pixels[names[i]]
                covered[i] = length / max(float(lengths_along(line)[-1]), 1e-9)
                logs[i] -= _beyond(-covered[i], -(_CONTINUED if names[i] in drawn else _PIECE[0]), _PIECE[1]) + untidy
        count = max(len(self._rows.tracks), 1)
        logs += np.log((1.0 - tuning.scribble) / count)
        # The middle of the face in the coordinates of the samples.
        unit = hand_unit(self._rows, stroke.camera)
        middle = (stroke.camera.project(self._rows.middle[None])[0] - stroke.camera.principal_point) / unit
        scribble = tuning.scribbles.log_density(samples - middle) + np.log(tuning.scribble)
        if feature is not None:
            scribble = -np.inf
        top = max(scribble, logs.max(initial=-np.inf))
        shares = np.exp(logs - top)
        nothing = float(np.exp(scribble - top))
        probabilities = shares / (shares.sum() + nothing)
        ranked = np.argsort(-logs)
        near = {near for i in ranked[:1] for near in family_of(names[i])}
        shown = [i for i in ranked if probabilities[i] >= _LEAST or names[i] in near][:_MOST_CANDIDATES]
        placed = [placed_points(found[i][0], found[i][1], stroke, samples, tuning.hand) for i in shown]
        candidates = tuple(
            Candidate(names[i], float(min(probabilities[i], 1.0)), points)
            for i, (points, _) in zip(shown, placed, strict=True)
        )
        best = float(probabilities.max(initial=0.0))
        accepted = bool(candidates) and best > nothing / (shares.sum() + nothing)
        if accepted and len(candidates[0].points) < _LEAST_MATCHED:
            least = _CONTINUED if names[shown[0]] in drawn else _LEAST_COVERED
            accepted = bool(covered[shown[0]] >= least and candidates[0].points)
        if accepted and feature is None:
            accepted = placed[0][1] < _farthest(names[shown[0]])
        return Recognition(candidates, accepted)


def _farthest(name: str) -> float:
    """Return the mean distance from the most probable curve at which a stroke is no drawing of the feature ``name``."""
    if is_free(name):
        return _FARTHEST_FREE
    return _FARTHEST_CLOSED if FEATURES[name].closed else _FARTHEST


def _beyond(value: float, limit: float, softness: float) -> float:
    """Return the loss of log evidence of a ``value`` above its ``limit``."""
    return 0.5 * (max(value - limit, 0.0) / softness) ** 2
