"""Joint density of all strokes of a drawing, given their features: poses, proportions and the errors of a hand."""

from collections.abc import Mapping, Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from faceposer.model.feature_curves import FEATURES
from faceposer.sketch.drawing_alignment import (
    DIMENSIONS,
    USUAL,
    Assignment,
    StrokeEvidence,
    log_size,
    solved,
    stroke_moves,
)
from faceposer.sketch.feature_templates import NOSE_BASE, Gaussian, ViewedFeatures, no_feature, slack_of
from faceposer.sketch.hand import SAMPLES, HandModel

Array = NDArray[np.float64]

# Samples of a stroke that are used.
_USED = np.linspace(0, SAMPLES - 1, 8).round().astype(np.intp)
# Features that lie below each other in every face, and the log odds against a drawing in which two do not.
_ORDERS = (
    *(tuple(f"{side} {part}" for part in ("brow", "upper lid", "lower lid")) for side in ("left", "right")),
    ("outer upper lip", "inner upper lip", "mouth line", "inner lower lip", "outer lower lip"),
    ("left lower lid", NOSE_BASE, "mouth line"),
    ("left eye outline", NOSE_BASE, "mouth outline"),
)
_DISORDER = 8.0
# Log odds against a feature that is drawn on one side alone.
_ONE_SIDED = 4.0
# Log odds against a face without a mouth, or with one lip alone.
_NO_MOUTH = 6.0
# Standard deviation of the rotation of a drawing, in radians, and of the logarithm of its scale.
_TILT, _SCALE = 0.12, 0.5
# Errors of the hand beside those of proportions, in units of the hand.
_HAND = HandModel(shift=10.0, jitter=9.0, smoothness=0.3, tremor=4.0, ends=0.1, slide=0.08, size=0.12, turn=0.1)
# Expressions of drawings are stronger than those of faces.
_STRONGER = 1.3
# Standard deviations of proportions: of the places of a group, apart and up, in units of the hand, and of its sizes.
_APART, _UP, _SIZE = 24.0, 32.0, 0.25
_GROUPS = ("brow", "lid eye", "nose", "lip mouth", "cheek", "jaw")
# Log ratio of a feature by itself below which it is not considered.
_HOPELESS = -60.0
# Log-evidence temperature, numbers of exchanges, of features tried for each stroke, and of exchanges tried with a new
# similarity.
_TEMPERATURE, _MOST_STEPS, _TRIED, _REFITTED = 2.0, 12, 5, 40
_ODDS = 2.0
# Prior log odds against features; most mouths are drawn as one line.
_RARE = {
    "mouth line": 1.0,
    "mouth outline": -2.0,
    "outer upper lip": 4.0,
    "outer lower lip": 1.5,
    "inner upper lip": 5.0,
    "inner lower lip": 5.0,
}


def group_of(feature: str) -> int:
    """Return the index of the group of features whose proportions go together."""
    words = set(feature.split())
    return next(i for i, group in enumerate(_GROUPS) if words & set(group.split()))


class JointDensity:
    """The density of all features together."""

    def __init__(self, features: ViewedFeatures) -> None:
        """Gather the mean and the covariance of the samples of all features."""
        self.names = features.names
        self._index = {name: i for i, name in enumerate(self.names)}
        samples = np.stack([features.poses[name][:, _USED] for name in self.names], axis=1)
        count = len(samples)
        mean = samples.mean(axis=0)
        flat = samples.reshape(count, -1)
        covariance = _STRONGER**2 * np.cov(flat.T)
        slack = _proportions(self.names, mean)
        covariance += slack @ slack.T
        own = np.kron(_HAND.covariance[np.ix_(_USED, _USED)], np.eye(2))
        size = 2 * len(_USED)
        for i, name in enumerate(self.names):
            whole = features.poses[name].mean(axis=0)
            errors = slack_of(name, whole, _HAND)[_USED].reshape(size, -1)
            block = slice(i * size, (i + 1) * size)
            covariance[block, block] += own + errors @ errors.T
        self._mean, self._covariance, self._size = mean.reshape(-1), covariance, size
        nothing = np.linalg.inv(no_feature().precision)
        both = (2 * _USED[:, None] + np.arange(2)).reshape(-1)
        self._nothing = Gaussian.of(np.zeros(size), nothing[np.ix_(both, both)])

    def best(self, evidence: StrokeEvidence, theta: Array, start: Assignment) -> tuple[Array, Assignment]:
        """Return the assignment of greatest joint density near ``start``, by exchanges, and its similarity."""
        theta, score = self.fitted(evidence, theta, start.features)
        current = dict(start.features)
        for _ in range(_MOST_STEPS):
            improved = False
            changes = self._exchanges(evidence, theta, current)
            for changed in changes:
                if self.score(evidence, theta, changed) > score + 1e-6:
                    theta, score = self.fitted(evidence, theta, changed)
                    current, improved = changed, True
                    break
            else:
                # Some features fit once the similarity follows them.
                for changed in changes[:_REFITTED]:
                    turned, value = self.fitted(evidence, theta, changed)
                    if value > score + 1e-6:
                        theta, score, current, improved = turned, value, changed, True
                        break
            if not improved:
                break
        return theta, Assignment(current, score)

    def _exchanges(
        self, evidence: StrokeEvidence, theta: Array, current: Mapping[str, int]
    ) -> Sequence[dict[str, int]]:
        """Return assignments in which one stroke has another feature, or two strokes have exchanged theirs."""
        ratios = evidence.by_stroke(theta)
        of_stroke = {stroke: name for name, stroke in current.items()}
        found: list[tuple[float, dict[str, int]]] = []
        for stroke in range(evidence.count):
            before = of_stroke.get(stroke)
            without = {name: other for name, other in current.items() if other != stroke}
            if before is not None:
                found.append((-1.0, without))
            for i in np.argsort(-ratios[stroke])[:_TRIED]:
                name = evidence.names[int(i)]
                if name == before or not ratios[stroke, i] > _HOPELESS:
                    continue
                excluded = _excluded(name)
                changed = {other: s for other, s in without.items() if other != name and other not in excluded}
                changed[name] = stroke
                found.append(
                    (
                        float(ratios[stroke, i]) + (10.0 if before is None and len(changed) > len(current) else 0.0),
                        changed,
                    )
                )
                if (
                    name in current
                    and before is not None
                    and np.isfinite(ratios[current[name], evidence.names.index(before)])
                ):
                    found.append((float(ratios[stroke, i]) + 1.0, changed | {before: current[name]}))
        return [changed for _, changed in sorted(found, key=lambda pair: -pair[0])]

    def alternatives(
        self, evidence: StrokeEvidence, theta: Array, features: Mapping[str, int], stroke: int
    ) -> list[tuple[str | None, float]]:
        """Return the features that ``stroke`` may depict, given those of all others, with their probabilities.

        None stands for no feature. The most probable is the first.
        """
        others = {name: i for name, i in features.items() if i != stroke}
        ratios = evidence.by_stroke(theta)[stroke]
        names: list[str | None] = [None]
        for i in np.flatnonzero(ratios > _HOPELESS):
            name = evidence.names[int(i)]
            if name not in others and not _excluded(name) & set(others):
                names.append(name)
        scores = np.array([self.score(evidence, theta, others if n is None else others | {n: stroke}) for n in names])
        shares = np.exp(scores - scores.max())
        shares /= shares.sum()
        order = np.argsort(-shares, kind="stable")
        return [(names[int(i)], float(shares[i])) for i in order]

    def fitted(self, evidence: StrokeEvidence, theta: Array, features: Mapping[str, int]) -> tuple[Array, float]:
        """Return the similarity that suits the assignment ``features``, and the score there."""
        if features:
            names = list(features)
            moves, mean, covariance = self._parts(evidence, theta, features, names)
            pulled = np.linalg.solve(covariance, moves)
            turned = solved((moves.T @ pulled)[None], (pulled.T @ mean)[None], DIMENSIONS * len(names))[0]
            if abs(np.arctan2(turned[1], turned[0])) < 0.8:
                theta = turned
        return theta, self.score(evidence, theta, features)

    def score(self, evidence: StrokeEvidence, theta: Array, features: Mapping[str, int]) -> float:
        """Return the log ratio of the assignment ``features`` to that of no feature at all."""
        tilt = -0.5 * (float(np.arctan2(theta[1], theta[0])) / _TILT) ** 2
        tilt -= 0.5 * (float(log_size(theta[None])[0]) / _SCALE) ** 2
        if not features:
            return tilt
        names = list(features)
        moves, mean, covariance = self._parts(evidence, theta, features, names)
        places = moves @ theta
        heights = dict(zip(names, places.reshape(len(names), -1, 2)[..., 1].mean(axis=1).tolist(), strict=True))
        root = np.linalg.cholesky(covariance)
        white = np.linalg.solve(root, places - mean)
        together = -0.5 * float(white @ white) - float(np.log(np.diagonal(root)).sum())
        together -= 0.5 * len(mean) * float(np.log(2.0 * np.pi))
        together += DIMENSIONS * len(names) * float(log_size(theta[None])[0])
        each = (moves @ USUAL).reshape(len(names), -1)
        apart = self._nothing.log_peak - 0.5 * np.einsum("ki,ij,kj->k", each, self._nothing.precision, each)
        plain = [name.removeprefix("left ").removeprefix("right ") for name in names]
        odds = sum(_RARE.get(name, _ODDS) for name in plain)
        return (together - float(apart.sum())) / _TEMPERATURE - odds + tilt - _unlikely(heights)

    def _parts(
        self, evidence: StrokeEvidence, theta: Array, features: Mapping[str, int], names: Sequence[str]
    ) -> tuple[Array, Array, Array]:
        rows = evidence.rows_of(features, theta)
        chosen = np.concatenate([np.arange(self._size) + self._index[name] * self._size for name in names])
        moves = np.concatenate([stroke_moves(evidence.samples[rows[name]][_USED]) for name in names])
        return moves, self._mean[chosen], self._covariance[np.ix_(chosen, chosen)]


def _unlikely(heights: Mapping[str, float]) -> float:
    """Return the log odds against features at these heights, y downwards: out of order, or on one side alone."""
    odds = 0.0
    for order in _ORDERS:
        drawn = [heights[name] for name in order if name in heights]
        odds += _DISORDER * sum(a >= b for a, b in pairwise(drawn))
    for name in heights:
        if name in FEATURES and FEATURES[name].mirror not in heights:
            odds += _ONE_SIDED
    # A single lip is drawn with the line of the mouth or with the other lip.
    lips = [name for name in heights if "lip" in name]
    if "mouth outline" not in heights and "mouth line" not in heights:
        odds += _NO_MOUTH if len(lips) < 2 else 0.0
    return odds


def _excluded(name: str) -> set[str]:
    """Return the features that a drawing with the feature ``name`` has not."""
    if name == NOSE_BASE:
        return {"left nose wing", "right nose wing"}
    found = set(FEATURES[name].components)
    found |= {other.name for other in FEATURES.values() if name in other.components}
    return found | ({NOSE_BASE} if "nose wing" in name else set())


def _proportions(names: Sequence[str], mean: Array) -> Array:
    """Return the directions in which proportions vary, by their standard deviations: (2 samples features, directions).

    Args:
        names: Names of the features.
        mean: Mean samples of each, shape (features, samples, 2).
    """
    groups = np.array([group_of(name) for name in names])
    side = np.array([1.0 if "left" in name else -1.0 if "right" in name else 0.0 for name in names])
    directions = []
    for group in np.unique(groups):
        inside = (groups == group)[:, None]
        for axis, deviation, sign in ((0, _APART, side), (1, _UP, np.ones(len(names)))):
            move = np.zeros_like(mean)
            move[..., axis] = deviation * inside * sign[:, None]
            directions.append(move)
        sized = np.zeros_like(mean)
        for kind in (-1.0, 0.0, 1.0):
            members = inside[:, 0] & (side == kind)
            if members.any():
                sized[members] = mean[members] - mean[members].mean(axis=(0, 1))
        for axis in (0, 1):
            move = np.zeros_like(mean)
            move[..., axis] = _SIZE * sized[..., axis]
            directions.append(move)
    return np.stack(directions, axis=-1).reshape(mean.size, -1)
