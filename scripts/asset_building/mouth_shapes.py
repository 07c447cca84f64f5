"""Re-sculpts mouthFrown, jawForward and mouthClose; places are those of the base mesh, in centimetres."""

import numpy as np
from scipy.spatial import cKDTree

from scripts.asset_building.falloff import ramp
from scripts.asset_building.head import Skin
from scripts.asset_building.piece import Floats
from scripts.asset_building.smoothest import smoothest

#: How much further depressor anguli oris draws the corner of the mouth down than in the source, and the heights between
#: which the factor falls to 1, so that nose and cheekbone keep what they have.
_FURTHER, _MOUTH, _NOSE = 1.85, 66.8, 68.8
#: What is left of its way aside: depressor anguli oris draws the corner nearly straight down.
_ASIDE = 0.5
#: Distances from the lips' contact between which a change of the lips fades out, and all of the closing of the mouth.
LIP_REACH, MOUTH_REACH = (1.0, 2.8), (4.5, 7.0)
#: What the lips do not have of the jaw's way down and forward, so that they stay shut and behind the chin.
_LESS = (0.0, 0.8, 0.15)
#: How much the offsets on the cheeks keep to the source's beside smoothness.
_EVENNESS = 0.006
# Centimetres from the middle of the face at which a blown-up cheek begins to turn aside and does so fully; what share
# of its way forwards goes aside too, and what share of it is lost.
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
        closing: The source's mouthClose, made for its jawOpen.
        source_opening: The source's jawOpen.
        opening: What jawOpen is in its place.
        lips: From `around_lips`, on the lips.
        near: The same, on all that their closing moves.
    """
    return closing * near[:, None] + lips[:, None] * (source_opening - opening)


def even_cheeks(skin: Skin, control: Floats, units: Floats) -> Floats:
    """Return ``units``, offsets of the ``control`` vertices, shape (S, C, 3), evened out over the cheeks.

    Beside the mouth the source's shapes end along one edge loop, where the skin would stand up in a streak.
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
    """Return the blown-up cheek with ``offsets``, (n, 3), bulging sideways as much as forwards beside the mouth.

    Air in the mouth presses along the cheek's normal, which at its middle points halfway to the side; the source's unit
    moves it forwards alone.

    Args:
        offsets: Of the source's unit.
        control: The face at rest, shape (n, 3).
    """
    x = control[:, 0]
    aside = ramp(_PUFF_FROM, _PUFF_TO, np.abs(x))
    result = offsets.copy()
    result[:, 0] += _PUFF_ASIDE * aside * np.sign(x) * offsets[:, 2].clip(min=0.0)
    result[:, 2] *= 1.0 - _PUFF_LESS * aside
    return result
