"""Subspaces of the principal components that explain a given share of the variance."""

import numpy as np

from faceposer.evaluation.setting import StudyContext
from faceposer.model.expression_statistics import ExpressionStatistics
from faceposer.model.face_model import FaceModel, build_face_model


def model_with_energy(setting: StudyContext, statistics: ExpressionStatistics, energy: float) -> FaceModel:
    """Return the face with the density ``statistics``, in its first principal components of plain squared distance.

    Args:
        setting: Setting with the face.
        statistics: Moments and density of the weights of ``ARKIT_SHAPES``.
        energy: Share of the variance that the components explain at least; 1 for all of them.
    """
    full = build_face_model(setting.character, statistics, len(setting.character.shape_names), "plain")
    shares = np.cumsum(full.subspace.variances) / full.subspace.variances.sum()
    n = min(int(np.searchsorted(shares, energy)) + 1, full.n_coefficients)
    return full if n == full.n_coefficients else build_face_model(setting.character, statistics, n, "plain")
