"""Re-sculpt the shapes of brows and nose wrinkles; positions are those of the base mesh, in centimetres.

The source's browDown draws the inner brow as far inwards as down, and its noseSneer lowers the brow nearly as far as
browDown does. Here the two are separate: procerus, depressor supercilii and corrugator lower the brow, most at its
inner end, and the last also draws it towards the middle; nose wrinkles hardly affect the brow. The source raises brows
by 4 mm and nothing 2 cm above them, so that they become thin; the frontalis raises them by about 10 mm together with
the skin of the forehead, decreasing up to the hairline.
"""

import numpy as np
from scipy.interpolate import LinearNDInterpolator

from faceposer.identity.anatomy.falloff import ramp
from scripts.asset_building.piece import Floats

#: Factor on the source's motion inwards, and factors along x on its motion downwards.
_INWARDS = 0.42
_ALONG, _DOWN = (0.0, 0.8, 1.6, 2.6, 3.6, 4.8, 5.8), (1.5, 1.54, 1.53, 1.22, 0.92, 0.66, 0.5)
#: Factor on the motion of raised brows, the height of their middle, and factor on the distance of its falloff above.
_RAISED, _BROW_MIDDLE, _SLOWER = 1.7, 74.5, 0.45
#: x from which the motion of a raised outer brow fades slower by this factor, so that its tail follows.
_ARCH, _SLOWER_ASIDE = 3.4, 0.4
#: Depth in front of which the forehead has a single layer.
_FRONT = 4.0
#: Heights of the transition from the upper lid's skin, which keeps its motion, to the brow's.
_LID, _BROW = 73.3, 74.7
#: Factors on noseSneer below the lower and above the upper of these heights.
_SNEER, _SNEER_LEFT, _NOSE, _GLABELLA = 1.3, 0.2, 72.6, 74.3


def lowered_brow(unit: Floats, rest: Floats) -> Floats:
    """Return the offsets of browDown of either side, shape (N, 3), from the source's ``unit`` on the mesh ``rest``."""
    share = ramp(_LID, _BROW, rest[:, 1])
    down = np.interp(np.abs(rest[:, 0]), _ALONG, _DOWN)
    result = unit.copy()
    result[:, 0] *= 1.0 + share * (_INWARDS - 1.0)
    result[:, 1] *= 1.0 + share * (down - 1.0)
    return result


def raised_brow(unit: Floats, rest: Floats, aside: float = _SLOWER_ASIDE) -> Floats:
    """Return the offsets of browInnerUp or browOuterUp, (N, 3), from the source's ``unit`` on the mesh ``rest``.

    Args:
        unit: Offsets in centimetres, shape (N, 3).
        rest: The base mesh, shape (N, 3).
        aside: Factor on the distance of the falloff outwards from the arch of the brow; 1 for no change.
    """
    front = np.flatnonzero((rest[:, 2] > _FRONT) & (rest[:, 1] > _LID))
    source = rest[front, :2].copy()
    source[:, 1] -= (1.0 - _SLOWER) * np.maximum(source[:, 1] - _BROW_MIDDLE, 0.0)
    beyond = np.maximum(np.abs(source[:, 0]) - _ARCH, 0.0) * ramp(_LID, _BROW_MIDDLE, rest[front, 1])
    source[:, 0] -= (1.0 - aside) * np.sign(source[:, 0]) * beyond
    result = unit.copy()
    result[front] = np.nan_to_num(LinearNDInterpolator(rest[front, :2], unit[front])(source))
    raised: Floats = result * (1.0 + ramp(_LID, _BROW, rest[:, 1]) * (_RAISED - 1.0))[:, None]
    return raised


def wrinkled_nose(unit: Floats, rest: Floats) -> Floats:
    """Return the offsets of noseSneer of either side, shape (N, 3), from the source's ``unit`` on the mesh ``rest``."""
    faded: Floats = unit * (_SNEER + ramp(_NOSE, _GLABELLA, rest[:, 1]) * (_SNEER_LEFT - _SNEER))[:, None]
    return faded
