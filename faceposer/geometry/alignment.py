"""Least-squares alignment of point sets by rotation, translation and scale."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

# Points are collinear if their second extent is below this share of the largest.
_COLLINEAR = 1e-6


@dataclass(frozen=True, eq=False)
class Similarity:
    """A similarity transform y = scale · rotation x + translation, or a batch of them.

    Attributes:
        rotation: Proper rotations (determinant 1), shape (..., 3, 3).
        translation: Translations, shape (..., 3).
        scale: Scales, shape (...,); 1 for rigid motions.
    """

    rotation: Array
    translation: Array
    scale: Array

    def apply(self, points: ArrayLike) -> Array:
        """Return the transformed ``points``, (..., M, 3); batch dimensions broadcast."""
        return self.apply_to_directions(points) + self.translation[..., None, :]

    def apply_to_directions(self, directions: ArrayLike) -> Array:
        """Return the rotated and scaled ``directions``, (..., M, 3), without translation."""
        turned: Array = np.asarray(directions, dtype=np.float64) @ np.swapaxes(self.rotation, -1, -2)
        return self.scale[..., None, None] * turned

    def inverse(self) -> "Similarity":
        """Return the inverse transform."""
        rotation = np.swapaxes(self.rotation, -1, -2)
        scale = 1.0 / self.scale
        return Similarity(rotation, -scale[..., None] * (rotation @ self.translation[..., None])[..., 0], scale)


def determines_rotation(points: ArrayLike, weights: ArrayLike | None = None) -> NDArray[np.bool_]:
    """Test whether sets of ``points``, (..., M, 3), determine a rotation: three points that are not collinear.

    Points without weight, or with a coordinate that is not finite, are ignored.

    Returns:
        A mask of shape (...,).
    """
    given = np.asarray(points, dtype=np.float64)
    known, w = _without_missing(given, _as_weights(weights, given.shape[:-1]))
    centred = (known - _centre(known, w)[..., None, :]) * np.sqrt(w)[..., None]
    # The extents are singular values, from the eigenvalues of a 3 x 3 matrix.
    extents = np.sqrt(np.maximum(np.linalg.eigvalsh(np.swapaxes(centred, -1, -2) @ centred), 0.0))
    largest = np.maximum(extents[..., 2], np.finfo(float).tiny)
    determined: NDArray[np.bool_] = extents[..., 1] > _COLLINEAR * largest
    return determined


def rigid_alignment(
    source: ArrayLike, target: ArrayLike, weights: ArrayLike | None = None, scale: bool = False
) -> Similarity:
    """Return the transform of ``source`` that minimises Σ w ‖y - s R x - t‖² to ``target``.

    The closed-form solution by singular value decomposition, with the sign of the last singular vector chosen to
    exclude reflections (Kabsch 1976; Umeyama, "Least-squares estimation of transformation parameters between two point
    patterns", PAMI 13, 1991, eqs. 34-43).

    Args:
        source: Points x, shape (..., M, 3); leading dimensions, also of ``target``, are batches and broadcast.
        target: Corresponding points y, shape (..., M, 3).
        weights: Nonnegative weights w of the points, shape (..., M); equal by default. Points with a coordinate that is
            not finite in either set get no weight, so that missing markers may be NaN.
        scale: True to estimate the scale s; otherwise it is 1.

    Raises:
        ValueError: If the shapes do not match, a weight is negative or not finite, or a set of the batch does not have
            three points that are not collinear, so that the rotation is undetermined.
    """
    x, y = np.asarray(source, dtype=np.float64), np.asarray(target, dtype=np.float64)
    if x.ndim < 2 or x.shape[-1] != 3 or x.shape[-2:] != y.shape[-2:]:
        raise ValueError(f"source and target must both be (..., M, 3), not {x.shape} and {y.shape}")
    x, y = np.broadcast_arrays(x, y)
    x, w = _without_missing(x, _as_weights(weights, x.shape[:-1]))
    y, w = _without_missing(y, w)
    if not (determines_rotation(x, w) & determines_rotation(y, w)).all():
        raise ValueError("aligning two sets requires at least three points that are not on a line")

    w = w / w.sum(axis=-1, keepdims=True)
    x_centre, y_centre = _centre(x, w), _centre(y, w)
    centred = x - x_centre[..., None, :]
    covariance = np.swapaxes((y - y_centre[..., None, :]) * w[..., None], -1, -2) @ centred
    u, singular, vt = np.linalg.svd(covariance)
    signs = np.ones_like(singular)
    signs[..., 2] = np.where(np.linalg.det(u) * np.linalg.det(vt) < 0.0, -1.0, 1.0)
    rotation = (u * signs[..., None, :]) @ vt
    scales = np.ones(singular.shape[:-1])
    if scale:
        variance = np.einsum("...m,...mk->...", w, centred * centred)
        scales = (singular * signs).sum(axis=-1) / variance
    translation = y_centre - scales[..., None] * (rotation @ x_centre[..., None])[..., 0]
    return Similarity(rotation, translation, scales)


def _as_weights(weights: ArrayLike | None, shape: tuple[int, ...]) -> Array:
    given = np.ones(1) if weights is None else np.asarray(weights, dtype=np.float64)
    if not np.isfinite(given).all() or (given < 0.0).any():
        raise ValueError("weights must be finite and not negative")
    return np.broadcast_to(given, np.broadcast_shapes(given.shape, shape))


def _without_missing(points: Array, weights: Array) -> tuple[Array, Array]:
    """Return points and weights, both 0 for points with a coordinate that is not finite."""
    finite = np.asarray(np.isfinite(points).all(axis=-1))
    return np.where(finite[..., None], points, 0.0), np.where(finite, weights, 0.0)


def _centre(points: Array, weights: Array) -> Array:
    total = np.maximum(weights.sum(axis=-1, keepdims=True), np.finfo(float).tiny)
    return np.einsum("...m,...mk->...k", weights, points) / total
