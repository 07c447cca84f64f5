"""Evidence of a whole stroke for intervals of feature curves: one Gaussian per interval and direction."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from faceposer.sketch.curve_density import Track, ViewedCurves
from faceposer.sketch.hand import SAMPLES, HandModel
from faceposer.sketch.intervals import Intervals, sampled

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Evidence:
    """Log evidence of a stroke for m intervals of some lines under one density of poses, with all of its errors.

    Attributes:
        tracks: The lines.
        runs: The intervals of each line among the m.
        intervals: The intervals of each line.
        log_evidence: Log density of the stroke drawn forwards and backwards, shape (m, 2); without the weights of the
            intervals.
        curves: The view of the lines.
    """

    tracks: tuple[Track, ...]
    runs: tuple[slice, ...]
    intervals: tuple[Intervals, ...]
    log_evidence: Array
    curves: ViewedCurves
    _lower: Array
    _pulled: Array

    def only(self, indices: Sequence[int]) -> "Evidence":
        """Return the evidence for the lines ``indices`` alone."""
        tracks, runs, intervals = (tuple(of[i] for i in indices) for of in (self.tracks, self.runs, self.intervals))
        return replace(self, tracks=tracks, runs=runs, intervals=intervals)

    def log_total(self, index: int, temperature: float) -> float:
        """Return the log evidence of line ``index``, summed over its intervals and directions."""
        weighted = self._weighted(index) / temperature
        top = weighted.max()
        return float((top + np.log(np.exp(weighted - top).sum())) * temperature)

    def best(self, index: int) -> tuple[int, int]:
        """Return the likeliest interval of line ``index`` and its direction, 1 for backwards."""
        weighted = self._weighted(index)
        row, direction = np.unravel_index(int(np.argmax(weighted)), weighted.shape)
        return int(row), int(direction)

    def _weighted(self, index: int) -> Array:
        return np.asarray(
            self.log_evidence[self.runs[index]] + self.intervals[index].log_weights[:, None] - np.log(2.0)
        )

    def posterior(self, index: int, row: int, direction: int) -> tuple[Array, Array]:
        """Return the posterior mean, (q,), and covariance, (q, q), of the standard normals of the pose."""
        at = self.runs[index].start + row
        inverse = np.linalg.inv(self._lower[at])
        covariance = inverse.T @ inverse
        directions = self.curves.directions[self.tracks[index].feature]
        size = directions.shape[1]
        mean = directions @ (covariance @ self._pulled[at, :, direction])[:size]
        inside = covariance[:size, :size] - np.eye(size)
        return mean, np.eye(len(directions)) + directions @ inside @ directions.T


def evidence(curves: ViewedCurves, stroke: Array, hand: HandModel, intervals: Sequence[Intervals]) -> Evidence:
    """Return the evidence of ``stroke`` for the ``intervals`` of each of the lines of ``curves``.

    With the samples y = x + W e + n, where x is the mean of the curve's samples, e are the standard normals of the
    pose and of errors along the curve, and n is the shift and jitter of the hand with precision V^T V, the density of y
    follows from S = I + (V W)^T (V W) by the matrix inversion lemma.

    Args:
        curves: The lines.
        stroke: Even samples of the stroke in the coordinates of ``curves``, shape (SAMPLES, 2).
        hand: Errors of the hand.
        intervals: The intervals of each line.
    """
    means, moves, runs, begin = [], [], [], 0
    for track, candidates in zip(curves.tracks, intervals, strict=True):
        pixels, derivative = curves.pixels[track.feature], curves.moves[track.feature]
        i, j, share = sampled(pixels, track.closed, candidates)
        share = share[..., None]
        means.append((1.0 - share) * pixels[i] + share * pixels[j])
        share = share[..., None]
        moves.append((1.0 - share) * derivative[i] + share * derivative[j])
        runs.append(slice(begin, begin + len(candidates)))
        begin += len(candidates)
    mean = np.concatenate(means)
    factor = np.concatenate([np.concatenate(moves), hand.slack(mean)], axis=-1)
    count, size = len(mean), factor.shape[-1]
    white = (hand.whitener @ factor.reshape(count, SAMPLES, 2 * size)).reshape(count, 2 * SAMPLES, size)
    both = np.stack([stroke, stroke[::-1]], axis=-1) - mean[..., None]
    residual = (hand.whitener @ both.reshape(count, SAMPLES, 4)).reshape(count, 2 * SAMPLES, 2)
    transposed = white.transpose(0, 2, 1)
    system = transposed @ white
    system[:, np.arange(size), np.arange(size)] += 1.0
    lower = np.linalg.cholesky(system)
    pulled = transposed @ residual
    forward = _forward(lower, pulled)
    quadratic = (residual * residual).sum(axis=1) - (forward * forward).sum(axis=1)
    log_determinant = np.log(np.diagonal(lower, axis1=1, axis2=2)).sum(axis=1)
    logs = hand.log_peak - log_determinant[:, None] - 0.5 * quadratic
    return Evidence(tuple(curves.tracks), tuple(runs), tuple(intervals), logs, curves, lower, pulled)


def _forward(lower: Array, right: Array) -> Array:
    """Solve ``lower`` x = ``right`` for stacks of triangular matrices, (m, Q, Q), and sides, (m, Q, k)."""
    solved = right.copy()
    for row in range(lower.shape[1]):
        if row:
            solved[:, row] -= (lower[:, row, None, :row] @ solved[:, :row])[:, 0]
        solved[:, row] /= lower[:, row, row, None]
    return solved
