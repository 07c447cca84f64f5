"""Mixtures of factor analyzers: the shipped prior, over regions or the whole face, and the paper's recipe."""

from collections.abc import Sequence
from typing import Any

from faceposer.evaluation.methods.method import Array, ModelMethod, Parameters
from faceposer.evaluation.methods.subspace import model_with_energy
from faceposer.evaluation.setting import StudyContext
from faceposer.solve.constraints.registry import Constraint
from faceposer.solve.map_solver import solve
from faceposer.solve.problem import PoseProblem

#: Arguments of ``PoseProblem`` for the shipped prior, by technique; none gives the defaults of a new session.
PRIOR_ARGUMENTS: dict[str, dict[str, Any]] = {
    "mfa": {},
    "mfa-whole": {"spread": 1.0},
    "mfa-undamped": {"prior": "whole"},
}


class ShippedMfa(ModelMethod):
    """The shipped method: the mixture conditioned on the start, near the constraints, with bounds on the weights."""

    name = "mfa"
    title = "Mixture of factor analyzers, as shipped"
    parameters = {"prior_weight": 1.0}
    grid = {"prior_weight": (0.25, 0.5, 1.0, 1.5, 2.0, 4.0)}

    def __init__(self, setting: StudyContext, parameters: Parameters) -> None:
        """Prepare the method for ``setting``."""
        self.model = setting.model
        self._weight = parameters["prior_weight"]

    def solve(self, constraints: Sequence[Constraint]) -> Array:
        """Return the coefficients, shape (r,), of the most probable face."""
        arguments = PRIOR_ARGUMENTS[self.name]
        return solve(PoseProblem(self.model, constraints, prior_weight=self._weight, **arguments)).coefficients


class WholeMfa(ShippedMfa):
    """The same with *Spread* at the whole face: the whole face follows a pull as it usually moves."""

    name = "mfa-whole"
    title = "The same, Spread at whole face"


class UndampedMfa(ShippedMfa):
    """The same with the prior *Whole face*: correlations between regions are not damped."""

    name = "mfa-undamped"
    title = "The same, regions not damped"


class PlainMfa(ModelMethod):
    """The paper's recipe (section 5): plain maximum likelihood, with the modes at those of the data."""

    name = "mfa-plain"
    title = "Mixture of factor analyzers by plain maximum likelihood (the paper)"
    parameters = {"prior_weight": 2.0, "augmented": True, "components": 30, "factors": 10, "energy": 0.99}
    grid = {
        "augmented": (False, True),
        "energy": (0.9, 0.95, 0.98, 0.99, 0.999, 1.0),
        "components": (3, 10, 30, 60, 120),
        "prior_weight": (0.25, 0.5, 1.0, 2.0, 4.0, 8.0),
    }
    natural_ends = {"energy": (1.0,)}

    def __init__(self, setting: StudyContext, parameters: Parameters) -> None:
        """Learn the mixture from the captures of ``setting``."""
        examples = setting.examples if parameters["augmented"] else setting.frames
        statistics = setting.by_likelihood(examples, parameters["components"], parameters["factors"])
        self.model = model_with_energy(setting, statistics, parameters["energy"])
        self._weight = parameters["prior_weight"]

    def solve(self, constraints: Sequence[Constraint]) -> Array:
        """Return the coefficients, shape (r,), of the most probable face."""
        problem = PoseProblem(self.model, constraints, prior_weight=self._weight, mixture=self.model.mixture)
        return solve(problem).coefficients
