"""Opt-blend: optimised weights of all examples of the database (Zhang et al. 2004)."""

from collections.abc import Sequence

import numpy as np
from scipy.optimize import minimize

from faceposer.evaluation.methods.examples import Examples
from faceposer.evaluation.methods.method import Array, ModelMethod, Parameters
from faceposer.evaluation.setting import StudyContext
from faceposer.solve.constraints.registry import Constraint
from faceposer.solve.problem import PoseProblem


class OptBlend(ModelMethod):
    """Blend of all examples with non-negative weights.

    Added to the energy of the constraints are ``sum_penalty`` * (sum of weights - 1)^2, which keeps the blend within
    the span of the examples, and ``ridge`` * n * sum of squared weights, which is least for equal weights. The neutral
    face is one of the examples, so that the start is a blend as well.
    """

    name = "opt-blend"
    title = "Optimisation of a blend of all examples (Opt-blend)"
    parameters = {"examples": 2000, "augmented": True, "ridge": 0.1, "sum_penalty": 30.0, "iterations": 60}
    grid = {
        "augmented": (False, True),
        "ridge": (1e-3, 1e-2, 3e-2, 1e-1, 3e-1, 1.0, 10.0),
        "examples": (500, 1000, 2000, 4000, 12000),
        "sum_penalty": (1.0, 10.0, 30.0, 100.0, 1e3, 1e4),
        "iterations": (15, 30, 60, 120, 240),
    }
    natural_ends = {"examples": (12000,)}

    def __init__(self, setting: StudyContext, parameters: Parameters) -> None:
        """Load the examples of ``setting``."""
        examples = Examples(setting, parameters["augmented"], parameters["examples"])
        self.model = examples.model
        self._coefficients = np.concatenate([np.zeros((1, self.model.n_coefficients)), examples.coefficients])
        self._ridge = parameters["ridge"] * len(self._coefficients)
        self._penalty, self._iterations = parameters["sum_penalty"], parameters["iterations"]

    def solve(self, constraints: Sequence[Constraint]) -> Array:
        """Return the coefficients, shape (r,), of the best blend."""
        problem = PoseProblem(self.model, constraints, bare=True)
        rows = self._coefficients

        def energy(weights: Array) -> tuple[float, Array]:
            value, gradient = problem.energy_and_gradient(weights @ rows)
            excess = weights.sum() - 1.0
            value += self._penalty * excess**2 + self._ridge * float(weights @ weights)
            return value, rows @ gradient + 2.0 * self._penalty * excess + 2.0 * self._ridge * weights

        start = np.full(len(rows), 1.0 / len(rows))
        result = minimize(
            energy,
            start,
            jac=True,
            method="L-BFGS-B",
            bounds=[(0.0, None)] * len(rows),
            options={"maxiter": self._iterations, "ftol": 1e-6},
        )
        blend: Array = result.x @ rows
        return blend
