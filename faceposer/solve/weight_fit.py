"""Rig weights within their limits that come nearest to a pose."""

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import lsq_linear

from faceposer.model.face_model import FaceModel


def fit_weights(model: FaceModel, p: ArrayLike) -> dict[str, float]:
    """Return the weight of each shape by name, within its limits, whose sum comes nearest to the face ``p``, (r,).

    Nearest in the sum of squared vertex distances; shapes that move nothing get 0.
    """
    squared_lengths, axes = np.linalg.eigh(model.gram)
    moving = squared_lengths > 1e-9 * squared_lengths[-1]
    half = np.sqrt(squared_lengths[moving])[:, None] * axes[:, moving].T
    lower, upper = model.subject.shape_limits.T.astype(np.float64)
    # The solver needs room between the limits; where there is none, the shape keeps its only weight.
    result = lsq_linear(
        half, half @ model.weights_of(p), bounds=(lower, np.maximum(upper, lower + 1e-9)), method="bvls"
    )
    values = np.where(np.diag(model.gram) > 0, np.clip(result.x, lower, upper), 0.0)
    return dict(zip(model.subject.shape_names, values.tolist(), strict=True))
