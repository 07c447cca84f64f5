"""Colours of eyes in photos: that of the irises, and the tone of the whites.

An iris in a photo is a few pixels wide: pupil, rim, the lamp that it mirrors and the lid's shade are as large as what
is asked for. So the most probable of the usual colours is taken: hue counts more than brightness, and what is common
the more, the less is seen.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from faceposer.identity.eye_colour import EYE_COLOURS, eye_whites
from faceposer.identity.photos.face_crop import FaceCrop
from faceposer.identity.photos.skin_light import GAMMA, SkinLight
from faceposer.identity.photos.skin_samples import LIDS
from faceposer.identity.skin_layers import Colour

Array = NDArray[np.float64]

# Radii of the ring of the iris that is looked at, as shares of the iris: without pupil and rim.
_RING = (0.35, 0.75)
# How far above the middle the ring is used, as a share of the radius: the lid's shade lies on the upper half.
_ABOVE = 0.2
# Least radius of an iris in the crop, in pixels, and least number of its pixels.
_LEAST_RADIUS, _LEAST_PIXELS = 3.0, 12
# Brightness, as quantiles of the ring, between lashes and the light that the eye mirrors.
_PLAIN = (0.1, 0.6)
# Shares of people with each colour.
_SHARES = {"dark brown": 0.40, "brown": 0.30, "hazel": 0.08, "green": 0.05, "blue": 0.12, "grey": 0.05}
# Deviations of the logarithms of brightness, of red over green and of green over blue of an iris from those of its
# kind, and least colour.
_DEVIATIONS, _DARKEST = np.array([0.4, 0.12, 0.25]), 0.03
# Pixels of a photo that count as one measurement, and the most measurements.
_PATCH, _MOST_MEASUREMENTS = 30.0, 3.0
# Radius beyond which whites lie, as a share of the iris; quantiles of brightness among them, apart from lashes and
# from mirrored light; least number of pixels.
_BEYOND, _WHITES, _LEAST_WHITES = 1.2, (0.5, 0.9), 8
#: Usual and least factor on the man's whites: those of eyes lie in the shade of lids.
_USUAL_WHITES, _LEAST_FACTOR = 0.88, 0.72
# Largest difference of a channel of this factor from their mean.
_TINT = 0.04


def eye_colour_of(crops: Sequence[FaceCrop], lamps: Sequence[SkinLight] = ()) -> Colour | None:
    """Return the usual colour of eyes that the irises in photos have, or None if they are too small.

    Args:
        crops: The photos.
        lamps: The light in each, if it is known.
    """
    seen, measured = [], 0.0
    for crop, light in zip(crops, _lights(crops, lamps), strict=True):
        for iris in crop.face.landmarks.iris:
            ring = _ring(crop.image, iris)
            if ring is not None:
                seen.append(_unlit(ring, light))
                measured += len(ring) / max(crop.factor, 1e-6) ** 2 / _PATCH
    if not seen:
        return None
    return most_probable(np.median(np.concatenate(seen), axis=0), min(measured, _MOST_MEASUREMENTS))


def most_probable(colour: Array, measurements: float) -> Colour:
    """Return the usual colour of eyes that most probably looks like ``colour``, sRGB 0 to 1.

    Args:
        colour: Shape (3,).
        measurements: Number of independent measurements that it is the mean of; 0 for the commonest colour.
    """
    logs = {
        name: np.log(_SHARES[name])
        - 0.5 * measurements * float((((_features(colour) - _features(np.array(known))) / _DEVIATIONS) ** 2).sum())
        for name, known in EYE_COLOURS.items()
    }
    return EYE_COLOURS[max(logs, key=lambda name: logs[name])]


def whites_of(crops: Sequence[FaceCrop], lamps: Sequence[SkinLight] = ()) -> Colour:
    """Return factors on the colour of the built-in man's whites of eyes that bring them to those in photos."""
    seen = []
    for crop, light in zip(crops, _lights(crops, lamps), strict=True):
        marks = crop.face.landmarks
        for lids, iris in ((LIDS[:16], marks.iris[0]), (LIDS[16:], marks.iris[1])):
            seen.append(_unlit(_white(crop.image, marks.points[list(lids), :2], iris), light))
    found = np.concatenate(seen) if seen else np.zeros((0, 3))
    if len(found) < _LEAST_WHITES:
        return (_USUAL_WHITES, _USUAL_WHITES, _USUAL_WHITES)
    factors = np.median(found, axis=0) / np.array(eye_whites())
    mean = float(np.clip(factors.mean(), _LEAST_FACTOR, 1.0))
    red, green, blue = (mean + np.clip(factors - factors.mean(), -_TINT, _TINT)).tolist()
    return (red, green, blue)


def _features(colour: Array) -> Array:
    """Return logarithms of brightness, of red over green and of green over blue."""
    red, green, blue = np.log(np.maximum(colour, _DARKEST)).tolist()
    return np.array([(red + green + blue) / 3.0, red - green, green - blue])


def _lights(crops: Sequence[FaceCrop], lamps: Sequence[SkinLight]) -> list[Array]:
    """Return the light on what faces the camera in each photo, linear, (3,); 1 where it is not known."""
    if not lamps:
        return [np.ones(3)] * len(crops)
    towards = np.array([[0.0, 0.0, -1.0]])
    return [np.maximum(lamp.lit(np.full((1, 3), 0.5), towards, -60.0 * towards).shade[0], 0.05) for lamp in lamps]


def _unlit(colours: Array, light: Array) -> Array:
    result: Array = colours / light ** (1.0 / GAMMA)
    return result


def _distances(image: Array, iris: Array) -> tuple[Array, Array]:
    """Return how far pixels are from the middle of an iris, in radii, and how far below it, (h, w) each."""
    middle = iris[0, :2]
    radius = float(np.linalg.norm(iris[1:, :2] - middle, axis=1).mean())
    height, width = image.shape[:2]
    if not np.isfinite(radius) or radius < _LEAST_RADIUS:
        return np.full((height, width), np.inf), np.zeros((height, width))
    columns, rows = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    return np.hypot(columns - middle[0], rows - middle[1]) / radius, (rows - middle[1]) / radius


def _plain(colours: Array, quantiles: tuple[float, float]) -> Array:
    brightness = colours.mean(axis=1)
    low, high = np.quantile(brightness, quantiles)
    return colours[(brightness >= low) & (brightness <= high)]


def _ring(image: Array, iris: Array) -> Array | None:
    """Return the colours, (n, 3), of an iris at its middle and four points of its edge, (5, 3), or None."""
    distance, below = _distances(image, iris)
    chosen = image[(distance > _RING[0]) & (distance < _RING[1]) & (below > -_ABOVE)]
    return _plain(chosen, _PLAIN) if len(chosen) >= _LEAST_PIXELS else None


def _white(image: Array, lids: Array, iris: Array) -> Array:
    """Return the colours of the white between ``lids``, (16, 2), beside an iris, (n, 3)."""
    distance, _ = _distances(image, iris)
    middle = lids.mean(axis=0)
    around = np.argsort(np.arctan2(lids[:, 1] - middle[1], lids[:, 0] - middle[0]))
    height, width = image.shape[:2]
    opening = Image.new("1", (width, height))
    ImageDraw.Draw(opening).polygon([(x, y) for x, y in lids[around].tolist()], fill=1)
    chosen = image[np.asarray(opening) & np.isfinite(distance) & (distance > _BEYOND)]
    return _plain(chosen, _WHITES) if len(chosen) >= _LEAST_WHITES else chosen[:0]
