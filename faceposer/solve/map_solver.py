"""Minimises the energy of a pose by L-BFGS (Lau et al. 2009, section 6)."""

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy import linalg

from faceposer.solve.problem import PoseProblem
from faceposer.solve.term import Array

# In scaled coordinates a step of length 1 changes the energy by about 1, one standard deviation: this much slope
# is a hundredth of a deviation, far less than a pixel.
SLOPE_TOLERANCE = 1e-2
RELATIVE_TOLERANCE = 1e-7
_MAX_ITERATIONS = 100
# Energies that differ by less are equal.
_ROUNDING = 1e-9


@dataclass(frozen=True, eq=False)
class Solution:
    """A pose and how it was found.

    Attributes:
        coefficients: Shape (r,).
        energy: E at the coefficients.
        iterations: Iterations of L-BFGS.
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


def _square_root(curvature: Array) -> Array:
    """Return lower triangular L with L L^T about ``curvature``, (r, r).

    Seen from very near, constraints outweigh the prior by more digits than a number has; a faint diagonal then makes up
    for what rounding takes away. It changes the scale of the problem, not its solution.
    """
    diagonal = np.eye(len(curvature)) * float(np.trace(curvature)) / len(curvature)
    for jitter in (0.0, 1e-12, 1e-9, 1e-6):
        try:
            return np.asarray(np.linalg.cholesky(curvature + jitter * diagonal), dtype=np.float64)
        except np.linalg.LinAlgError:
            continue
    return np.sqrt(np.diag(np.diag(curvature)) + 1e-3 * diagonal)


def solve(
    problem: PoseProblem,
    x0: ArrayLike | None = None,
    on_iterate: Callable[[Array], None] | None = None,
    should_stop: Callable[[], bool] | None = None,
) -> Solution:
    """Return the pose of least energy near ``x0``.

    L-BFGS runs in coordinates scaled by the curvature at the start: there the problem is nearly round, and few
    evaluations do what takes dozens in coefficients, whose curvatures differ by orders of magnitude.

    Args:
        problem: The energy.
        x0: Coefficients to start from, shape (r,); the best of ``best_start`` if None.
        on_iterate: Called with the coefficients after each iteration.
        should_stop: Asked after each iteration; the pose reached so far is returned when it says yes.
    """
    from scipy.optimize import minimize

    began = time.perf_counter()
    evaluations = 0
    if problem.at_rest:
        start = problem.start
    elif x0 is None:
        start, evaluations = best_start(problem)
    else:
        start = np.array(x0, dtype=np.float64)
    lower = _square_root(problem.curvature(start))

    def to_coefficients(scaled: Array) -> Array:
        offset: Array = linalg.solve_triangular(lower, scaled, lower=True, trans=1, check_finite=False)
        return start + offset

    def scaled_energy(scaled: Array) -> tuple[float, Array]:
        energy, gradient = problem.energy_and_gradient(to_coefficients(scaled))
        return energy, linalg.solve_triangular(lower, gradient, lower=True, check_finite=False)

    def after_iteration(scaled: Array) -> None:
        if on_iterate is not None:
            on_iterate(to_coefficients(scaled))
        if should_stop is not None and should_stop():
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
    coefficients = to_coefficients(result.x)
    return Solution(
        coefficients,
        float(result.fun),
        int(result.nit),
        evaluations + int(result.nfev),
        time.perf_counter() - began,
        problem.residuals_px(coefficients),
        bool(result.success),
    )
