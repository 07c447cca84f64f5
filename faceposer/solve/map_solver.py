"""Minimisation of the energy of a pose by Gauss-Newton, with L-BFGS as the fallback (Lau et al. 2009, section 6)."""

import math
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from faceposer.errors import FacePoserError
from faceposer.solve.bounded_model import BoundedModel
from faceposer.solve.definite import solve_triangular
from faceposer.solve.problem import PoseProblem
from faceposer.solve.term import Array, PoseState

# In scaled coordinates a step of length 1 changes the energy by about 1, one standard deviation. This slope corresponds
# to a hundredth of a deviation, far less than a pixel.
SLOPE_TOLERANCE = 1e-2
RELATIVE_TOLERANCE = 1e-7
_MAX_ITERATIONS = 100
# Largest number of Gauss-Newton steps and of trial lengths per step, and the share of the promised decrease required.
_NEWTON_STEPS, _HALVINGS, _SUFFICIENT_DECREASE = 30, 6, 0.05
# Most problems converge so fast in the first steps that a tenth of the tolerance costs nothing; with strokes, later
# steps gain less each.
_NEWTON_TOLERANCE, _FAST_STEPS = 0.1 * SLOPE_TOLERANCE, 3
# Largest coefficient of a pose; session files have no larger ones. A face has coefficients of a few units.
_LARGEST = 1e6
# Energies that differ by less are equal.
_ROUNDING = 1e-9


@dataclass(frozen=True, eq=False)
class Solution:
    """A solved pose with the statistics of the solve.

    Attributes:
        coefficients: Shape (r,).
        energy: E at the coefficients.
        iterations: Number of Gauss-Newton steps and L-BFGS iterations.
        evaluations: Number of evaluations of E and its gradient, including those that compare starts.
        seconds: Wall-clock time of the solve.
        residuals_px: Residual of each constraint in pixels, in the order of the problem.
        converged: True if the solve met its tolerance, False if it was stopped or reached its iteration limit.
    """

    coefficients: Array
    energy: float
    iterations: int
    evaluations: int
    seconds: float
    residuals_px: tuple[float, ...]
    converged: bool


class SolveError(FacePoserError):
    """The constraints have no solution within the range of floating-point numbers."""

    def __init__(self) -> None:
        super().__init__(
            "The constraints cannot be solved, since their numbers are too large or their cameras too near; move the "
            "targets nearer to the face, or lower the weights."
        )


@contextmanager
def numeric_errors() -> Iterator[None]:
    """Report failures of linear algebra as ``SolveError``; values that are not finite are detected in the result."""
    try:
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            yield
    except (np.linalg.LinAlgError, FloatingPointError, OverflowError) as error:
        raise SolveError from error


def prepare() -> None:
    """Import the modules that a solve needs. A window does so after its first frame, to start faster."""
    import scipy.ndimage
    import scipy.optimize
    import scipy.spatial  # noqa: F401


def best_start(problem: PoseProblem) -> tuple[Array, int]:
    """Return the start of least energy, and the number of starts compared.

    The paper starts at the best component mean (eq. (21)). Here the mean of each component is first conditioned on the
    constraints, linearised at the start pose: this costs one linear solve per component and is much closer.
    """
    candidates = [problem.start, *problem.conditional_means()]
    energies = [problem.energy_and_gradient(candidate)[0] for candidate in candidates]
    # Prefer the given start if it is as good as any up to rounding.
    best = 0 if energies[0] <= min(energies) + _ROUNDING else int(np.argmin(energies))
    return candidates[best], len(candidates)


def solve(
    problem: PoseProblem,
    x0: ArrayLike | None = None,
    on_iterate: Callable[[Array], None] | None = None,
    should_stop: Callable[[], bool] | None = None,
) -> Solution:
    """Return a local minimum of the energy near ``x0``.

    The energy consists of quadratic forms, squares of nearly linear residuals, and bounds. A few Gauss-Newton steps
    with backtracking find its minimum. Where they fail, as strokes may cause when nearest neighbours change, L-BFGS
    continues in coordinates scaled by the curvature. There the problem is nearly isotropic, and a few evaluations
    replace the dozens needed in coefficients with curvatures of different orders of magnitude.

    Args:
        problem: The energy.
        x0: Coefficients to start from, shape (r,); the result of ``best_start`` if None.
        on_iterate: Called with the coefficients after each iteration.
        should_stop: Called after each iteration; if it returns True, the solve ends with the current pose.

    Raises:
        SolveError: If the pose or its energy is not finite.
    """
    with numeric_errors():
        solution = _solve(problem, x0, on_iterate, should_stop)
    pose = solution.coefficients
    # Comparisons with NaN are False.
    if not np.abs(pose).max(initial=0.0) <= _LARGEST or not all(
        map(math.isfinite, (solution.energy, *solution.residuals_px))
    ):
        raise SolveError
    return solution


def _solve(
    problem: PoseProblem,
    x0: ArrayLike | None,
    on_iterate: Callable[[Array], None] | None,
    should_stop: Callable[[], bool] | None,
) -> Solution:
    began = time.perf_counter()
    compared = 0
    if problem.at_rest:
        start = problem.start
    elif x0 is None:
        start, compared = best_start(problem)
    else:
        start = np.array(x0, dtype=np.float64)

    def keep_going(pose: Array) -> bool:
        if on_iterate is not None:
            on_iterate(pose)
        return should_stop is None or not should_stop()

    reached = _newton(problem, start, keep_going)
    if not (reached.converged or reached.stopped):
        reached = _lbfgs(problem, reached, keep_going)
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
class _Iterate:
    """Current state of a solve.

    Attributes:
        state: The best pose so far.
        energy: E at the pose.
        lower: L with L L^T approximately the curvature at the pose, shape (r, r).
        iterations: Number of iterations so far.
        evaluations: Number of evaluations of E and its gradient so far.
        converged: True if the pose is a minimum within the tolerance.
        stopped: True if the caller stopped the solve.
    """

    state: PoseState
    energy: float
    lower: Array
    iterations: int
    evaluations: int
    converged: bool = False
    stopped: bool = False


def _newton(problem: PoseProblem, start: Array, keep_going: Callable[[Array], bool]) -> _Iterate:
    """Take Gauss-Newton steps from ``start``, shape (r,)."""
    state = problem.state(start)
    energy, gradient = problem.energy_and_gradient_at(state)
    model = BoundedModel(problem, state, gradient)
    evaluations = 1
    for iteration in range(_NEWTON_STEPS):
        if model.slope <= _NEWTON_TOLERANCE:
            return _Iterate(state, energy, model.lower, iteration, evaluations, converged=True)
        step, promised = model.minimise()
        share = 1.0
        for _ in range(_HALVINGS):
            trial = problem.state(state.p + share * step)
            trial_energy, trial_gradient = problem.energy_and_gradient_at(trial)
            evaluations += 1
            if trial_energy <= energy - _SUFFICIENT_DECREASE * share * promised:
                break
            share *= 0.5
        else:
            return _Iterate(state, energy, model.lower, iteration, evaluations)
        state, energy, gradient = trial, trial_energy, trial_gradient
        if not keep_going(state.p):
            return _Iterate(state, energy, model.lower, iteration + 1, evaluations, stopped=True)
        if model.scaled_slope(gradient) <= (_NEWTON_TOLERANCE if iteration < _FAST_STEPS else SLOPE_TOLERANCE):
            return _Iterate(state, energy, model.lower, iteration + 1, evaluations, converged=True)
        model = BoundedModel(problem, state, gradient)
    return _Iterate(state, energy, model.lower, _NEWTON_STEPS, evaluations)


def _lbfgs(problem: PoseProblem, reached: _Iterate, keep_going: Callable[[Array], bool]) -> _Iterate:
    """Continue by L-BFGS from the state ``reached``."""
    from scipy.optimize import minimize

    start, lower = reached.state.p, reached.lower

    def to_coefficients(scaled: Array) -> Array:
        return start + solve_triangular(lower, scaled, transposed=True)

    def scaled_energy(scaled: Array) -> tuple[float, Array]:
        energy, gradient = problem.energy_and_gradient(to_coefficients(scaled))
        return energy, solve_triangular(lower, gradient)

    def after_iteration(scaled: Array) -> None:
        if not keep_going(to_coefficients(scaled)):
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
    return _Iterate(
        problem.state(to_coefficients(result.x)),
        float(result.fun),
        lower,
        reached.iterations + int(result.nit),
        reached.evaluations + int(result.nfev),
        converged=bool(result.success),
    )
