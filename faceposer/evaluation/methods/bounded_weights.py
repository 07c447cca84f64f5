"""Bounded least squares on the rig's weights, which riggers call direct manipulation (Lewis and Anjyo 2010)."""

from collections.abc import Sequence

import numpy as np
from scipy.optimize import lsq_linear

from faceposer.evaluation.methods.method import Array, ModelMethod, Parameters
from faceposer.evaluation.setting import StudyContext
from faceposer.solve.constraints.registry import Constraint
from faceposer.solve.problem import PoseProblem
from faceposer.solve.term import ResidualTerm

_MOST_STEPS = 100
# A step that changes no weight by more than this is the last.
_CHANGES = 1e-3


class BoundedWeights(ModelMethod):
    """The rig weights within their limits that fit best, with a small ridge: Gauss-Newton steps of bounded problems.

    Steps end where none of the weights, which go from 0 to 1, changes by more than a thousandth. Points and distances
    need two or three; strokes, which are told to cover each other by nearest pixels, dozens.
    """

    name = "bounded-weights"
    title = "Bounded least squares on the rig's weights"
    parameters = {"ridge": 20.0}
    grid = {"ridge": (1.0, 3.0, 10.0, 14.0, 20.0, 30.0, 50.0, 100.0, 300.0)}

    def __init__(self, setting: StudyContext, parameters: Parameters) -> None:
        """Take the rig of the ``setting``'s face."""
        self.model = setting.full
        character = self.model.character
        projection = self.model.subspace.projection
        # A shape that moves nothing has nothing to fit.
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
        for _ in range(_MOST_STEPS):
            state = problem.state(self._to_coefficients @ weights)
            roots = [np.sqrt(term.weights) for term in terms]
            rows = np.concatenate(
                [root[:, None] * term.jacobian(state) for root, term in zip(roots, terms, strict=True)]
            )
            off = np.concatenate([root * term.residual(state) for root, term in zip(roots, terms, strict=True)])
            rows = rows @ self._to_coefficients
            if len(rows) > len(weights):
                # Only the products matter: a stroke's hundreds of rows are as good as so many as there are weights.
                orthogonal, rows_of = np.linalg.qr(rows)
                off, rows = orthogonal.T @ off, rows_of
            system = np.concatenate([rows, self._ridge])
            wanted = np.concatenate([rows @ weights - off, np.zeros(len(weights))])
            before, weights = weights, lsq_linear(system, wanted, bounds=(lower, upper), method="bvls").x
            if np.abs(weights - before).max() <= _CHANGES:
                break
        return self._to_coefficients @ weights
