"""Rebuild mouthSmile and cheekSquint from given motions of lips, cheeks and lids, with smooth skin in between.

Zygomaticus major draws the corner of the mouth up, out and back around the teeth; the lips are drawn thin along them,
the upper one up; the cheek is pushed up and forward into a mound, whose border towards the lips is the nasolabial fold.
Orbicularis oculi lifts the cheek's upper part and the lower lid. Positions are those of the base mesh, in centimetres.
"""

import numpy as np

from faceposer.identity.anatomy.falloff import ramp
from scripts.asset_building.head import Skin
from scripts.asset_building.mouth_rings import MouthRings
from scripts.asset_building.piece import Floats, Ints
from scripts.asset_building.smoothest import smoothest

#: Positions on the skin, each with its offset and the radius of its constraint.
Places = tuple[tuple[tuple[float, ...], tuple[float, ...], float], ...]

#: Offsets of the corner of the mouth, and of the middle of the lips in a smile of both sides.
_CORNER, _MIDDLE = (0.62, 1.02, -0.48), (0.0, 0.28, -0.08)
#: Rings around the lips' contact up to the vermilion border, and the approach of this border on either lip.
_LIP_RINGS, _THINNER = 5, (0.09, 0.15)
#: Half the width over which the sides of a smile blend, and the motion of the middle with one side alone.
_SHARED, _DRAWN = 1.7, 0.13
#: Positions that follow a smile, each with its offset and the radius of its constraint.
_CHEEK = (
    ((4.3, 69.2, 13.6), (0.14, 0.53, 0.42), 0.7),
    ((5.4, 68.9, 12.5), (0.24, 0.42, 0.24), 0.6),
    ((3.3, 68.9, 14.2), (0.12, 0.46, 0.40), 0.4),
    ((2.6, 67.9, 14.4), (0.30, 0.46, -0.20), 0.3),
    ((3.0, 67.4, 14.3), (0.46, 0.74, -0.30), 0.3),
    ((3.7, 68.1, 14.0), (0.36, 0.80, 0.22), 0.3),
    ((4.4, 67.4, 13.2), (0.50, 0.90, 0.16), 0.4),
    ((2.0, 68.5, 14.7), (0.17, 0.16, -0.02), 0.3),
    ((1.75, 69.0, 14.9), (0.12, 0.08, 0.0), 0.25),
    ((3.4, 71.2, 14.0), (0.02, 0.10, 0.08), 0.5),
    ((4.6, 70.6, 13.5), (0.06, 0.20, 0.20), 0.5),
    ((4.4, 65.2, 12.6), (0.34, 0.52, -0.10), 0.4),
)
#: The same of cheekSquint.
_SQUINT = (
    ((4.3, 69.4, 13.7), (0.10, 0.47, 0.26), 0.7),
    ((5.5, 69.2, 12.4), (0.06, 0.43, 0.16), 0.6),
    ((3.1, 69.7, 14.4), (0.12, 0.36, 0.14), 0.5),
    ((4.3, 70.6, 13.7), (0.06, 0.40, 0.20), 0.6),
    ((3.1, 71.2, 14.1), (0.06, 0.26, 0.14), 0.4),
    ((5.6, 71.3, 12.4), (0.0, 0.30, 0.08), 0.5),
    ((4.6, 67.4, 13.0), (0.04, 0.34, 0.04), 0.5),
)
#: Share of eyeSquint in it.
_LID = 0.5


def smiles(skin: Skin, control: Floats, rings: MouthRings) -> tuple[Floats, Floats]:
    """Return the offsets of mouthSmileLeft and mouthSmileRight of the control vertices, shape (C, 3) each.

    Args:
        skin: The skin's topology.
        control: Its control vertices on the base mesh, shape (C, 3).
        rings: Rings of vertices around the mouth.
    """
    given = still(skin, control)
    hold(given, skin, control, _CHEEK)
    ids, offsets = _smiling_lips(rings, control)
    given[ids] = offsets
    both = symmetric(skin, smoothest(skin, control, given, np.zeros_like(given), 2e-3))
    return one_sided(skin, control, both, _DRAWN)


def squints(skin: Skin, control: Floats, lower_lid: Floats) -> tuple[Floats, Floats]:
    """Return the offsets of cheekSquintLeft and cheekSquintRight, shape (C, 3) each.

    Args:
        skin: The skin's topology.
        control: Its control vertices on the base mesh, shape (C, 3).
        lower_lid: Offsets of eyeSquintLeft, shape (C, 3), of which the lower lid gets a share.
    """
    given = still(skin, control)
    x, y, _ = control.T
    given[(y > 72.3) | (y < 66.6) | (np.abs(x) < 1.2)] = 0.0
    hold(given, skin, control, _SQUINT)
    both = symmetric(skin, smoothest(skin, control, given, np.zeros_like(given), 2e-3))
    left = both * (x > 0.0)[:, None] + _LID * lower_lid
    return left, left[skin.mirror] * [-1.0, 1.0, 1.0]


def one_sided(skin: Skin, control: Floats, both: Floats, drawn: float) -> tuple[Floats, Floats]:
    """Return the parts of the left and the right side of the offsets ``both``, shape (C, 3) each.

    The sides blend in the middle of the lips; one side alone moves it by ``drawn``, in centimetres.
    """
    left = both * ramp(-_SHARED, _SHARED, control[:, 0])[:, None]
    away = (control - control[skin.lip_contact].mean(axis=0)) / [2.3, 1.9, 3.0]
    left[:, 0] += drawn * np.exp(-(away**2).sum(axis=1)) * (control[:, 2] > 10.0)
    return left, left[skin.mirror] * [-1.0, 1.0, 1.0]


def still(skin: Skin, control: Floats) -> Floats:
    """Return constraints on the mesh: zero out of reach of the muscles of mouth and cheeks, else NaN, shape (C, 3)."""
    x, y, z = control.T
    inside = np.isin(np.arange(len(control)), np.unique(skin.quads[skin.in_mouth]))
    given = np.full_like(control, np.nan)
    given[(y > 72.0) | (z < 8.0) | (y < 62.6) | (inside & (z < 12.0))] = 0.0
    given[(np.abs(x) < 0.5) & (y > 69.3)] = 0.0
    given[(np.abs(x) < 0.7) & (y < 64.2) & ~inside] = 0.0
    return given


def hold(given: Floats, skin: Skin, control: Floats, places: Places) -> None:
    """Set the offsets of the vertices nearest to ``places``, and of their mirror vertices."""
    inside = np.isin(np.arange(len(control)), np.unique(skin.quads[skin.in_mouth]))
    for place, offset, radius in places:
        distance = np.where(inside, np.inf, np.linalg.norm(control - place, axis=1))
        near = np.flatnonzero(distance < max(radius, distance.min() + 1e-6))
        given[near] = offset
        given[skin.mirror[near]] = np.multiply(offset, [-1.0, 1.0, 1.0])


def _smiling_lips(rings: MouthRings, control: Floats) -> tuple[Ints, Floats]:
    """Return the vertices of the lips and their positions in a smile of both sides, shape (n, 3)."""
    s, side = rings.along, np.sign(control[rings.rings[0], 0])
    rise = s**1.7
    corner, middle = np.array(_CORNER), np.array(_MIDDLE)
    loop = middle + (corner - middle) * np.stack([s**1.15, rise, s**2.0], axis=1)
    loop[:, 0] *= side
    ids, moved = rings.spread(loop, _LIP_RINGS)
    _, lower = rings.spread(rings.lower.astype(float), _LIP_RINGS)
    _, along = rings.spread(s, _LIP_RINGS)
    level = np.repeat(np.arange(_LIP_RINGS), [len(ring) for ring in rings.rings[:_LIP_RINGS]]) / (_LIP_RINGS - 1)
    outside = control[ids, 2] > np.interp(np.abs(control[ids, 0]), [0.0, 2.4], [15.3, 14.0])
    thinner = np.where(lower > 0.5, _THINNER[1], -_THINNER[0]) * level * outside * (1.0 - along**3)
    moved[:, 1] += thinner
    moved[:, 2] -= 0.6 * np.abs(thinner)
    return ids, moved


def symmetric(skin: Skin, offsets: Floats) -> Floats:
    """Return the mean of ``offsets``, shape (C, 3), and their mirror image."""
    mirrored: Floats = 0.5 * (offsets + offsets[skin.mirror] * [-1.0, 1.0, 1.0])
    return mirrored
