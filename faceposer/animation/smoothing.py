"""Joint smoothing of the poses of many frames."""

import contextlib
import math
from collections.abc import Sequence
from typing import Protocol

import numpy as np
from scipy import linalg

from faceposer.progress import Progress
from faceposer.solve.term import Array

_MAX_STEPS = 30
# The iteration stops when a step reduces the energy by less than this share.
_LEAST_GAIN = 1e-5
_MAX_HALVINGS = 12
_SUFFICIENT = 1e-4


class FrameEnergy(Protocol):
    """The energy of one frame, such as of a ``PoseProblem``."""

    def energy_and_gradient(self, p: Array) -> tuple[float, Array]:
        """Return E(p) and its gradient, shape (r,), at the unknowns ``p``, shape (r,)."""
        ...

    def curvature(self, p: Array) -> Array:
        """Return an estimate of the second derivative of E at ``p``, shape (r, r), positive definite."""
        ...


def smooth_poses(
    problems: Sequence[FrameEnergy],
    metric: Array,
    poses: Array,
    before: Array,
    progress: Progress,
    sudden: float = math.inf,
) -> Array:
    """Return the poses, shape (F, r), that minimise the sum over frames t of E_t(p_t) + sum_g c(d_t^T M_g d_t).

    Here d_t = p_t - 2 p_{t-1} + p_{t-2}, and c(e) = n ln(1 + e / n), the cost of Cauchy's density, which hardly grows
    where e is above n: changes that the frames are sure of are kept, each group g by itself. Newton's method uses the
    Gauss-Newton curvature of each frame and, for c, that of the parabola which touches it from above; together, these
    form a banded matrix, whose Cholesky factorisation costs O(F).

    Args:
        problems: The energies E_t of the F frames.
        metric: M, shape (r, r), or one matrix for each group, shape (G, r, r).
        poses: Initial poses, shape (F, r).
        before: Fixed poses before the first frame, shape (n, r) with n from 0 to 2.
        progress: Checked for cancellation after each step.
        sudden: n, the cost from which a change counts as sudden; c(e) = e if it is infinite.

    Raises:
        CancelledError: If the progress was cancelled.
    """
    smoothness = _Smoothness(metric.reshape(-1, *metric.shape[-2:]), before, len(poses), sudden)
    x = np.array(poses)
    energy = _energy(problems, smoothness, x)
    for _ in range(_MAX_STEPS):
        gradient = smoothness.gradient(x)
        gradient += [problem.energy_and_gradient(p)[1] for problem, p in zip(problems, x, strict=True)]
        curvatures = np.array([problem.curvature(p) for problem, p in zip(problems, x, strict=True)])
        step = _newton_step(smoothness.banded_curvature(x, curvatures), gradient)
        slope = float(np.vdot(step, gradient))
        share = 1.0
        for _ in range(_MAX_HALVINGS):
            tried = _energy(problems, smoothness, x + share * step)
            if tried <= energy + _SUFFICIENT * share * slope:
                break
            share *= 0.5
        else:
            break
        x += share * step
        gain, energy = energy - tried, tried
        progress.check()
        if gain < _LEAST_GAIN * abs(energy):
            break
    return x


def _newton_step(bands: Array, gradient: Array) -> Array:
    """Return minus the inverse of a banded matrix times the gradient, shape (F, r).

    Points with huge weights can exceed all other terms beyond double precision; a small multiple of the identity then
    restores definiteness. The step remains a descent direction.
    """
    mean = float(bands[0].mean())
    for jitter in (0.0, 1e-12, 1e-9, 1e-6):
        bands[0] += jitter * mean
        with contextlib.suppress(np.linalg.LinAlgError):
            step: Array = linalg.solveh_banded(bands, -gradient.ravel(), lower=True, check_finite=False)
            return step.reshape(gradient.shape)
    return -gradient / mean


def _energy(problems: Sequence[FrameEnergy], smoothness: "_Smoothness", x: Array) -> float:
    frame_energies = sum(problem.energy_and_gradient(p)[0] for problem, p in zip(problems, x, strict=True))
    return frame_energies + smoothness.value(x)


class _Smoothness:
    """Sum over t and g of c(d_t^T M_g d_t) over F poses, optionally preceded by fixed ones."""

    def __init__(self, metrics: Array, before: Array, n_frames: int, sudden: float) -> None:
        self._metrics, self._sudden = metrics, sudden
        steps = np.zeros((max(len(before) + n_frames - 2, 0), len(before) + n_frames))
        for row in range(len(steps)):
            steps[row, row : row + 3] = (1.0, -2.0, 1.0)
        self._steps = steps[:, len(before) :]
        self._constant = steps[:, : len(before)] @ before

    def _changes(self, x: Array) -> Array:
        changes: Array = self._steps @ x + self._constant
        return changes

    def _costs(self, changes: Array) -> Array:
        """Return d_t^T M_g d_t, shape (G, T)."""
        return np.stack([((changes @ metric) * changes).sum(axis=1) for metric in self._metrics])

    def _weights(self, changes: Array) -> Array:
        """Return c'(d_t^T M_g d_t), shape (G, T)."""
        result: Array = 1.0 / (1.0 + self._costs(changes) / self._sudden)
        return result

    def value(self, x: Array) -> float:
        costs = self._costs(self._changes(x))
        return float(costs.sum() if math.isinf(self._sudden) else self._sudden * np.log1p(costs / self._sudden).sum())

    def gradient(self, x: Array) -> Array:
        """Return the gradient with respect to the poses, shape (F, r)."""
        changes = self._changes(x)
        weights = self._weights(changes)
        slopes = sum(
            weight[:, None] * (changes @ metric) for weight, metric in zip(weights, self._metrics, strict=True)
        )
        gradient: Array = 2.0 * (self._steps.T @ slopes)
        return gradient

    def banded_curvature(self, x: Array, curvatures: Array) -> Array:
        """Return the second derivative plus the ``curvatures`` of the frames, (F, r, r), in LAPACK's lower banded form.

        Entry (i, j) of the matrix over all coefficients of all frames is entry (i - j, j) of the result.
        """
        n_frames, r = curvatures.shape[:2]
        bands = np.zeros((3 * r, n_frames, r))
        weights = self._weights(self._changes(x))
        i, j = (grid.ravel() for grid in np.indices((r, r)))
        for apart in range(min(3, n_frames)):
            later = self._steps[:, apart:]
            # Products of the columns of two frames, weighted, by group, shape (G, F - apart).
            shares = weights @ (later * self._steps[:, : later.shape[1]])
            blocks = 2.0 * np.tensordot(shares.T, self._metrics, 1)
            if apart == 0:
                blocks = blocks + curvatures
            below = apart * r + i >= j
            frames = np.arange(n_frames - apart)
            bands[(apart * r + i - j)[below], frames[:, None], j[below]] = blocks[:, i[below], j[below]]
        return bands.reshape(3 * r, -1)
