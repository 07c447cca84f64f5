"""Re-sculpts the face units that the goblin's expressions are made of.

Large eyes, a wide mouth and a low broad forehead make people's motions look small: on the goblin they go further. Its
brows tilt: what lowers or raises their inner ends takes the outer ends the other way, so that anger and sorrow are told
by their slope. Places are those of the base mesh, in centimetres.
"""

import numpy as np

from faceposer.model.character import ARKIT_SHAPES
from scripts.asset_building.falloff import ramp
from scripts.asset_building.piece import Floats

_SIDES = ("Left", "Right")
#: Factors on units; a name without a side means both sides.
_FURTHER = {
    "eyeWide": 2.3,
    "eyeSquint": 1.3,
    "cheekSquint": 1.1,
    "mouthFrown": 1.6,
    "mouthStretch": 1.35,
    "mouthUpperUp": 1.5,
    "mouthLowerDown": 1.15,
    "mouthShrugLower": 1.3,
    "mouthShrugUpper": 1.3,
    "jawLeft": 1.45,
    "jawRight": 1.45,
    "jawForward": 1.5,
}
#: Along the brow, at these distances from the middle: factors on how far it goes down and up.
_ALONG = (0.0, 1.6, 2.6, 3.8, 5.0, 6.2)
_DOWN, _INNER_UP = (1.8, 1.9, 1.7, 1.0, 0.2, -0.4), (1.9, 2.1, 1.8, 1.0, 0.1, -0.6)
_OUTER_UP = (0.0, 0.1, 0.7, 1.3, 1.5, 1.4)
#: Factor on how far browDown draws the inner ends together.
_TOGETHER = 1.8
#: Between these heights the upper lid, which keeps its motion, becomes the brow.
_LID, _BROW = 73.4, 74.6
#: Factors on noseSneer at the lips and at the nose, and the heights between which the one becomes the other.
_SNEER_LIPS, _SNEER_NOSE, _LIPS, _NOSE = 0.1, 1.4, 66.5, 68.3
#: Places that noseSneer lifts beside what the source does, with the way and the radius: the wing of the nose, the fold
#: beside it, and the skin below.
_SNEER = (
    ((1.5, 69.3, 15.0), (0.10, 0.42, 0.05), 1.3),
    ((2.7, 69.6, 14.0), (0.08, 0.34, 0.24), 1.5),
    ((1.6, 67.9, 15.0), (0.04, 0.24, 0.06), 0.7),
)


def goblin_units(units: Floats, rest: Floats) -> Floats:
    """Return ``units``, offsets on the goblin in the order of ``ARKIT_SHAPES``, shape (52, N, 3), as it has them.

    Args:
        units: People's, fitted to the goblin.
        rest: The base mesh that they were made for, in centimetres, shape (N, 3).
    """
    result = units.copy()
    row = {name: k for k, name in enumerate(ARKIT_SHAPES)}
    for name, factor in _FURTHER.items():
        for one in [name] if name in row else [name + side for side in _SIDES]:
            result[row[one]] *= factor
    brow = ramp(_LID, _BROW, rest[:, 1])
    x = np.abs(rest[:, 0])
    inner = row["browInnerUp"]
    result[inner, :, 1] *= 1.0 + brow * (np.interp(x, _ALONG, _INNER_UP) - 1.0)
    for side, sign in zip(_SIDES, (1.0, -1.0), strict=True):
        down = row["browDown" + side]
        result[down, :, 0] *= 1.0 + brow * (_TOGETHER - 1.0)
        result[down, :, 1] *= 1.0 + brow * (np.interp(x, _ALONG, _DOWN) - 1.0)
        result[row["browOuterUp" + side], :, 1] *= 1.0 + brow * (np.interp(x, _ALONG, _OUTER_UP) - 1.0)
        sneer = row["noseSneer" + side]
        result[sneer] *= (_SNEER_LIPS + (_SNEER_NOSE - _SNEER_LIPS) * ramp(_LIPS, _NOSE, rest[:, 1]))[:, None]
        for place, way, radius in _SNEER:
            away = (rest - np.multiply(place, (sign, 1.0, 1.0))) / radius
            share = np.exp(-(away**2).sum(axis=1)) * (rest[:, 2] > 11.5)
            result[sneer] += share[:, None] * np.multiply(way, (sign, 1.0, 1.0))
    return result
