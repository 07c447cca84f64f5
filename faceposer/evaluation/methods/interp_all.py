"""Interp-all: a blend of all examples, weighted by their fit to the constraints (Parke 1972; Sloan et al. 2001)."""

from collections.abc import Sequence

import numpy as np

from faceposer.evaluation.methods.examples import Examples
from faceposer.evaluation.methods.method import Array, ModelMethod, Parameters
from faceposer.evaluation.setting import StudyContext
from faceposer.solve.constraints.registry import Constraint


class InterpAll(ModelMethod):
    """Mean of all examples with the weights exp(-energy / temperature)."""

    name = "interp-all"
    title = "Interpolation of all examples (Interp-all)"
    parameters = {"temperature": 4.0, "augmented": True}
    grid = {"augmented": (False, True), "temperature": (0.5, 1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0)}

    def __init__(self, setting: StudyContext, parameters: Parameters) -> None:
        """Load the examples of ``setting``."""
        self._examples = Examples(setting, parameters["augmented"])
        self.model = self._examples.model
        self._temperature = parameters["temperature"]

    def solve(self, constraints: Sequence[Constraint]) -> Array:
        """Return the coefficients, shape (r,), of the blend."""
        energies = self._examples.energies(constraints)
        weights = np.exp(-(energies - energies.min()) / self._temperature)
        blend: Array = weights @ self._examples.coefficients / weights.sum()
        return blend
