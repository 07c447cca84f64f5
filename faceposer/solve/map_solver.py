"""Minimises the energy of a pose by Gauss-Newton steps, and by L-BFGS where these fail (Lau et al. 2009, section 6)."""

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from faceposer.solve.bounded_model import BoundedModel
from faceposer.solve.definite import solved_by_root
from faceposer.solve.problem import PoseProblem
from faceposer.solve.term import Array, PoseState

# In scaled coordinates a step of length 1 changes the energy by about 1, one standard deviation: this much slope
# is a hundredth of a deviation, far less than a pixel.
SLOPE_TOLERANCE = 1e-2
RELATIVE_TOLERANCE = 1e-7
_MAX_ITERATIONS = 100
# Steps of Gauss-Newton, how often each is halved, and which share of the decrease that it promises must come true.
_NEWTON_STEPS, _HALVINGS, _COMES_TRUE = 30, 6, 0.05
# Most come so near in so many that a tenth of the slope is as cheap; later ones, of strokes, gain less each.
_NEWTON_TOLERANCE, _FAST_STEPS = 0.1 * SLOPE_TOLERANCE, 3
# Energies that differ by less are equal.
_ROUNDING = 1e-9


@dataclass(frozen=True, eq=False)
class Solution:
    """A pose and how it was found.

    Attributes:
        coefficients: Shape (r,).
        energy: E at the coefficients.
        iterations: Steps of Gauss-Newton and iterations of L-BFGS.
        evaluations: Evaluations of E and its gradient, those that compare starts included.
        seconds: Wall-clock time of the solve.
        residuals_px: How far each constraint is from being met, in pixels, in the order of the problem.
        converged: Whether the solve ended by itself rather than by being stopped or at its iteration limit.
    """

    coefficients: Array
    energy: float
    iterations: int
    evaluations: int
    seconds: float
    residuals_px: tuple[float, ...]
    converged: bool


def prepare() -> None:
    """Import what a solve needs: a window does it once its first frame is there, so that its start need not wait."""
    import scipy.ndimage
    import scipy.optimize
    import scipy.spatial  # noqa: F401


def best_start(problem: PoseProblem) -> tuple[Array, int]:
    """Return the start of least energy, and how many were compared.

    The paper starts at the best component mean (eq. (21)). Here each component is first asked for its mean given the
    constraints, as they look to first order from the start pose: one linear solve a component, and much nearer.
    """
    candidates = [problem.start, *problem.conditional_means()]
    energies = [problem.energy_and_gradient(candidate)[0] for candidate in candidates]
    # A start that is as good as any, but for rounding, stays exactly as it is.
    best = 0 if energies[0] <= min(energies) + _ROUNDING else int(np.argmin(energies))
    return candidates[best], len(candidates)


def solve(
    problem: PoseProblem,
    x0: ArrayLike | None = None,
    on_iterate: Callable[[Array], None] | None = None,
    should_stop: Callable[[], bool] | None = None,
) -> Solution:
    """Return the pose of least energy near ``x0``.

    Quadratic forms, squares of nearly linear residuals, and bounds that are exceeded or not make up the energy: a few
    steps of Gauss-Newton, halved where they go too far, find its least value. Where they fail, as they may by strokes
    whose neighbours change, L-BFGS goes on in coordinates scaled by the curvature: there the problem is nearly round,
    and few evaluations do what takes dozens in coefficients, whose curvatures differ by orders of magnitude.

    Args:
        problem: The energy.
        x0: Coefficients to start from, shape (r,); the best of ``best_start`` if None.
        on_iterate: Called with the coefficients after each iteration.
        should_stop: Asked after each iteration; the pose reached so far is returned when it says yes.
    """
    began = time.perf_counter()
    compared = 0
    if problem.at_rest:
        start = problem.start
    elif x0 is None:
        start, compared = best_start(problem)
    else:
        start = np.array(x0, dtype=np.float64)

    def goes_on(pose: Array) -> bool:
        if on_iterate is not None:
            on_iterate(pose)
        return should_stop is None or not should_stop()

    reached = _newton(problem, start, goes_on)
    if not (reached.converged or reached.stopped):
        reached = _lbfgs(problem, reached, goes_on)
    return Solution(
        reached.state.p,
        reached.energy,
        reached.iterations,
        compared + reached.evaluations,
        time.perf_counter() - began,
        problem.residuals_px_at(reached.state),
        reached.converged,
    )


@dataclass(frozen=True, eq=False)
class _Reached:
    """How far a solve has come.

    Attributes:
        state: The best pose so far.
        energy: E there.
        lower: L with L L^T about the curvature there, shape (r, r).
        iterations: So far.
        evaluations: Of E and its gradient so far.
        converged: Whether the pose is the least one.
        stopped: Whether the caller wants no more.
    """

    state: PoseState
    energy: float
    lower: Array
    iterations: int
    evaluations: int
    converged: bool = False
    stopped: bool = False


def _newton(problem: PoseProblem, start: Array, goes_on: Callable[[Array], bool]) -> _Reached:
    """Return where steps of Gauss-Newton lead from ``start``, shape (r,)."""
    state = problem.state(start)
    energy, gradient = problem.energy_and_gradient_at(state)
    model = BoundedModel(problem, state, gradient)
    evaluations = 1
    for iteration in range(_NEWTON_STEPS):
        if model.slope <= _NEWTON_TOLERANCE:
            return _Reached(state, energy, model.lower, iteration, evaluations, converged=True)
        step, promised = model.least()
        share = 1.0
        for _ in range(_HALVINGS):
            trial = problem.state(state.p + share * step)
            trial_energy, trial_gradient = problem.energy_and_gradient_at(trial)
            evaluations += 1
            if trial_energy <= energy - _COMES_TRUE * share * promised:
                break
            share *= 0.5
        else:
            return _Reached(state, energy, model.lower, iteration, evaluations)
        state, energy, gradient = trial, trial_energy, trial_gradient
        if not goes_on(state.p):
            return _Reached(state, energy, model.lower, iteration + 1, evaluations, stopped=True)
        if model.slope_of(gradient) <= (_NEWTON_TOLERANCE if iteration < _FAST_STEPS else SLOPE_TOLERANCE):
            return _Reached(state, energy, model.lower, iteration + 1, evaluations, converged=True)
        model = BoundedModel(problem, state, gradient)
    return _Reached(state, energy, model.lower, _NEWTON_STEPS, evaluations)


def _lbfgs(problem: PoseProblem, begun: _Reached, goes_on: Callable[[Array], bool]) -> _Reached:
    """Return where L-BFGS leads from what is ``begun``."""
    from scipy.optimize import minimize

    start, lower = begun.state.p, begun.lower

    def to_coefficients(scaled: Array) -> Array:
        return start + solved_by_root(lower, scaled, transposed=True)

    def scaled_energy(scaled: Array) -> tuple[float, Array]:
        energy, gradient = problem.energy_and_gradient(to_coefficients(scaled))
        return energy, solved_by_root(lower, gradient)

    def after_iteration(scaled: Array) -> None:
        if not goes_on(to_coefficients(scaled)):
            raise StopIteration

    result = minimize(
        scaled_energy,
        np.zeros_like(start),
        jac=True,
        method="L-BFGS-B",
        callback=after_iteration,
        options={
            "maxiter": _MAX_ITERATIONS,
            "gtol": SLOPE_TOLERANCE,
            "ftol": RELATIVE_TOLERANCE,
            "maxcor": 20,
        },
    )
    return _Reached(
        problem.state(to_coefficients(result.x)),
        float(result.fun),
        lower,
        begun.iterations + int(result.nit),
        begun.evaluations + int(result.nfev),
        converged=bool(result.success),
    )
