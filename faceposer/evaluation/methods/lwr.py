"""Locally weighted regression on the examples nearest to the constraints (LWR; Chai et al. 2003)."""

from collections.abc import Sequence

import numpy as np

from faceposer.evaluation.methods.examples import Examples
from faceposer.evaluation.methods.method import Array, ModelMethod, Parameters
from faceposer.evaluation.setting import StudyContext
from faceposer.model.mixture import GaussianMixture
from faceposer.solve.constraints.registry import Constraint
from faceposer.solve.map_solver import solve
from faceposer.solve.problem import PoseProblem


class Lwr(ModelMethod):
    """Linear regression of the pose on the constraints' values, from the k nearest examples, weighted by distance.

    Linear regression with the target noise as its ridge is the mean of the pose conditioned on the constraints, under
    the weighted mean and covariance of the examples. In this form it also works for strokes, which have no fixed vector
    of values, and handles perspective by the same solver as the other methods. The weight of an example is tricubic in
    its root energy relative to that of the k-th (Cleveland 1979).
    """

    name = "lwr"
    title = "Locally weighted regression (LWR)"
    parameters = {"neighbours": 2000, "augmented": True, "prior_weight": 1.0, "ridge": 1e-4}
    grid = {
        "augmented": (False, True),
        "neighbours": (100, 300, 1000, 2000, 4000, 8000, 12000),
        "prior_weight": (0.25, 0.5, 1.0, 2.0, 4.0, 8.0),
        "ridge": (1e-5, 1e-4, 3e-4, 1e-3, 3e-3, 1e-2, 3e-2),
    }
    natural_ends = {"neighbours": (12000,)}

    def __init__(self, setting: StudyContext, parameters: Parameters) -> None:
        """Load the examples of ``setting``."""
        self._examples = Examples(setting, parameters["augmented"])
        self.model = self._examples.model
        self._neighbours = parameters["neighbours"]
        self._weight = parameters["prior_weight"]
        # The ridge applies to the rig's weights, whose unit does not depend on the mesh.
        projection = self.model.subspace.projection
        self._ridge = parameters["ridge"] * projection @ projection.T

    def solve(self, constraints: Sequence[Constraint]) -> Array:
        """Return the coefficients, shape (r,), of the regression."""
        energies = self._examples.energies(constraints)
        k = min(self._neighbours, len(energies) - 1)
        order = np.argpartition(energies, k)[: k + 1]
        near = np.sqrt(energies[order] / max(energies[order].max(), 1e-12))
        weights = np.maximum(1.0 - near**3, 0.0) ** 3 + 1e-9
        weights /= weights.sum()
        chosen = self._examples.coefficients[order]
        mean = weights @ chosen
        offsets = (chosen - mean) * np.sqrt(weights)[:, None]
        local = GaussianMixture(np.ones(1), mean[None], (offsets.T @ offsets + self._ridge)[None])
        problem = PoseProblem(self.model, constraints, prior_weight=self._weight, mixture=local)
        return solve(problem).coefficients
