"""Values of pictures, extended smoothly to where they are not known."""

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import ndimage

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]


def smooth_step(values: ArrayLike, limits: tuple[float, float]) -> Array:
    """Return 0 below the first of ``limits``, 1 above the second, and smooth values between, as ``values``."""
    t = np.clip((np.asarray(values) - limits[0]) / (limits[1] - limits[0]), 0.0, 1.0)
    result: Array = t * t * (3.0 - 2.0 * t)
    return result


def extended(image: Array, known: Mask) -> Array:
    """Return ``image``, (h, w, k), with smooth values where none is ``known``, by averages at growing scales.

    Known pixels keep theirs (S. Gortler and others, "The lumigraph", SIGGRAPH 1996, section 3.4: pull and push).
    """
    if known.all() or not known.any():
        return image if known.all() else np.zeros_like(image)
    weight = known.astype(np.float64)[..., None]
    small, share = _halved(image * weight), _halved(weight)
    full = share[..., 0] > 0.0
    averages = small / np.maximum(share, 1e-12)
    coarse = extended(averages, full) if min(full.shape) > 1 else np.where(full[..., None], averages, 0.0)
    large = _enlarged(coarse, (image.shape[0] / coarse.shape[0], image.shape[1] / coarse.shape[1]))
    result: Array = np.where(known[..., None], image, large[: image.shape[0], : image.shape[1]])
    return result


def blurred(image: Array, weight: Array, width: float) -> tuple[Array, Array]:
    """Return the means of ``image``, (h, w, k), under Gaussians of a ``width`` in pixels, and their ``weight``, (h, w).

    Pixels count by ``weight``.
    """
    total = ndimage.gaussian_filter(weight, width)
    sums = ndimage.gaussian_filter(image * weight[..., None], (width, width, 0.0))
    return sums / np.maximum(total, 1e-9)[..., None], total


def _halved(image: Array) -> Array:
    """Return the means of 2 x 2 pixels of ``image``, (h, w, k), whose odd ends are repeated."""
    height, width = image.shape[:2]
    padded = np.pad(image, ((0, height % 2), (0, width % 2), (0, 0)), mode="edge")
    result: Array = 0.25 * (padded[::2, ::2] + padded[1::2, ::2] + padded[::2, 1::2] + padded[1::2, 1::2])
    return result


def _enlarged(image: Array, factors: tuple[float, float]) -> Array:
    """Return ``image``, (h, w) or (h, w, k), linearly enlarged."""
    if factors == (1.0, 1.0):
        return image
    more = (1.0,) * (image.ndim - 2)
    result: Array = ndimage.zoom(image, (*factors, *more), order=1, mode="nearest", grid_mode=True)
    return result
