"""Rig weights between 0 and 1 that come nearest to a pose."""

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import lsq_linear

from faceposer.model.face_model import FaceModel


def fit_weights(model: FaceModel, p: ArrayLike) -> dict[str, float]:
    """Return the value of each shape, 0 to 1, whose sum comes nearest to the face ``p`` of shape (r,), by shape name.

    Nearest in the sum of squared vertex distances; shapes that move nothing get 0.
    """
    squared_lengths, axes = np.linalg.eigh(model.gram)
    moving = squared_lengths > 1e-9 * squared_lengths[-1]
    half = np.sqrt(squared_lengths[moving])[:, None] * axes[:, moving].T
    result = lsq_linear(half, half @ model.weights_of(p), bounds=(0.0, 1.0), method="bvls")
    values = np.where(np.diag(model.gram) > 0, np.clip(result.x, 0.0, 1.0), 0.0)
    return dict(zip(model.subject.shape_names, values.tolist(), strict=True))
