"""Re-sculpt mouthFrown, jawForward and mouthClose; positions are those of the base mesh, in centimetres."""

import numpy as np
from scipy.spatial import cKDTree

from faceposer.identity.anatomy.falloff import ramp
from scripts.asset_building.head import Skin
from scripts.asset_building.piece import Floats
from scripts.asset_building.smoothest import smoothest

#: Factor on the source's downward motion of the corner of the mouth (depressor anguli oris), and the heights between
#: which it falls to 1, so that nose and cheekbone are not affected.
_FURTHER, _MOUTH, _NOSE = 1.85, 66.8, 68.8
#: Factor on its sideways motion: depressor anguli oris draws the corner nearly straight down.
_ASIDE = 0.5
#: Distances from the lips' contact over which changes of the lips, and the closing of the mouth, fade out.
LIP_REACH, MOUTH_REACH = (1.0, 2.8), (4.5, 7.0)
#: Share of the jaw's motion down and forward that the lips lack, so that they stay shut and behind the chin.
_LESS = (0.0, 0.8, 0.15)
#: Weight of the source's offsets on the cheeks relative to smoothness.
_EVENNESS = 0.006
# Distances in centimetres from the middle of the face over which a puffed cheek turns sideways; share of its forward
# motion that is added sideways, and share that is lost.
_PUFF_FROM, _PUFF_TO = 1.8, 3.6
_PUFF_ASIDE, _PUFF_LESS = 0.45, 0.15


def drawn_down(unit: Floats, control: Floats) -> Floats:
    """Return the offsets of mouthFrown of either side from the source's ``unit`` on ``control``, shape (C, 3) both."""
    factor = _FURTHER + (1.0 - _FURTHER) * ramp(_MOUTH, _NOSE, control[:, 1])
    return unit * factor[:, None] * [_ASIDE, 1.0, 1.0]


def around_lips(skin: Skin, control: Floats, reach: tuple[float, float] = LIP_REACH) -> Floats:
    """Return weights of the ``control`` vertices, (C, 3), that are 1 on the lips and fade out around them, (C,)."""
    return 1.0 - ramp(*reach, cKDTree(control[skin.lip_contact]).query(control)[0])


def pushed_forward(unit: Floats, lips: Floats) -> Floats:
    """Return the offsets of jawForward from the source's ``unit``, shape (C, 3), ``lips`` from `around_lips`."""
    return unit * (1.0 - np.multiply.outer(lips, _LESS))


def closed_again(closing: Floats, source_opening: Floats, opening: Floats, lips: Floats, near: Floats) -> Floats:
    """Return the offsets of mouthClose, which with jawOpen brings the lips together, shape (C, 3).

    Args:
        closing: The source's mouthClose, which matches its jawOpen.
        source_opening: The source's jawOpen.
        opening: The jawOpen that replaces it.
        lips: Weights from `around_lips` for the lips.
        near: The same for everything that their closing moves.
    """
    return closing * near[:, None] + lips[:, None] * (source_opening - opening)


def even_cheeks(skin: Skin, control: Floats, units: Floats) -> Floats:
    """Return ``units``, offsets of the ``control`` vertices, shape (S, C, 3), smoothed over the cheeks.

    Next to the mouth, the source's shapes end along one edge loop, which would give a visible ridge.
    """
    x, y, z = control.T
    away = cKDTree(control[skin.lip_contact]).query(control)[0]
    inside = np.isin(np.arange(len(control)), np.unique(skin.quads[skin.in_mouth]))
    cheeks = ~inside & (away > 0.9) & (away < 5.5) & (np.abs(x) > 2.2) & (y < 70.5) & (y > 62.0) & (z > 7.0)
    flat = units.transpose(1, 0, 2).reshape(len(control), -1)
    given = np.where(cheeks[:, None], np.nan, flat)
    evened = smoothest(skin, control, given, flat, _EVENNESS)
    result: Floats = evened.reshape(len(control), -1, 3).transpose(1, 0, 2)
    return result


def puffed(offsets: Floats, control: Floats) -> Floats:
    """Return the puffed cheek with ``offsets``, (n, 3), bulging sideways as much as forwards next to the mouth.

    Air in the mouth presses along the cheek's normal, which at its middle points halfway to the side; the source's unit
    moves it forwards alone.

    Args:
        offsets: Offsets of the source's unit.
        control: The face at rest, shape (n, 3).
    """
    x = control[:, 0]
    aside = ramp(_PUFF_FROM, _PUFF_TO, np.abs(x))
    result = offsets.copy()
    result[:, 0] += _PUFF_ASIDE * aside * np.sign(x) * offsets[:, 2].clip(min=0.0)
    result[:, 2] *= 1.0 - _PUFF_LESS * aside
    return result
