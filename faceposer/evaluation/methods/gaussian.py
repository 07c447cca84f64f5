"""Optimisation in the subspace of principal components, without a prior (PCA) or with a Gaussian prior (PPCA)."""

from collections.abc import Sequence

from faceposer.evaluation.methods.method import Array, ModelMethod, Parameters
from faceposer.evaluation.methods.subspace import model_with_energy
from faceposer.evaluation.setting import StudyContext
from faceposer.model.face_model import FaceModel
from faceposer.solve.constraints.registry import Constraint
from faceposer.solve.map_solver import solve
from faceposer.solve.problem import PoseProblem


def gaussian_model(setting: StudyContext, augmented: bool, energy: float) -> FaceModel:
    """Return the face with a Gaussian over the principal components that explain the share ``energy`` of variance."""
    return model_with_energy(setting, setting.plain(setting.examples if augmented else setting.frames), energy)


class Ppca(ModelMethod):
    """MAP optimisation with a Gaussian prior over the subspace."""

    name = "ppca"
    title = "PCA with one Gaussian (PPCA)"
    parameters = {"prior_weight": 1.0, "augmented": True, "energy": 1.0}
    grid = {
        "augmented": (False, True),
        "energy": (0.95, 0.98, 0.99, 0.999, 1.0),
        "prior_weight": (0.25, 0.5, 1.0, 2.0, 4.0, 8.0),
    }
    natural_ends = {"energy": (1.0,)}

    def __init__(self, setting: StudyContext, parameters: Parameters) -> None:
        """Learn the subspace from the captures of the ``setting``."""
        self.model = gaussian_model(setting, parameters["augmented"], parameters["energy"])
        self._weight = parameters["prior_weight"]

    def solve(self, constraints: Sequence[Constraint]) -> Array:
        """Return the coefficients, shape (r,), of the most probable face."""
        problem = PoseProblem(self.model, constraints, prior_weight=self._weight, mixture=self.model.mixture)
        return solve(problem).coefficients


class Pca(ModelMethod):
    """Least squares without a prior; only the subspace constrains the face."""

    name = "pca"
    title = "PCA without a prior"
    parameters = {"augmented": False, "energy": 0.5}
    grid = {"augmented": (False, True), "energy": (0.5, 0.7, 0.8, 0.9, 0.95, 0.98, 0.99, 0.999, 1.0)}
    # The first component alone explains more than half.
    natural_ends = {"energy": (0.5, 1.0)}

    def __init__(self, setting: StudyContext, parameters: Parameters) -> None:
        """Learn the subspace from the captures of the ``setting``."""
        self.model = gaussian_model(setting, parameters["augmented"], parameters["energy"])

    def solve(self, constraints: Sequence[Constraint]) -> Array:
        """Return the coefficients, shape (r,), of the face that fits best."""
        return solve(PoseProblem(self.model, constraints, bare=True)).coefficients
