"""Recognition by the evidence of the whole stroke, from the present pose (docs/sketching.md)."""

from collections import OrderedDict
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from threading import Lock

import numpy as np
from numpy.typing import ArrayLike, NDArray

from faceposer.geometry.camera import Camera
from faceposer.model.face_model import FaceModel
from faceposer.model.feature_curves import FEATURES
from faceposer.sketch.curve_density import (
    FeatureRows,
    PoseDensity,
    ViewedCurves,
    hand_unit,
    principal_factor,
    visibility,
)
from faceposer.sketch.evidence import Evidence, evidence
from faceposer.sketch.hand import SAMPLES, SHORTEST, HandModel, ScribbleModel
from faceposer.sketch.intervals import candidate_intervals
from faceposer.sketch.openness import log_openness
from faceposer.sketch.placing import placed_points
from faceposer.sketch.polyline import evenly, lengths_along, stroke_line
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
        present: Share of poses near the present one.
        near: Spread of these, as a share of that of all poses.
        temperature: Factor by which log evidence is divided, since samples are less independent than assumed.
        others: The same for the strokes that have been drawn before.
        again: Prior of a feature that has been drawn before, relative to one that has not.
        unseen: Least prior of a feature that faces away.
        finalists: Number of features whose points are placed.
    """

    hand: HandModel = field(default_factory=HandModel)
    scribbles: ScribbleModel = field(default_factory=ScribbleModel)
    scribble: float = 0.2
    present: float = 0.5
    near: float = 0.4
    temperature: float = 2.0
    others: float = 4.0
    again: float = 0.35
    unseen: float = 0.003
    finalists: int = 3


# Distance of a line's middle from that of a stroke beyond which it is not considered, in units of the hand, and the
# share of the stroke's length that is added.
_REACH, _REACH_LENGTH = 110.0, 0.35
# Number of sequences of earlier strokes whose densities are kept.
_MOST_SEQUENCES = 32
# Log evidence behind that of the likeliest feature at which a feature is given up.
_HOPELESS = 40.0
# Candidates below this probability are omitted.
_LEAST = 1e-4


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
        self._rows = FeatureRows.of(model)
        mean, factor = principal_factor(np.asarray(coefficients, dtype=np.float64), self._rows)
        self._poses = PoseDensity(mean, factor)
        self._sequences: OrderedDict[tuple[DrawnStroke, ...], PoseDensity] = OrderedDict()
        self._lock = Lock()

    @classmethod
    def of(cls, model: FaceModel, training: TrainingPoses) -> "WholeStrokeRecogniser":
        """Fit the recogniser to ``training`` poses of ``model``."""
        return cls(model, training.coefficients)

    def recognise(
        self, stroke: DrawnStroke, pose: Array, others: Sequence[DrawnStroke] = (), feature: str | None = None
    ) -> Recognition:
        """Return the recognition of ``stroke``; see ``Recogniser``."""
        samples = self._samples(stroke)
        names = list(self._rows.tracks) if feature is None else [feature]
        names = [name for name in names if name in self._rows.tracks]
        if samples is None or not names:
            return Recognition((), False)
        camera = stroke.camera
        if feature is None:
            names = self._within_reach(names, samples, np.asarray(pose, dtype=np.float64), camera)
        drawn = {other.feature for other in others if other.feature is not None}
        found: list[Evidence] = []
        for density in self._densities(np.asarray(pose, dtype=np.float64), others):
            if names:
                intervals = [candidate_intervals(self._rows.tracks[name].closed) for name in names]
                curves = ViewedCurves(self._rows, density, camera, names)
                found.append(evidence(curves, samples, self.tuning.hand, intervals))
            if len(found) == 1 and len(names) > self.tuning.finalists:
                # Features far behind are not compared with the present pose.
                totals = np.array([found[0].log_total(i, self.tuning.temperature) for i in range(len(names))])
                kept = np.flatnonzero(totals > totals.max() - _HOPELESS)
                names = [names[i] for i in kept]
                found = [found[0].only(kept.tolist())]
        return self._decided(stroke, samples, found, names, drawn, feature)

    def _samples(self, stroke: DrawnStroke) -> Array | None:
        """Return the samples of ``stroke`` in units of the hand about the principal point, (SAMPLES, 2), or None."""
        line = stroke_line(stroke, hand_unit(self._rows, stroke.camera))
        if len(line) < 2 or lengths_along(line)[-1] < SHORTEST or np.hypot(*np.ptp(line, axis=0)) < SHORTEST:
            return None
        return evenly(line, SAMPLES)

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

    def _densities(self, pose: Array, others: Sequence[DrawnStroke]) -> list[PoseDensity]:
        tuning = self.tuning
        density = self._after(tuple(other for other in others if other.feature in self._rows.tracks))
        return [
            replace(density, weight=1.0 - tuning.present),
            PoseDensity(pose, tuning.near * density.factor, tuning.present),
        ]

    def _after(self, others: tuple[DrawnStroke, ...]) -> PoseDensity:
        """Return the density of poses given the strokes drawn before."""
        if not others:
            return self._poses
        with self._lock:
            known = self._sequences.get(others)
            if known is not None:
                self._sequences.move_to_end(others)
                return known
        before, stroke = self._after(others[:-1]), others[-1]
        samples = self._samples(stroke)
        after = before
        if samples is not None and stroke.feature is not None:
            after = self._updated(before, stroke.feature, samples, stroke.camera)
        with self._lock:
            self._sequences[others] = after
            while len(self._sequences) > _MOST_SEQUENCES:
                self._sequences.popitem(last=False)
        return after

    def _updated(self, density: PoseDensity, name: str, samples: Array, camera: Camera) -> PoseDensity:
        """Return ``density`` given that ``samples`` depict the feature ``name``."""
        curves = ViewedCurves(self._rows, density, camera, [name])
        found = evidence(curves, samples, self.tuning.hand, [candidate_intervals(curves.tracks[0].closed)])
        mean, covariance = found.posterior(0, *found.best(0))
        size = len(covariance)
        precision = np.linalg.inv(covariance)
        # The information of the stroke alone, tempered.
        share = 1.0 / self.tuning.others
        tempered = np.eye(size) + share * (precision - np.eye(size))
        inverse = np.linalg.inv(tempered)
        inverse = 0.5 * (inverse + inverse.T)
        return density.updated(share * inverse @ (precision @ mean), np.linalg.cholesky(inverse))

    def _decided(
        self,
        stroke: DrawnStroke,
        samples: Array,
        found: Sequence[Evidence],
        names: Sequence[str],
        drawn: set[str],
        feature: str | None,
    ) -> Recognition:
        """Return the posterior over features and strokes that depict none."""
        tuning = self.tuning
        seen = visibility(self._rows, stroke.camera)
        logs, sources = np.zeros(len(names)), []
        for index, name in enumerate(names):
            of_parts = np.array(
                [
                    np.log(max(part.curves.density.weight, 1e-9))
                    + part.log_total(index, tuning.temperature)
                    + log_openness(self._rows, part, index)
                    for part in found
                ]
            )
            sources.append(int(np.argmax(of_parts)))
            logs[index] = np.logaddexp.reduce(of_parts / tuning.temperature)
            logs[index] += np.log(max(seen[name], tuning.unseen))
            if name in drawn or drawn & set(FEATURES[name].components):
                logs[index] += np.log(tuning.again)
        count = max(len(self._rows.tracks), 1)
        logs += np.log((1.0 - tuning.scribble) / count)
        # The middle of the face in the coordinates of the samples.
        unit = hand_unit(self._rows, stroke.camera)
        middle = (stroke.camera.project(self._rows.middle[None])[0] - stroke.camera.principal_point) / unit
        scribble = tuning.scribbles.log_density(samples - middle) / tuning.temperature + np.log(tuning.scribble)
        if feature is not None:
            scribble = -np.inf
        top = max(scribble, logs.max(initial=-np.inf))
        shares = np.exp(logs - top)
        nothing = float(np.exp(scribble - top))
        probabilities = shares / (shares.sum() + nothing)
        order = [i for i in np.argsort(-probabilities) if probabilities[i] >= _LEAST]
        candidates = tuple(
            Candidate(
                names[i],
                float(min(probabilities[i], 1.0)),
                placed_points(found[sources[i]], int(i), stroke, samples, tuning.hand),
            )
            for i in order[: tuning.finalists]
        )
        best = float(probabilities.max(initial=0.0))
        accepted = bool(candidates) and best > nothing / (shares.sum() + nothing)
        return Recognition(candidates, accepted)
