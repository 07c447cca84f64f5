"""Bounded least squares on the rig's weights, known as direct manipulation (Lewis and Anjyo 2010)."""

from collections.abc import Sequence

import numpy as np
from scipy.optimize import lsq_linear

from faceposer.evaluation.methods.method import Array, ModelMethod, Parameters
from faceposer.evaluation.setting import StudyContext
from faceposer.solve.constraints.registry import Constraint
from faceposer.solve.problem import PoseProblem
from faceposer.solve.term import ResidualTerm

_MAX_ITERATIONS = 100
# Largest change of a weight at convergence.
_TOLERANCE = 1e-3


class BoundedWeights(ModelMethod):
    """Best-fitting rig weights within their limits, with a small ridge, by Gauss-Newton steps of bounded problems.

    Iteration ends when no weight, in the range of 0 to 1, changes by more than a thousandth. Points and distances need
    two or three steps; strokes, which are matched by nearest pixels, dozens.
    """

    name = "bounded-weights"
    title = "Bounded least squares on the rig's weights"
    parameters = {"ridge": 20.0}
    grid = {"ridge": (1.0, 3.0, 10.0, 14.0, 20.0, 30.0, 50.0, 100.0, 300.0)}

    def __init__(self, setting: StudyContext, parameters: Parameters) -> None:
        """Prepare the rig of the face."""
        self.model = setting.full
        character = self.model.character
        projection = self.model.subspace.projection
        # Shapes that move nothing have no weight to fit.
        self._moving = np.flatnonzero(np.diag(self.model.gram) > 0)
        self._to_coefficients = projection[:, self._moving]
        self._limits = character.shape_limits[self._moving].T.astype(np.float64)
        self._ridge = np.sqrt(parameters["ridge"]) * np.eye(len(self._moving))

    def solve(self, constraints: Sequence[Constraint]) -> Array:
        """Return the coefficients, shape (r,), of the rig weights found."""
        problem = PoseProblem(self.model, constraints, bare=True)
        terms = [term for term in problem.terms if isinstance(term, ResidualTerm)]
        weights = np.zeros(len(self._moving))
        lower, upper = self._limits
        for _ in range(_MAX_ITERATIONS):
            state = problem.state(self._to_coefficients @ weights)
            roots = [np.sqrt(term.weights) for term in terms]
            rows = np.concatenate(
                [root[:, None] * term.jacobian(state) for root, term in zip(roots, terms, strict=True)]
            )
            residuals = np.concatenate([root * term.residual(state) for root, term in zip(roots, terms, strict=True)])
            rows = rows @ self._to_coefficients
            if len(rows) > len(weights):
                # A QR decomposition reduces the hundreds of rows of a stroke to as many as there are weights.
                q, r = np.linalg.qr(rows)
                residuals, rows = q.T @ residuals, r
            matrix = np.concatenate([rows, self._ridge])
            target = np.concatenate([rows @ weights - residuals, np.zeros(len(weights))])
            previous, weights = weights, lsq_linear(matrix, target, bounds=(lower, upper), method="bvls").x
            if np.abs(weights - previous).max() <= _TOLERANCE:
                break
        return self._to_coefficients @ weights
