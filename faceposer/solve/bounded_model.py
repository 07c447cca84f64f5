"""The energy of a pose about one place: second order, but with its bounds as they are."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from faceposer.solve.definite import solved_by_root, square_root
from faceposer.solve.problem import PoseProblem
from faceposer.solve.term import Array, PoseState

# Most steps to the least value of a model, and the slope at which it is reached.
_STEPS, _SLOPE = 30, 1e-6
# Of the decrease that a step promises, at least so much is to come true, or its best share is looked for.
_COMES_TRUE = 0.05


@dataclass(frozen=True, eq=False)
class _Place:
    """A model at one step from where it was made.

    Attributes:
        step: Shape (r,).
        value: Of the model.
        smooth: Its slope without the bounds, shape (r,).
        slope: Its slope, shape (r,).
        exceeded: Which bounds are exceeded.
        stiffness: What those add to the curvature, shape (r, r), or 0.
    """

    step: Array
    value: float
    smooth: Array
    slope: Array
    exceeded: NDArray[np.bool_]
    stiffness: Array | float


class BoundedModel:
    """g d + d^T C d / 2 + the bounds at p + d, with slope g and Gauss-Newton curvature C of all else at a pose p.

    Bounds, squares of what exceeds them, have a curvature where they are exceeded and none elsewhere: a step that does
    not know which of them it will meet goes far too far, or hardly at all. With them the model is convex and piecewise
    quadratic. Newton's method for such functions (semismooth: Qi and Sun 1993), with the least value along each step
    where the whole step is too far, finds its least value in a few steps, without an evaluation of the energy.

    Attributes:
        lower: L with L L^T the curvature of the energy, shape (r, r), at the last place that was looked at.
        slope: Greatest slope at p in coordinates in which the energy is nearly round.
    """

    def __init__(self, problem: PoseProblem, state: PoseState, gradient: Array) -> None:
        """Look at the energy of ``problem`` from a ``state`` with its ``gradient``, shape (r,)."""
        self._bounds, self._p = problem.bounds, state.p
        self._curvature = problem.curvature_at(state, bounded=False)
        self._gradient = np.zeros_like(gradient)
        here = self._at(self._gradient)
        self._gradient = gradient - here.slope
        self._start = _Place(here.step, here.value, self._gradient, gradient, here.exceeded, here.stiffness)
        self.lower = square_root(self._curvature + here.stiffness)
        self.slope = self.slope_of(gradient)

    def slope_of(self, gradient: Array) -> float:
        """Return the greatest slope of a ``gradient``, (r,), in coordinates in which the energy is nearly round."""
        return float(np.abs(solved_by_root(self.lower, gradient)).max())

    def least(self) -> tuple[Array, float]:
        """Return the step, shape (r,), to where the model is least, and by how much it is less there."""
        place = self._start
        for _ in range(_STEPS):
            scaled = solved_by_root(self.lower, place.slope)
            if np.abs(scaled).max() <= _SLOPE:
                break
            way = -solved_by_root(self.lower, scaled, transposed=True)
            before, place = place, self._at(place.step + way)
            if place.value > before.value - _COMES_TRUE * float(scaled @ scaled):
                place = self._at(before.step + self._best_share(before, way) * way)
            elif np.array_equal(place.exceeded, before.exceeded):
                # On the whole way the model was one quadratic form, whose least value this is.
                break
            self.lower = square_root(self._curvature + place.stiffness)
        return place.step, self._start.value - place.value

    def _at(self, step: Array) -> _Place:
        bent = self._curvature @ step
        smooth = self._gradient + bent
        value, slope = float(step @ (self._gradient + 0.5 * bent)), smooth
        stiffness: Array | float = 0.0
        exceeded = np.zeros(0, dtype=bool)
        for term in self._bounds:
            own, own_slope, own_exceeded, own_stiffness = term.at(self._p + step)
            value, slope, stiffness = value + own, slope + own_slope, stiffness + own_stiffness
            exceeded = np.concatenate([exceeded, own_exceeded])
        return _Place(step, value, smooth, slope, exceeded, stiffness)

    def _best_share(self, place: _Place, way: Array) -> float:
        """Return the share of the ``way``, (r,), from a ``place`` where the model falls, on which it is least.

        Its derivative rises all along, in straight lines between where bounds begin to be exceeded and where they cease
        to be.
        """
        p = self._p + place.step
        shares = np.unique(np.concatenate([[0.0, 1.0], *(term.crossings(p, way) for term in self._bounds)]))
        slopes = float(way @ place.smooth) + float(way @ self._curvature @ way) * shares
        for term in self._bounds:
            slopes += term.slopes_along(p, way, shares)
        after = int(np.searchsorted(slopes, 0.0))
        if after in (0, len(shares)):
            return 0.0 if after == 0 else 1.0
        low, high = slopes[after - 1], slopes[after]
        return float(shares[after - 1] + (shares[after] - shares[after - 1]) * low / (low - high))
