"""Second-order model of the energy about one pose, with the bounds kept exact."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from faceposer.solve.definite import robust_cholesky, solve_triangular
from faceposer.solve.problem import PoseProblem
from faceposer.solve.term import Array, PoseState

# Largest number of steps to the minimum of a model, and the slope at which it counts as reached.
_STEPS, _SLOPE = 30, 1e-6
# Least share of the promised decrease that a full step must achieve; otherwise the minimum along it is searched for.
_SUFFICIENT_DECREASE = 0.05


@dataclass(frozen=True, eq=False)
class _Evaluation:
    """A model evaluated at one step from its expansion point.

    Attributes:
        step: Shape (r,).
        value: Value of the model.
        smooth: Gradient without the bounds, shape (r,).
        slope: Gradient, shape (r,).
        exceeded: Mask of the bounds that are exceeded.
        stiffness: Curvature that the exceeded bounds add, shape (r, r), or 0.
    """

    step: Array
    value: float
    smooth: Array
    slope: Array
    exceeded: NDArray[np.bool_]
    stiffness: Array | float


class BoundedModel:
    """g d + d^T C d / 2 + the bounds at p + d, with gradient g and Gauss-Newton curvature C of all else at a pose p.

    Bounds are squared excesses: they have curvature where they are exceeded and none elsewhere. A step that ignores
    which of them it will meet is far too long or far too short. With the bounds, the model is convex and piecewise
    quadratic. Semismooth Newton steps (Qi and Sun 1993), with a line search where the full step is too long, find its
    minimum in a few steps without evaluating the energy.

    Attributes:
        lower: L with L L^T the curvature of the model, shape (r, r), at the last step evaluated.
        slope: Largest component of the gradient at p, in coordinates in which the energy is nearly isotropic.
    """

    def __init__(self, problem: PoseProblem, state: PoseState, gradient: Array) -> None:
        """Expand the energy of ``problem`` about a ``state`` with the ``gradient``, shape (r,)."""
        self._bounds, self._p = problem.bounds, state.p
        self._curvature = problem.curvature_at(state, bounded=False)
        self._gradient = np.zeros_like(gradient)
        bounds = self._evaluate(self._gradient)
        self._gradient = gradient - bounds.slope
        self._start = _Evaluation(
            bounds.step, bounds.value, self._gradient, gradient, bounds.exceeded, bounds.stiffness
        )
        self.lower = robust_cholesky(self._curvature + bounds.stiffness)
        self.slope = self.scaled_slope(gradient)

    def scaled_slope(self, gradient: Array) -> float:
        """Return the largest component of a ``gradient``, (r,), in the coordinates of ``slope``."""
        return float(np.abs(solve_triangular(self.lower, gradient)).max())

    def minimise(self) -> tuple[Array, float]:
        """Return the step to the minimum of the model, shape (r,), and the decrease of the model there."""
        current = self._start
        for _ in range(_STEPS):
            scaled = solve_triangular(self.lower, current.slope)
            if np.abs(scaled).max() <= _SLOPE:
                break
            direction = -solve_triangular(self.lower, scaled, transposed=True)
            before, current = current, self._evaluate(current.step + direction)
            if current.value > before.value - _SUFFICIENT_DECREASE * float(scaled @ scaled):
                current = self._evaluate(before.step + self._line_minimum(before, direction) * direction)
            elif np.array_equal(current.exceeded, before.exceeded):
                # The model was one quadratic form along the whole step, so this is its minimum.
                break
            self.lower = robust_cholesky(self._curvature + current.stiffness)
        return current.step, self._start.value - current.value

    def _evaluate(self, step: Array) -> _Evaluation:
        bent = self._curvature @ step
        smooth = self._gradient + bent
        value, slope = float(step @ (self._gradient + 0.5 * bent)), smooth
        stiffness: Array | float = 0.0
        exceeded = np.zeros(0, dtype=bool)
        for term in self._bounds:
            own, own_slope, own_exceeded, own_stiffness = term.evaluate(self._p + step)
            value, slope, stiffness = value + own, slope + own_slope, stiffness + own_stiffness
            exceeded = np.concatenate([exceeded, own_exceeded])
        return _Evaluation(step, value, smooth, slope, exceeded, stiffness)

    def _line_minimum(self, start: _Evaluation, direction: Array) -> float:
        """Return the step length from 0 to 1 that minimises the model along a descent ``direction``, (r,).

        The derivative along the direction is non-decreasing and piecewise linear, with breakpoints where bounds start
        or cease to be exceeded.
        """
        p = self._p + start.step
        shares = np.unique(np.concatenate([[0.0, 1.0], *(term.crossings(p, direction) for term in self._bounds)]))
        slopes = float(direction @ start.smooth) + float(direction @ self._curvature @ direction) * shares
        for term in self._bounds:
            slopes += term.slopes_along(p, direction, shares)
        after = int(np.searchsorted(slopes, 0.0))
        if after in (0, len(shares)):
            return 0.0 if after == 0 else 1.0
        low, high = slopes[after - 1], slopes[after]
        return float(shares[after - 1] + (shares[after] - shares[after - 1]) * low / (low - high))
