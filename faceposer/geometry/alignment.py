"""Rotations, translations and scales that lay one set of points on another, in the least-squares sense."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

# Points whose extent across their longest direction is below this share of it lie on a line.
_ON_A_LINE = 1e-6


@dataclass(frozen=True, eq=False)
class Similarity:
    """A turn, a scale and a shift, y = scale · rotation x + translation, or a batch of them.

    Attributes:
        rotation: Proper rotations (determinant 1), shape (..., 3, 3).
        translation: Shape (..., 3).
        scale: Shape (...,); 1 for a rigid motion.
    """

    rotation: Array
    translation: Array
    scale: Array

    def apply(self, points: ArrayLike) -> Array:
        """Return ``points``, (..., M, 3), moved; one set is moved by each of a batch, and a batch one by one."""
        return self.apply_to_directions(points) + self.translation[..., None, :]

    def apply_to_directions(self, directions: ArrayLike) -> Array:
        """Return differences between points, (..., M, 3), turned and scaled but not shifted."""
        turned: Array = np.asarray(directions, dtype=np.float64) @ np.swapaxes(self.rotation, -1, -2)
        return self.scale[..., None, None] * turned

    def inverse(self) -> "Similarity":
        """Return what takes everything back."""
        rotation = np.swapaxes(self.rotation, -1, -2)
        scale = 1.0 / self.scale
        return Similarity(rotation, -scale[..., None] * (rotation @ self.translation[..., None])[..., 0], scale)


def determines_rotation(points: ArrayLike, weights: ArrayLike | None = None) -> NDArray[np.bool_]:
    """Return whether sets of ``points``, (..., M, 3), tell a rotation: three that are not on a line, shape (...,).

    Points without weight, or with a coordinate that is not finite, do not count.
    """
    given = np.asarray(points, dtype=np.float64)
    seen, counted = _seen(given, _as_weights(weights, given.shape[:-1]))
    centred = (seen - _centre(seen, counted)[..., None, :]) * np.sqrt(counted)[..., None]
    # The singular values of the points are the square roots of these; M x M and 3 x 3 have the same.
    extents = np.sqrt(np.maximum(np.linalg.eigvalsh(np.swapaxes(centred, -1, -2) @ centred), 0.0))
    told: NDArray[np.bool_] = extents[..., 1] > _ON_A_LINE * np.maximum(extents[..., 2], np.finfo(float).tiny)
    return told


def rigid_alignment(
    source: ArrayLike, target: ArrayLike, weights: ArrayLike | None = None, scale: bool = False
) -> Similarity:
    """Return the motion that takes ``source`` nearest to ``target``: the least Σ w ‖y - s R x - t‖².

    The closed form by a singular value decomposition, with the sign of the last singular vector chosen such that the
    result never mirrors (Kabsch 1976; Umeyama, "Least-squares estimation of transformation parameters between two point
    patterns", PAMI 13, 1991, eqs. 34-43).

    Args:
        source: Points, shape (..., M, 3); leading dimensions, as of ``target``, are a batch and broadcast.
        target: Where they should be, shape (..., M, 3), in the same order.
        weights: Of the points, shape (..., M), not negative; all count alike by default. Points with a coordinate that
            is not finite in either set have no weight, so that missing markers may be left as NaN.
        scale: Whether the size may change too.

    Raises:
        ValueError: If the shapes do not fit, a weight is negative or not finite, or in some set of the batch fewer than
            three points that are not on a line are left, so that no rotation is determined.
    """
    x, y = np.asarray(source, dtype=np.float64), np.asarray(target, dtype=np.float64)
    if x.ndim < 2 or x.shape[-1] != 3 or x.shape[-2:] != y.shape[-2:]:
        raise ValueError(f"source and target must both be (..., M, 3), not {x.shape} and {y.shape}")
    x, y = np.broadcast_arrays(x, y)
    x, w = _seen(x, _as_weights(weights, x.shape[:-1]))
    y, w = _seen(y, w)
    if not (determines_rotation(x, w) & determines_rotation(y, w)).all():
        raise ValueError("at least three points that are not on a line are needed to align two sets")

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


def _seen(points: Array, weights: Array) -> tuple[Array, Array]:
    """Return the points with zeros, and no weight, where a coordinate is not finite."""
    finite = np.asarray(np.isfinite(points).all(axis=-1))
    return np.where(finite[..., None], points, 0.0), np.where(finite, weights, 0.0)


def _centre(points: Array, weights: Array) -> Array:
    total = np.maximum(weights.sum(axis=-1, keepdims=True), np.finfo(float).tiny)
    return np.einsum("...m,...mk->...k", weights, points) / total
