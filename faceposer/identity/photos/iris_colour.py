"""Colours of eyes in photos."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from faceposer.identity.eye_colour import EYE_COLOURS
from faceposer.identity.photos.face_crop import FaceCrop
from faceposer.identity.skin_layers import Colour

Array = NDArray[np.float64]

# Radii of the ring of the iris that is looked at, as shares of the iris: without pupil and rim.
_RING = (0.45, 0.85)
# Least radius of an iris in the crop, in pixels, and least number of its pixels.
_LEAST_RADIUS, _LEAST_PIXELS = 3.0, 12
# Brightness, as quantiles of the ring, between lashes or shadow and the light that the eye mirrors.
_PLAIN = (0.15, 0.7)


def eye_colour_of(crops: Sequence[FaceCrop]) -> Colour | None:
    """Return the usual colour of eyes that is most like the irises in photos, or None if they are too small.

    The upper half of an iris is in the shade of the lid, so that the lower one is taken.
    """
    seen = [
        ring for crop in crops for iris in crop.face.landmarks.iris if (ring := _ring(crop.image, iris)) is not None
    ]
    if not seen:
        return None
    colour = np.median(np.concatenate(seen), axis=0)
    names = list(EYE_COLOURS)
    known = np.array([EYE_COLOURS[name] for name in names])
    return EYE_COLOURS[names[int(np.argmin(np.linalg.norm(np.sqrt(known) - np.sqrt(colour), axis=1)))]]


def _ring(image: Array, iris: Array) -> Array | None:
    """Return the colours, (n, 3), of an iris at its middle and four points of its edge, (5, 3), or None."""
    middle = iris[0, :2]
    radius = float(np.linalg.norm(iris[1:, :2] - middle, axis=1).mean())
    if not np.isfinite(radius) or radius < _LEAST_RADIUS:
        return None
    height, width = image.shape[:2]
    columns, rows = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    distance = np.hypot(columns - middle[0], rows - middle[1]) / radius
    chosen = image[(distance > _RING[0]) & (distance < _RING[1]) & (rows > middle[1])]
    if len(chosen) < _LEAST_PIXELS:
        return None
    brightness = chosen.mean(axis=1)
    low, high = np.quantile(brightness, _PLAIN)
    return chosen[(brightness >= low) & (brightness <= high)]
