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
#: From this place on, along x, the movement of a raised outer brow fades slower by this factor: its tail comes too.
_ARCH, _SLOWER_ASIDE = 3.4, 0.4
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


def raised_brow(unit: Floats, rest: Floats, aside: float = _SLOWER_ASIDE) -> Floats:
    """Return the offsets of browInnerUp or browOuterUp, (N, 3), from the source's ``unit`` on the mesh ``rest``.

    Args:
        unit: Offsets in centimetres, shape (N, 3).
        rest: The base mesh, shape (N, 3).
        aside: By which factor the movement fades slower outwards from the arch of the brow; 1 leaves it.
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
