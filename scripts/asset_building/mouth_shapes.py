"""Re-sculpts mouthFrown; places are those of the base mesh, in centimetres."""

import numpy as np

from scripts.asset_building.falloff import ramp
from scripts.asset_building.piece import Floats

#: How much further depressor anguli oris draws the corner of the mouth down than in the source, and the heights between
#: which the factor falls to 1, so that nose and cheekbone keep what they have.
_FURTHER, _MOUTH, _NOSE = 1.85, 66.8, 68.8


def drawn_down(unit: Floats, control: Floats) -> Floats:
    """Return the offsets of mouthFrown of either side from the source's ``unit`` on the skin ``control``, (C, 3) each."""
    factor = _FURTHER + (1.0 - _FURTHER) * ramp(_MOUTH, _NOSE, control[:, 1])
    return unit * factor[:, None]
