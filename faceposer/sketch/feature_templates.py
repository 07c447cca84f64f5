"""Gaussian densities of whole features in a view, broad enough for drawings of other proportions."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from faceposer.geometry.camera import Camera
from faceposer.model.face_model import FaceModel
from faceposer.model.feature_curves import FEATURES
from faceposer.sketch.curve_density import FeatureRows, hand_unit, visibility
from faceposer.sketch.hand import SAMPLES, HandModel
from faceposer.sketch.outlines import is_closed
from faceposer.sketch.polyline import evenly

Array = NDArray[np.float64]

#: Both nose wings as one line, by which a drawing is aligned; it is no feature of the face.
NOSE_BASE = "nose base"
#: Errors of a hand that draws another person's face, in units of the hand; see ``HandModel``.
LOOSE = HandModel(shift=34.0, jitter=11.0, smoothness=0.3, tremor=4.0, ends=0.1, slide=0.08, size=0.24, turn=0.16)
# Standard deviation of a stroke that depicts nothing: of its middle, and of its points about it, in units of the hand.
_PLACE, _EXTENT = 230.0, 100.0
# Standard deviation of the relative height of the outline of an eye.
_ROUND = 2.0
# Standard deviation of the height of an open mouth, as a share of its width.
_OPEN = 0.25
# Standard deviation of the relative length of a lower lip.
_SHORT = 0.35
# Numbers of samples by which the start of a closed line may be shifted.
_SHIFTS = (0, -1, 1, -2, 2)
# Share of a feature that faces the camera below which it is not drawn.
_SEEN = 0.5


@dataclass(frozen=True, eq=False)
class Gaussian:
    """A Gaussian density of the samples of a line, as vectors of shape (2 SAMPLES,).

    Attributes:
        mean: Its mean.
        precision: Inverse of its covariance.
        log_peak: Logarithm of its greatest density.
    """

    mean: Array
    precision: Array
    log_peak: float

    @classmethod
    def of(cls, mean: Array, covariance: Array) -> "Gaussian":
        """Return the Gaussian with this ``mean`` and ``covariance``."""
        size = len(mean)
        log_determinant = float(np.linalg.slogdet(covariance)[1])
        return cls(
            mean,
            np.asarray(np.linalg.inv(covariance), dtype=np.float64),
            -0.5 * (log_determinant + size * float(np.log(2.0 * np.pi))),
        )


class ViewedFeatures:
    """The features of a character in a view, upright, in units of the hand about the middle of the face.

    Attributes:
        names: Names of the features that can be seen, and ``NOSE_BASE``.
        closed: True for features that end where they begin, by name.
        poses: Samples of each feature in each training pose, shape (n, SAMPLES, 2), by name.
        neutral: Samples on the neutral face, shape (SAMPLES, 2), by name.
    """

    def __init__(self, model: FaceModel, coefficients: Array, camera: Camera) -> None:
        """Project the features in the training poses ``coefficients``, shape (n, r)."""
        rows = FeatureRows.of(model)
        self.camera, self.unit = camera, hand_unit(rows, camera)
        self.middle = camera.project(rows.middle[None])[0]
        seen = visibility(rows, camera)
        self.poses: dict[str, Array] = {}
        self.neutral: dict[str, Array] = {}
        self.closed: dict[str, bool] = {}
        poses = np.concatenate([np.zeros((1, coefficients.shape[1])), coefficients])
        whole: dict[str, Array] = {}
        for name, track in rows.tracks.items():
            places = rows.neutral[track.rows] + np.einsum("pdr,nr->npd", rows.jacobian[track.rows], poses)
            pixels = camera.project(places.reshape(-1, 3)).reshape(*places.shape[:2], 2)
            whole[name] = (pixels - self.middle) / self.unit
            self.closed[name] = track.closed
        left, right = whole.get("left nose wing"), whole.get("right nose wing")
        if left is not None and right is not None:
            whole[NOSE_BASE] = np.concatenate([right, left[:, ::-1]], axis=1)
            self.closed[NOSE_BASE] = False
            seen[NOSE_BASE] = min(seen["left nose wing"], seen["right nose wing"])
        self.names = tuple(name for name in whole if seen[name] > _SEEN)
        for name in self.names:
            sampled = np.stack([samples_of(line, self.closed[name]) for line in whole[name]])
            self.neutral[name], self.poses[name] = sampled[0], sampled[1:]

    def density(self, hand: HandModel) -> Mapping[str, Gaussian]:
        """Return the density of each feature, drawn with the errors of ``hand``."""
        found = {}
        for name in self.names:
            flat = self.poses[name].reshape(len(self.poses[name]), -1)
            mean = flat.mean(axis=0)
            slack = slack_of(name, mean.reshape(SAMPLES, 2), hand).reshape(2 * SAMPLES, -1)
            covariance = (
                np.asarray(np.cov(flat.T), dtype=np.float64) + np.kron(hand.covariance, np.eye(2)) + slack @ slack.T
            )
            found[name] = Gaussian.of(mean, covariance)
        return found

    def pixels(self, points: Array) -> Array:
        """Return ``points`` of the face, shape (n, 2), in pixels of the camera."""
        return points * self.unit + self.middle


def slack_of(name: str, mean: Array, hand: HandModel) -> Array:
    """Return the directions of errors of ``hand``, and those in which artists draw the feature ``name`` freely.

    They are scaled to their standard deviations, shape (SAMPLES, 2, k), for the samples ``mean``, shape (SAMPLES, 2).
    """
    return np.concatenate([hand.slack(mean[None])[0], _drawn_freely(name, mean)], axis=-1)


def _drawn_freely(name: str, mean: Array) -> Array:
    """Return directions in which artists draw a feature unlike any face, by their standard deviations.

    Outlines of eyes and open mouths are rounder, and a lower lip is often a short line below the mouth.

    Args:
        name: Name of the feature.
        mean: Its samples, shape (SAMPLES, 2).

    Returns:
        Directions, shape (SAMPLES, 2, k).
    """
    if name == "mouth outline":
        around = mean - mean.mean(axis=0)
        opened = around * (0.0, _OPEN * float(np.ptp(mean[:, 0])) / max(float(np.ptp(mean[:, 1])), 1e-6))
        return (opened + (0.0, 0.5 * float(np.ptp(opened[:, 1]))))[..., None]
    if name.endswith("eye outline"):
        return ((mean - mean.mean(axis=0)) * (0.0, _ROUND))[..., None]
    if name == "outer lower lip":
        share = np.linspace(0.5, -0.5, len(mean))[:, None]
        return (np.gradient(mean, 1.0 / (len(mean) - 1), axis=0) * share * _SHORT)[..., None]
    return np.zeros((len(mean), 2, 0))


def no_feature() -> Gaussian:
    """Return the density of strokes that depict no feature."""
    share = np.linspace(0.0, 1.0, SAMPLES)
    gaps = share[:, None] - share
    smooth = 0.5 * np.exp(-0.5 * (gaps / 0.15) ** 2) + 0.5 * np.exp(-0.5 * (gaps / 0.5) ** 2)
    covariance = _PLACE**2 + _EXTENT**2 * smooth + 16.0 * np.eye(SAMPLES)
    return Gaussian.of(np.zeros(2 * SAMPLES), np.asarray(np.kron(covariance, np.eye(2)), dtype=np.float64))


def samples_of(line: Array, closed: bool) -> Array:
    """Return even samples of ``line``, (n, 2), shape (SAMPLES, 2); a closed one clockwise from its left end."""
    if not closed:
        return evenly(line, SAMPLES)
    around = evenly(line, 8 * SAMPLES + 1)[:-1]
    x, y = around.T
    if float((x * np.roll(y, -1) - np.roll(x, -1) * y).sum()) < 0.0:
        around = around[::-1]
    around = np.roll(around, -int(np.argmin(around[:, 0])), axis=0)
    return evenly(np.concatenate([around, around[:1]]), SAMPLES + 1)[:-1]


def variants_of(line: Array) -> tuple[bool, list[Array]]:
    """Return whether ``line``, (n, 2), is closed, and its samples in all orders that a feature may have."""
    closed = is_closed(line)
    samples = samples_of(line, closed)
    if closed:
        return True, [np.roll(samples, shift, axis=0) for shift in _SHIFTS]
    return False, [samples, samples[::-1]]


def mutually_exclusive(names: Sequence[str]) -> list[tuple[frozenset[str], frozenset[str]]]:
    """Return pairs of sets of features of which a drawing has one or the other: an outline or its components."""
    pairs = [
        (frozenset({name}), frozenset(FEATURES[name].components))
        for name in names
        if name in FEATURES and FEATURES[name].components
    ]
    if NOSE_BASE in names:
        pairs.append((frozenset({NOSE_BASE}), frozenset({"left nose wing", "right nose wing"})))
    return pairs
