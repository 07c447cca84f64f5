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


def extended(image: Array, known: Mask, cell: float = 1.0) -> Array:
    """Return ``image``, (h, w, k), with smooth values where none is ``known``, by averages at growing scales.

    Known pixels keep theirs (S. Gortler and others, "The lumigraph", SIGGRAPH 1996, section 3.4: pull and push). The
    finest averages are those of squares with a side of ``cell`` pixels, so that they are the same on all grids.
    """
    if known.all() or not known.any():
        return image if known.all() else np.zeros_like(image)
    size = [max(round(side / max(cell, 1.0)), 1) for side in known.shape]
    row, column = np.nonzero(known)
    index = row * size[0] // known.shape[0] * size[1] + column * size[1] // known.shape[1]
    number = np.bincount(index, minlength=size[0] * size[1])
    sums = [np.bincount(index, image[row, column, k], len(number)) for k in range(image.shape[2])]
    means = np.stack(sums, axis=1) / np.maximum(number, 1)[:, None]
    means = _pushed(means.reshape(*size, -1), (number > 0).reshape(size))
    result: Array = np.where(known[..., None], image, _enlarged(means, known.shape))
    return result


def _pushed(image: Array, known: Mask) -> Array:
    """Return ``image``, (h, w, k), with averages at growing scales where none is ``known``."""
    if known.all():
        return image
    weight = known.astype(np.float64)[..., None]
    small, share = _halved(image * weight), _halved(weight)
    full = share[..., 0] > 0.0
    averages = small / np.maximum(share, 1e-12)
    coarse = _pushed(averages, full) if min(full.shape) > 1 else np.where(full[..., None], averages, 0.0)
    even = (2 * coarse.shape[0], 2 * coarse.shape[1])
    result: Array = np.where(known[..., None], image, _enlarged(coarse, even)[: known.shape[0], : known.shape[1]])
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


def _enlarged(image: Array, size: tuple[int, ...]) -> Array:
    """Return ``image``, (h, w, k), linearly enlarged to ``size``."""
    if image.shape[:2] == size:
        return image
    for axis in range(2):
        places = np.clip(
            (np.arange(size[axis]) + 0.5) * image.shape[axis] / size[axis] - 0.5, 0.0, image.shape[axis] - 1
        )
        first = np.floor(places).astype(np.int64)
        share = np.expand_dims(places - first, tuple(k for k in range(3) if k != axis))
        second = np.minimum(first + 1, image.shape[axis] - 1)
        image = (1.0 - share) * image.take(first, axis) + share * image.take(second, axis)
    return image
