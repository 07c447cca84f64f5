"""Linear fit by eos, a library of morphable models (Huber et al. 2016), to the same points.

eos has an affine camera, landmarks at vertices and a single Gaussian over principal components. It is given the basis,
variances and mean of ``ppca``. Its camera is the affine map closest to ours over all vertices that any shape moves, on
the neutral face. Each landmark is shifted by the difference of the two cameras at its point of the neutral face, and by
the offset from the point to the closest vertex, so that a target at the point itself has no error, as with our camera.
"""

from collections.abc import Sequence
from typing import ClassVar

import numpy as np

from faceposer.evaluation.methods.gaussian import gaussian_model
from faceposer.evaluation.methods.handles import Handles, missing_package
from faceposer.evaluation.methods.method import Array, ModelMethod, Parameters
from faceposer.evaluation.setting import StudyContext
from faceposer.geometry.camera import Camera
from faceposer.solve.constraints.point import SIGMA_PX
from faceposer.solve.constraints.registry import Constraint


class EosPca(ModelMethod):
    """Minimum of |A c - y|^2 / sigma^2 + lambda |c|^2, with c in standard deviations: one linear system, in C++.

    sigma is that of our points. The detector and model deviations of eos enter only by their sum, and only its product
    with lambda matters, which is tuned. Weights of constraints are ignored.
    """

    name = "eos"
    title = "Linear fit of a morphable model (eos)"
    kinds = ("point",)
    parameters = {"lambda": 0.5, "coefficients": 54, "augmented": True, "base": "mean"}
    grid = {
        "base": ("mean", "neutral"),
        "augmented": (False, True),
        "coefficients": (10, 20, 54),
        "lambda": (0.06, 0.125, 0.25, 0.5, 1.0, 2.0, 4.0, 8.0),
    }
    # No shipped character has more shapes.
    natural_ends = {"coefficients": (54,)}
    requires: ClassVar[str | None] = "eos"

    def __init__(self, setting: StudyContext, parameters: Parameters) -> None:
        """Create the PCA model of eos from the basis.

        Raises:
            FacePoserError: If eos is not installed.
        """
        try:
            import eos
        except ImportError as error:
            raise missing_package(self.name, "eos-py") from error
        self.model = gaussian_model(setting, parameters["augmented"], 1.0)
        character = setting.character
        self._mean = self.model.mixture.means[0] if parameters["base"] == "mean" else self.model.neutral()
        self._deviations = np.sqrt(self.model.subspace.variances)
        self._n = min(parameters["coefficients"], self.model.n_coefficients)
        self._lambda = float(parameters["lambda"])
        self._fit = eos.fitting.fit_shape_to_landmarks_linear
        self._pca = eos.morphablemodel.PcaModel(
            self.model.instance(self._mean).ravel(),
            np.asfortranarray(self.model.basis.T),
            self.model.subspace.variances.astype(np.float32),
            character.triangles.tolist(),
        )
        self._character = character
        self._moving = np.flatnonzero(np.abs(character.shapes).max(axis=(0, 2)) > 0)
        self._affine = (setting.camera, self._nearest_affine(setting.camera))

    def _nearest_affine(self, camera: Camera) -> Array:
        """Return the affine approximation of ``camera``, shape (3, 4): homogeneous points to pixels, v down."""
        points = self._character.vertices[self._moving].astype(np.float64)
        homogeneous = np.column_stack([points, np.ones(len(points))])
        rows = np.linalg.lstsq(homogeneous, camera.project(points), rcond=None)[0].T
        return np.concatenate([rows, [[0.0, 0.0, 0.0, 1.0]]])

    def solve(self, constraints: Sequence[Constraint]) -> Array:
        """Return the coefficients, shape (r,), fitted by eos."""
        handles = Handles.of(self._character, constraints)
        if self._affine[0] != handles.camera:
            self._affine = (handles.camera, self._nearest_affine(handles.camera))
        affine = self._affine[1]
        neutral = self._character.vertices[handles.vertices] @ affine[:2, :3].T + affine[:2, 3]
        landmarks = neutral + handles.targets - handles.camera.project(handles.places)
        fitted = self._fit(
            self._pca,
            affine.astype(np.float32),
            list(landmarks.astype(np.float32)),
            handles.vertices.tolist(),
            num_coefficients_to_fit=self._n,
            detector_standard_deviation=SIGMA_PX,
            model_standard_deviation=0.0,
            **{"lambda": self._lambda},
        )
        coefficients = self._mean.copy()
        coefficients[: self._n] += self._deviations[: self._n] * np.asarray(fitted)
        return coefficients
