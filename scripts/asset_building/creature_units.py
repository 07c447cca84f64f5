"""Re-sculpt the face units of the goblin's expressions.

With large eyes, a wide mouth and a low broad forehead, human motions look small and are amplified on the goblin. Its
brows tilt: lowering or raising their inner ends moves the outer ends the other way, so that their slope expresses anger
and sorrow. Positions are those of the base mesh, in centimetres.
"""

import numpy as np

from faceposer.identity.anatomy.falloff import ramp
from faceposer.model.character import ARKIT_SHAPES
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
#: Factors on the motion of the brow down and up, at these distances from the middle.
_ALONG = (0.0, 1.6, 2.6, 3.8, 5.0, 6.2)
_DOWN, _INNER_UP = (1.8, 1.9, 1.7, 1.0, 0.2, -0.4), (1.9, 2.1, 1.8, 1.0, 0.1, -0.6)
_OUTER_UP = (0.0, 0.1, 0.7, 1.3, 1.5, 1.4)
#: Factor on the motion of the inner ends towards each other in browDown.
_TOGETHER = 1.8
#: Heights of the transition from the upper lid, which keeps its motion, to the brow.
_LID, _BROW = 73.4, 74.6
#: Factors on noseSneer at the lips and at the nose, and the heights of the transition between them.
_SNEER_LIPS, _SNEER_NOSE, _LIPS, _NOSE = 0.1, 1.4, 66.5, 68.3
#: Positions that noseSneer lifts in addition to the source, with offset and radius: the wing of the nose, the fold next
#: to it, and the skin below.
_SNEER = (
    ((1.5, 69.3, 15.0), (0.10, 0.42, 0.05), 1.3),
    ((2.7, 69.6, 14.0), (0.08, 0.34, 0.24), 1.5),
    ((1.6, 67.9, 15.0), (0.04, 0.24, 0.06), 0.7),
)


def goblin_units(units: Floats, rest: Floats) -> Floats:
    """Return ``units``, offsets on the goblin in the order of ``ARKIT_SHAPES``, shape (52, N, 3), re-sculpted.

    Args:
        units: Human units, fitted to the goblin.
        rest: Base mesh of the units, in centimetres, shape (N, 3).
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
