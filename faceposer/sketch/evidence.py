"""Evidence of a whole stroke for intervals of feature curves: one Gaussian per interval and direction."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from faceposer.sketch.curve_density import Track, ViewedCurves
from faceposer.sketch.hand import SAMPLES, HandModel
from faceposer.sketch.intervals import Intervals, candidate_intervals, sampled

Array = NDArray[np.float64]
Ids = NDArray[np.intp]

# Log evidence behind the likeliest interval at which an interval is not computed exactly.
_BEHIND = 25.0
# Added to the information of a stroke about the pose, to invert it.
_REGULAR = 1e-6


@dataclass(frozen=True, eq=False)
class Posterior:
    """Posterior of the pose for one interval of a line: a mixture with the components of the prior.

    Attributes:
        log_likelihood: Log density of the stroke for each component, shape (n,).
        means: Posterior mean of z of each component, shape (n, q).
        covariance: Their common covariance, shape (q, q).
    """

    log_likelihood: Array
    means: Array
    covariance: Array


@dataclass(frozen=True, eq=False)
class Evidence:
    """Log evidence of a stroke for m intervals of some lines.

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
    _inverse: Array
    _pulled: Array
    _logs: Array

    def log_total(self, index: int) -> float:
        """Return the log evidence of line ``index``, summed over its intervals and directions."""
        weighted = self._weighted(index)
        top = weighted.max()
        return float(top + np.log(np.exp(weighted - top).sum()))

    def best(self, index: int) -> tuple[int, int]:
        """Return the likeliest interval of line ``index`` and its direction, 1 for backwards."""
        weighted = self._weighted(index)
        row, direction = np.unravel_index(int(np.argmax(weighted)), weighted.shape)
        return int(row), int(direction)

    def _weighted(self, index: int) -> Array:
        return np.asarray(
            self.log_evidence[self.runs[index]] + self.intervals[index].log_weights[:, None] - np.log(2.0)
        )

    def posterior(self, index: int, row: int, direction: int) -> Posterior:
        """Return the posterior of the pose for an interval of line ``index`` and a direction."""
        at = self.runs[index].start + row
        density, directions = self.curves.density, self.curves.directions[self.tracks[index].feature]
        size = directions.shape[1]
        inside, shift = self._inverse[at, :size, :size], self._pulled[at, :size, direction]
        local = density.means @ directions
        logs = self._logs[at, direction] + local @ shift - 0.5 * (local * (local - local @ inside)).sum(axis=1)
        means = density.means + (shift + local @ inside - local) @ directions.T
        return Posterior(logs, means, np.eye(len(directions)) + directions @ (inside - np.eye(size)) @ directions.T)


def nearer_evidence(found: Evidence, index: int, stroke: Array, hand: HandModel) -> Evidence:
    """Return the evidence for line ``index`` alone, linearised again at the most probable pose.

    A mouth that opens changes the share of its outline between two points; samples at even lengths are then at other
    points of the lips.
    """
    posterior = found.posterior(index, *found.best(index))
    density, name = found.curves.density, found.tracks[index].feature
    at = posterior.means[int(np.argmax(density.log_weights + posterior.log_likelihood))]
    curves = ViewedCurves(found.curves.rows, density.rebased(at), found.curves.camera, [name])
    return evidence(curves, stroke, hand, [candidate_intervals(found.tracks[index].closed)])


def evidence(curves: ViewedCurves, stroke: Array, hand: HandModel, intervals: Sequence[Intervals]) -> Evidence:
    """Return the evidence of ``stroke`` for the ``intervals`` of each of the lines of ``curves``.

    The samples are y = x + W (z, e) + n, where x is the base's curve, z the pose, e are standard normals of errors
    along the curve, and n is the shift and jitter of the hand with precision V^T V. With A = V W and S = I + A^T A, the
    matrix inversion lemma gives the density about z = 0; that about z = m is its product with
    exp(m^T S^-1 A^T V (y - x) - m^T (I - S^-1) m / 2).

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
    inverse = np.linalg.inv(system)
    log_determinant = np.linalg.slogdet(system)[1]
    right = transposed @ residual
    pulled = inverse @ right
    quadratic = (residual * residual).sum(axis=1) - (right * pulled).sum(axis=1)
    logs = hand.log_peak - 0.5 * (log_determinant[:, None] + quadratic)
    mixed = _mixed(curves, runs, inverse, pulled, logs)
    return Evidence(tuple(curves.tracks), tuple(runs), tuple(intervals), mixed, curves, inverse, pulled, logs)


def _mixed(curves: ViewedCurves, runs: Sequence[slice], inverse: Array, pulled: Array, logs: Array) -> Array:
    """Return the log density of the mixture, (m, 2), from that of a component at z = 0, ``logs``.

    No component, wherever it is, gains more than half of mu^T (I - P)^-1 mu, with P the covariance and mu the mean of
    its posterior. Where even this leaves an interval far behind the likeliest one, the sum is not computed.
    """
    size = next(iter(curves.directions.values())).shape[1]
    shift = pulled[:, :size]
    informed = np.eye(size) - inverse[:, :size, :size]
    free = informed + _REGULAR * np.eye(size)
    bound = logs + 0.5 * (shift * np.linalg.solve(free, shift)).sum(axis=1)
    mixed, floor = bound - _BEHIND, -np.inf
    density = curves.density
    of_features = []
    for track, run in zip(curves.tracks, runs, strict=True):
        local = density.means @ curves.directions[track.feature]
        products = (local[:, :, None] * local[:, None, :]).reshape(len(local), -1)
        of_features.append((run, local, products))

    def fill(rows: Ids, sides: Ids, local: Array, products: Array) -> float:
        gains = shift[rows, :, sides] @ local.T - 0.5 * informed[rows].reshape(len(rows), -1) @ products.T
        gains += density.log_weights
        top = gains.max(axis=1)
        np.exp(gains - top[:, None], out=gains)
        mixed[rows, sides] = logs[rows, sides] + top + np.log(gains.sum(axis=1))
        return float(mixed[rows, sides].max())

    for run, *components in of_features:
        row, side = np.unravel_index(int(np.argmax(bound[run])), bound[run].shape)
        floor = max(floor, fill(np.array([run.start + row]), np.array([side]), *components))
    for run, *components in of_features:
        rows, sides = np.nonzero(bound[run] > floor - _BEHIND)
        if len(rows):
            fill(rows + run.start, sides, *components)
    return mixed
