"""The blend of a skin seen in photos with that of the model, band by band of its detail.

What photos show of a skin is compared with the model's by logarithms of colours. Their difference is taken apart into
bands of detail (P. Burt and E. Adelson, "A multiresolution spline with application to image mosaics", ACM Transactions
on Graphics 2, 1983), each of which fades out over a width like its own: fine lines end at the border of what is seen,
and the tone goes on to all skin. Blurs are means weighted by trust, so that gaps, as those of glasses, are bridged.

Light that is not found exactly, highlights, shadows and the blocks of JPEG leave blotches in the middle bands. Skin
changes little and slowly there, in colour less than in brightness: these bands are limited, and more so towards light.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from faceposer.identity.photos.face_texels import smooth_step

Image32 = NDArray[np.float32]


@dataclass(frozen=True)
class Band:
    """Limits of a band of detail.

    Attributes:
        width: Standard deviation, in texels, of the blur that takes it away.
        darker: Largest logarithm by which its brightness is below that of the model.
        brighter: Largest logarithm by which it is above.
        chroma: Largest difference of the logarithm of a channel from the brightness.
        kept: Share of the chroma that is kept where it is small.
    """

    width: float
    darker: float
    brighter: float
    chroma: float
    kept: float = 1.0


#: From the finest to the coarsest, in texels of a grid of 1024.
BANDS: tuple[Band, ...] = (
    Band(2.0, 0.20, 0.09, 0.02, 0.5),
    Band(5.0, 0.10, 0.06, 0.02, 0.5),
    Band(12.0, 0.08, 0.05, 0.015, 0.6),
    Band(30.0, 0.06, 0.05, 0.02, 0.8),
)
#: What is left: the tone of a part of the face, apart from the usual one of the face.
TONE = Band(np.inf, 0.12, 0.07, 0.02)
# Factor on the limits at brows and lips, apart from that of what is brighter than skin.
_WIDER = 4.0
# Logarithm of darkness from which they have their own chroma.
_OWN = 0.05
# Blur of the trust in texels by which fine detail fades before the border of what is seen, and the bands that do.
_BORDER, _FADED = 9.0, 2
# Trust in a blurred difference from which it counts, and from which fully.
_COUNTS, _FULL = 0.1, 0.85
_LEAST = 1e-4


def blended_difference(
    difference: Image32, trust: Image32, sharp: Image32, free: Image32, limited: bool = True
) -> Image32:
    """Return the logarithms to add to the model's skin, shape (n, n, 3); n is a power of two.

    Args:
        difference: Logarithms of the colours seen over the model's, any where nothing is seen, shape (n, n, 3).
        trust: How much each texel is seen, 0 to 1, shape (n, n).
        sharp: Factor on the trust in the finest detail, 0 to 1, shape (n, n).
        free: Where limits are wide, as at brows and lips, 0 to 1, shape (n, n).
        limited: Keep bands within their limits.
    """
    height, width = trust.shape
    seen = np.flatnonzero(trust.max(axis=1) > 0.0), np.flatnonzero(trust.max(axis=0) > 0.0)
    result = np.zeros((height, width, 3), dtype=np.float32)
    if not len(seen[0]):
        return result
    reach = int(4 * BANDS[-1].width)
    rows, columns = (
        slice(max(int(at[0]) - reach, 0), min(int(at[-1]) + reach + 1, size))
        for at, size in zip(seen, (height, width), strict=True)
    )
    inside = (rows, columns)
    values, weights = difference[inside], trust[inside]
    open_ = free[inside][..., None]
    # Lines that end at a border show it, and skin beside glasses and hair is in their shade.
    within = smooth_step(ndimage.gaussian_filter(weights, _BORDER), (0.5, 1.0))
    for number, band in enumerate(BANDS):
        smooth, share = _blurred(values, weights, band.width)
        opacity = weights * np.maximum(within * sharp[inside], open_[..., 0]) if number < _FADED else weights
        result[inside] += opacity[..., None] * (_limited(values - smooth, band, open_) if limited else values - smooth)
        values, weights = smooth, smooth_step(share, (_COUNTS, _FULL))
    most = trust > 0.5 * float(trust.max())
    usual = np.median(difference[most], axis=0).astype(np.float32)
    tone = np.zeros_like(result)
    tone[inside] = weights[..., None] * (_limited(values - usual, TONE, open_) if limited else values - usual)
    return result + usual + tone


def _blurred(values: Image32, weights: Image32, width: float) -> tuple[Image32, Image32]:
    """Return the mean of ``values``, (h, w, 3), under ``weights``, (h, w), about each texel, and the blurred weights.

    Wide blurs are those of a coarser grid.
    """
    step = max(int(width / 3.0), 1)
    shape = weights.shape
    pad = [(0, -size % step) for size in shape]
    stacked = np.concatenate([values * weights[..., None], weights[..., None]], axis=2)
    stacked = np.pad(stacked, [*pad, (0, 0)])
    if step > 1:
        tall, wide = (size // step for size in stacked.shape[:2])
        stacked = stacked.reshape(tall, step, wide, step, 4).mean(axis=(1, 3))
    stacked = ndimage.gaussian_filter(stacked, (width / step, width / step, 0.0), truncate=3.0)
    if step > 1:
        stacked = ndimage.zoom(stacked, (step, step, 1), order=1, grid_mode=True, mode="nearest")
    stacked = stacked[: shape[0], : shape[1]]
    share = np.ascontiguousarray(stacked[..., 3])
    return stacked[..., :3] / np.maximum(share, _LEAST)[..., None], share


def _limited(detail: Image32, band: Band, free: Image32) -> Image32:
    """Return a band of logarithms, (h, w, 3), within its limits, wider ones where ``free``, (h, w, 1), is 1."""
    wider = np.float32(1.0) + np.float32(_WIDER - 1.0) * free
    brightness = detail.mean(axis=2, keepdims=True)
    chroma = detail - brightness
    dark, light = np.float32(band.darker) * wider, np.float32(band.brighter)
    held = np.where(brightness < 0.0, dark * np.tanh(brightness / dark), light * np.tanh(brightness / light))
    size = np.sqrt((chroma * chroma).sum(axis=2, keepdims=True)) + np.float32(1e-6)
    # Hairs and lips have colours of their own, not the skin that shines through.
    own = free * np.clip(brightness * np.float32(-1.0 / _OWN), 0.0, 1.0)
    most = np.float32(band.chroma) * (np.float32(1.0) + np.float32(_WIDER - 1.0) * own)
    kept = np.float32(band.kept) + np.float32(1.0 - band.kept) * own
    result: Image32 = held + chroma * (kept * most * np.tanh(size / most) / size)
    return result
