"""Errors of a hand that draws along a curve, and strokes that depict nothing, as Gaussians over points of a stroke.

Lengths are in units of the hand: the 720th part of the face's size in the image, about a pixel of a view 960 pixels
high that frames the face. Errors are thus in proportion to the face, whatever the size of the image.
"""

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Number of points, evenly spaced along a stroke, by which it is compared with features.
SAMPLES = 16


@dataclass(frozen=True)
class HandModel:
    """Sizes of a hand's errors, in units of the hand unless stated otherwise.

    Attributes:
        shift: Standard deviation of the common shift of all points.
        jitter: Standard deviation of smooth deviations from the curve.
        smoothness: Correlation length of these deviations, as a share of the stroke.
        tremor: Standard deviation of independent deviations of points.
        ends: Standard deviation of the places of the ends along the curve, as a share of its length.
        slide: Standard deviation of points along the curve between the ends, as a share of its length.
        size: Standard deviation of the relative size.
        turn: Standard deviation of the orientation, in radians.
    """

    shift: float = 6.0
    jitter: float = 5.0
    smoothness: float = 0.14
    tremor: float = 1.2
    ends: float = 0.05
    slide: float = 0.025
    size: float = 0.05
    turn: float = 0.05

    @cached_property
    def covariance(self) -> Array:
        """Covariance of shift, jitter and tremor of one coordinate of the samples, shape (SAMPLES, SAMPLES)."""
        smooth = self.jitter**2 * _smooth(self.smoothness)
        return self.shift**2 + smooth + self.tremor**2 * np.eye(SAMPLES)

    @cached_property
    def whitener(self) -> Array:
        """Matrix V with V^T V the inverse of the covariance, shape (SAMPLES, SAMPLES)."""
        return np.asarray(np.linalg.inv(np.linalg.cholesky(self.covariance)))

    @cached_property
    def log_peak(self) -> float:
        """Logarithm of the greatest density of the samples' errors, both coordinates."""
        half = float(np.log(np.diagonal(self.whitener)).sum())
        return 2.0 * half - SAMPLES * float(np.log(2.0 * np.pi))

    def slack(self, places: Array) -> Array:
        """Return the directions of errors that depend on the curve, scaled to their standard deviations.

        Args:
            places: Samples of curves, shape (m, SAMPLES, 2).

        Returns:
            Moves of the ends along the curve, slides between them, size and turn, shape (m, SAMPLES, 2, 6).
        """
        share = np.linspace(0.0, 1.0, SAMPLES)[None, :, None]
        # The derivative by the share is the tangent times the length.
        along = np.gradient(places, 1.0 / (SAMPLES - 1), axis=1)
        around = places - places.mean(axis=1, keepdims=True)
        turned = around[..., ::-1] * (-1.0, 1.0)
        return np.stack(
            [
                along * (1.0 - share) * self.ends,
                along * share * self.ends,
                along * np.sin(np.pi * share) * self.slide,
                along * np.sin(2.0 * np.pi * share) * self.slide * 0.7,
                around * self.size,
                turned * self.turn,
            ],
            axis=-1,
        )


@dataclass(frozen=True)
class ScribbleModel:
    """Density of strokes that depict no feature: random curves and ticks of any length anywhere on the face.

    A mixture of Gaussians: curves that wind, and simple strokes, straight or in one bow, of several lengths. Without
    the short ones, a tick would be far more like the shortest possible feature than like a scribble.

    Attributes:
        place: Standard deviation of the middle of such a stroke about the middle of the face, in units of the hand.
        extent: Standard deviation of the points of a curve about its middle.
        smoothness: Correlation lengths of its points, as shares of the stroke, each for a part of the extent.
        winding: Share of curves.
        simple: Sizes of simple strokes, about their length times their smoothness.
        simplicity: Correlation length of their points.
        hand: Errors of the hand, which simple strokes have in common with features.
    """

    place: float = 200.0
    extent: float = 90.0
    smoothness: tuple[float, ...] = (0.1, 0.5)
    winding: float = 0.4
    simple: tuple[float, ...] = (15.0, 40.0, 100.0, 250.0)
    simplicity: float = 1.2
    hand: HandModel = field(default_factory=HandModel)

    @cached_property
    def _parts(self) -> tuple[tuple[float, Array], ...]:
        """Log weight and whitener, (SAMPLES, SAMPLES), of each Gaussian."""
        curves = sum(self.extent**2 / len(self.smoothness) * _smooth(length) for length in self.smoothness)
        found = [(self.winding, curves + 4.0 * np.eye(SAMPLES))]
        rest = (1.0 - self.winding) / len(self.simple)
        found += [(rest, size**2 * _smooth(self.simplicity) + self.hand.covariance) for size in self.simple]
        return tuple(
            (float(np.log(weight)), np.asarray(np.linalg.inv(np.linalg.cholesky(self.place**2 + covariance))))
            for weight, covariance in found
        )

    def log_density(self, samples: Array) -> float:
        """Return the log density of ``samples`` about the middle of the face, shape (SAMPLES, 2)."""
        logs = []
        for log_weight, whitener in self._parts:
            white = whitener @ samples
            peak = 2.0 * float(np.log(np.diagonal(whitener)).sum()) - SAMPLES * float(np.log(2.0 * np.pi))
            logs.append(log_weight + peak - 0.5 * float((white * white).sum()))
        return float(np.logaddexp.reduce(logs))


def _smooth(length: float) -> Array:
    """Return the correlations of samples at correlation ``length``, a share of the stroke."""
    share = np.linspace(0.0, 1.0, SAMPLES)
    offsets = share[:, None] - share
    return np.asarray(np.exp(-0.5 * (offsets / length) ** 2))
