"""Coverage: the extent of the face that constraints determine, from a local part to a whole expression."""

import numpy as np

from faceposer.model.face_model import FaceModel
from faceposer.sized_cache import weak_cache
from faceposer.solve.priors import prior_at
from faceposer.solve.term import Array

# Ends of the smooth steps from a part to the whole face: explained share of the skin's variance, and number of
# determined directions of the pose. Both mouth corners explain less than the first share; a jaw explains more, but
# determines one direction only.
_EXPLAINED = (0.25, 0.45)
_DETERMINED = (2.5, 3.5)


def coverage(model: FaceModel, start: Array, rows: Array) -> float:
    """Return the coverage of the face by constraints, from 0 (a part) to 1 (the whole face).

    With S = R R^T the prior covariance about ``start`` (``LocalMoments.usual``), A = J R and K = (I + A^T A)^-1 A^T A,
    constraints determine n = tr K directions and explain the share
    k = sum_v a_v tr(X_v R K R^T X_v^T) / tr(X_v S X_v^T) of the variance of the skin samples v (``MotionSamples``). The
    result is the product of two smooth steps, of n and of k. It is independent of the constraints' targets, and
    continuous in their points and weights.

    Args:
        model: The face.
        start: The pose of the untouched face, shape (r,).
        rows: J: derivatives of the constraints' residuals with respect to the coefficients, each divided by its
            standard deviation, shape (m, r).
    """
    if not len(rows):
        return 0.0
    root, shares = _usual(model, start.tobytes())
    seen = rows @ root
    curvature = seen.T @ seen
    determined = np.linalg.solve(curvature + np.eye(len(curvature)), curvature)
    directions, explained = float(np.trace(determined)), float((determined * shares).sum())
    return _step(directions, *_DETERMINED) * _step(explained, *_EXPLAINED)


@weak_cache(8)
def _usual(model: FaceModel, start_bytes: bytes) -> tuple[Array, Array]:
    """Return R, (r, r), and sum_v a_v R^T X_v^T X_v R / tr(X_v S X_v^T), (r, r)."""
    precision = prior_at(model, np.frombuffer(start_bytes)).usual().precisions[0]
    root = np.linalg.inv(np.linalg.cholesky(precision)).T
    samples = model.motion_samples
    moves = samples.rows @ root
    variances = np.einsum("nr,nr->n", moves, moves).reshape(-1, 3).sum(axis=1)
    scale = np.sqrt(samples.areas / np.maximum(variances, 1e-6 * variances.max(initial=1e-12)))
    scaled = moves * np.repeat(scale, 3)[:, None]
    return root, scaled.T @ scaled


def _step(value: float, first: float, last: float) -> float:
    t = min(max((value - first) / (last - first), 0.0), 1.0)
    return t * t * (3.0 - 2.0 * t)
