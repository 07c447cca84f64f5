"""Re-sculpts what lowers and raises the brows and wrinkles the nose; places are those of the base mesh, in centimetres.

The source's browDown draws the inner brow as far inwards as down, and its noseSneer lowers the brow nearly as far as
browDown does. Here the two are kept apart: procerus, depressor supercilii and corrugator lower the brow, most at its
inner end, the last also drawing it towards the middle; what wrinkles the nose hardly reaches the brow. The source
raises brows by 4 mm, and 2 cm above them nothing any more, so that they become thin; the frontalis raises them by about
10, and the skin of the forehead with them, less and less up to the hairline.
"""

import numpy as np
from scipy.interpolate import LinearNDInterpolator

from scripts.asset_building.falloff import ramp
from scripts.asset_building.piece import Floats

#: Factor on the source's movement inwards, and how far down the brow goes along x, as factors on the source's.
_INWARDS = 0.42
_ALONG, _DOWN = (0.0, 0.8, 1.6, 2.6, 3.6, 4.8, 5.8), (1.5, 1.54, 1.53, 1.22, 0.92, 0.66, 0.5)
#: Factor on how far brows are raised, the height in their middle, and by how much slower the movement fades above it.
_RAISED, _BROW_MIDDLE, _SLOWER = 1.7, 74.5, 0.45
#: In front of this depth no two layers of the forehead lie behind each other.
_FRONT = 4.0
#: Between these heights the upper lid's skin, which keeps its movement, becomes the brow's.
_LID, _BROW = 73.3, 74.7
#: Factor on noseSneer below the lower of these heights, and what is left of it above the upper one.
_SNEER, _SNEER_LEFT, _NOSE, _GLABELLA = 1.3, 0.2, 72.6, 74.3


def lowered_brow(unit: Floats, rest: Floats) -> Floats:
    """Return the offsets of browDown of either side, shape (N, 3), from the source's ``unit`` on the mesh ``rest``."""
    share = ramp(_LID, _BROW, rest[:, 1])
    down = np.interp(np.abs(rest[:, 0]), _ALONG, _DOWN)
    result = unit.copy()
    result[:, 0] *= 1.0 + share * (_INWARDS - 1.0)
    result[:, 1] *= 1.0 + share * (down - 1.0)
    return result


def raised_brow(unit: Floats, rest: Floats) -> Floats:
    """Return the offsets of browInnerUp or browOuterUp, (N, 3), from the source's ``unit`` on the mesh ``rest``."""
    front = np.flatnonzero((rest[:, 2] > _FRONT) & (rest[:, 1] > _LID))
    above = np.flatnonzero((rest[:, 2] > _FRONT) & (rest[:, 1] > _BROW_MIDDLE))
    lower = rest[above, :2].copy()
    lower[:, 1] = _BROW_MIDDLE + _SLOWER * (lower[:, 1] - _BROW_MIDDLE)
    result = unit.copy()
    result[above] = np.nan_to_num(LinearNDInterpolator(rest[front, :2], unit[front])(lower))
    raised: Floats = result * (1.0 + ramp(_LID, _BROW, rest[:, 1]) * (_RAISED - 1.0))[:, None]
    return raised


def wrinkled_nose(unit: Floats, rest: Floats) -> Floats:
    """Return the offsets of noseSneer of either side, shape (N, 3), from the source's ``unit`` on the mesh ``rest``."""
    faded: Floats = unit * (_SNEER + ramp(_NOSE, _GLABELLA, rest[:, 1]) * (_SNEER_LEFT - _SNEER))[:, None]
    return faded
