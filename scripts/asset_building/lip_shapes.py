"""Sculpt the shapes of the lips from motions of their edge and rotations of their section, with smooth skin around.

Orbicularis oris draws the corners of the mouth together and pushes the lips forward (mouthPucker), turns them outwards
(mouthFunnel) or inwards over the teeth (mouthRollUpper, mouthRollLower). Risorius and platysma draw the corners aside
and back around the teeth (mouthStretch), buccinator presses them against the teeth (mouthDimple), orbicularis the lips
on each other (mouthPress). The levators of the upper lip (mouthUpperUp, and the lip's part of noseSneer) and the
depressor of the lower one (mouthLowerDown) part the lips. All in centimetres on the base mesh.
"""

from dataclasses import dataclass

import numpy as np

from scripts.asset_building.head import Skin
from scripts.asset_building.mouth_rings import MouthRings
from scripts.asset_building.piece import Floats, Ints
from scripts.asset_building.smile_shapes import Places, hold, one_sided, still, symmetric
from scripts.asset_building.smoothest import smoothest

#: Number of rings around the lips' contact that form the lips.
_LIP_RINGS = 5
#: Weight that holds free skin at rest.
_NEARNESS = 2e-3


@dataclass(frozen=True)
class LipMove:
    """Symmetric motion of the lips.

    Attributes:
        corner, upper, lower: Offsets of the left corner and of the middle of either lip's edge.
        turned: Outward rotation of the section of the upper and of the lower lip in the middle, in degrees.
        size: Factor on their sections in the middle.
        roundness: Exponent of the profile from the middle to the corner: .5 for an ellipse, 1 for a parabola.
        beside: Relative increase of the motion next to the middle, with its maximum at .7 of the way to the corner.
        places: Positions on the skin around, each with its offset and the radius of its constraint.
        drawn: Offset of the whole mouth with one side alone.
    """

    corner: tuple[float, float, float]
    upper: tuple[float, float, float]
    lower: tuple[float, float, float]
    turned: tuple[float, float] = (0.0, 0.0)
    size: tuple[float, float] = (1.0, 1.0)
    roundness: float = 1.0
    beside: float = 0.0
    places: Places = ()
    drawn: float = 0.0


_PUCKER = LipMove(
    corner=(-1.05, 0.02, 0.75),
    upper=(0.0, 0.06, 0.80),
    lower=(0.0, 0.02, 0.74),
    turned=(14.0, 14.0),
    size=(1.2, 1.2),
)
_FUNNEL = LipMove(
    corner=(-0.78, 0.0, 0.50),
    upper=(0.0, 0.48, 0.72),
    lower=(0.0, -0.54, 0.64),
    turned=(38.0, 38.0),
    roundness=0.75,
)
_ROLL_UPPER = LipMove(
    corner=(0.0, 0.0, -0.04), upper=(0.0, -0.02, -0.35), lower=(0.0, 0.0, 0.0), turned=(-45.0, 0.0), size=(0.6, 1.0)
)
_ROLL_LOWER = LipMove(
    corner=(0.0, 0.0, -0.04), upper=(0.0, 0.0, 0.0), lower=(0.0, 0.03, -0.35), turned=(0.0, -45.0), size=(1.0, 0.6)
)
_PRESS = LipMove(
    corner=(0.16, 0.08, -0.22),
    upper=(0.0, -0.01, -0.07),
    lower=(0.0, 0.03, -0.06),
    turned=(-15.0, -15.0),
    size=(0.8, 0.8),
    places=(((3.2, 66.2, 13.6), (0.04, 0.06, 0.06), 0.3),),
)
_UPPER_UP = LipMove(
    corner=(0.0, 0.02, -0.02),
    upper=(0.0, 0.45, 0.04),
    lower=(0.0, 0.0, 0.0),
    turned=(5.0, 0.0),
    roundness=0.7,
    beside=0.85,
    places=(
        ((1.75, 69.0, 14.9), (0.08, 0.20, 0.0), 0.25),
        ((2.0, 68.5, 14.7), (0.10, 0.34, 0.04), 0.3),
        ((2.7, 67.9, 14.4), (0.08, 0.36, 0.06), 0.3),
        ((4.0, 69.2, 13.7), (0.02, 0.14, 0.10), 0.5),
    ),
)
_LOWER_DOWN = LipMove(
    corner=(0.04, -0.04, -0.02),
    upper=(0.0, 0.0, 0.0),
    lower=(0.0, -0.50, 0.02),
    turned=(0.0, 8.0),
    roundness=0.5,
    places=(((1.4, 64.6, 14.8), (0.02, -0.30, 0.02), 0.3),),
)
#: Levator labii superioris alaeque nasi lifts the vermilion border; the lips remain shut.
_SNEER = LipMove(
    corner=(0.0, 0.0, 0.05),
    upper=(0.0, 0.035, 0.05),
    lower=(0.0, 0.05, 0.05),
    turned=(5.0, 0.0),
    size=(1.06, 1.0),
)
_STRETCH = LipMove(
    corner=(0.72, -0.22, -0.62),
    upper=(0.0, -0.02, -0.06),
    lower=(0.0, -0.12, -0.04),
    size=(0.92, 0.92),
    places=(
        ((3.3, 66.0, 13.6), (0.52, -0.16, -0.36), 0.3),
        ((4.2, 66.6, 12.8), (0.26, -0.04, -0.10), 0.4),
        ((3.0, 64.7, 13.2), (0.30, -0.34, -0.16), 0.4),
    ),
    drawn=0.08,
)
_DIMPLE = LipMove(
    corner=(0.42, 0.20, -0.62),
    upper=(0.0, 0.0, -0.03),
    lower=(0.0, 0.03, -0.03),
    size=(0.95, 0.95),
    places=(
        ((3.2, 66.5, 13.8), (0.14, 0.08, 0.10), 0.25),
        ((3.3, 67.3, 13.9), (0.10, 0.20, 0.10), 0.3),
        ((3.1, 65.6, 13.4), (0.10, 0.05, 0.06), 0.3),
    ),
    drawn=0.08,
)


def lip_shapes(skin: Skin, control: Floats, rings: MouthRings) -> dict[str, Floats]:
    """Return the offsets of the ``control`` vertices, (C, 3), of each shape of the lips by its name, shape (C, 3)."""
    result = {
        "mouthPucker": _sculpted(skin, control, rings, _PUCKER),
        "mouthFunnel": _sculpted(skin, control, rings, _FUNNEL),
        "mouthRollUpper": _sculpted(skin, control, rings, _ROLL_UPPER),
        "mouthRollLower": _sculpted(skin, control, rings, _ROLL_LOWER),
    }
    sided = {
        "mouthStretch": _STRETCH,
        "mouthDimple": _DIMPLE,
        "mouthPress": _PRESS,
        "mouthUpperUp": _UPPER_UP,
        "mouthLowerDown": _LOWER_DOWN,
        "noseSneer": _SNEER,
    }
    for name, move in sided.items():
        left, right = one_sided(skin, control, _sculpted(skin, control, rings, move), move.drawn)
        result |= {f"{name}Left": left, f"{name}Right": right}
    return result


def _sculpted(skin: Skin, control: Floats, rings: MouthRings, move: LipMove) -> Floats:
    """Return the offsets of both sides of ``move``, shape (C, 3)."""
    given = still(skin, control)
    hold(given, skin, control, move.places)
    ids, offsets = _moved_lips(rings, control, move)
    given[ids] = offsets
    return symmetric(skin, smoothest(skin, control, given, np.zeros_like(given), _NEARNESS))


def _moved_lips(rings: MouthRings, control: Floats, move: LipMove) -> tuple[Ints, Floats]:
    """Return the vertices of the lips and their offsets, shape (n, 3)."""
    loop, s = rings.rings[0], rings.along
    middle = np.maximum(1.0 - s**2, 0.0) ** move.roundness
    lip = np.where(rings.lower[:, None], move.lower, move.upper)
    lifted = middle * (1.0 + move.beside * 4.0 * s**2 * (1.0 - s**2))
    edge = lifted[:, None] * lip + np.stack([s, 1.0 - middle, s**2], axis=1) * move.corner
    edge[:, 0] *= np.sign(control[loop, 0])
    edge[:, 2] += (1.0 - middle - s**2) * np.where(rings.lower, move.lower[2], move.upper[2])
    turn = np.deg2rad(np.where(rings.lower, move.turned[1], -move.turned[0])) * middle
    size = 1.0 + (np.where(rings.lower, move.size[1], move.size[0]) - 1.0) * middle
    columns = np.column_stack([edge, control[loop], _tangents(rings, control), turn, size])
    ids, spread = rings.spread(columns, _LIP_RINGS)
    offset, foot, axis = spread[:, :3], spread[:, 3:6], spread[:, 6:9]
    angle, factor = spread[:, 9:10], spread[:, 10:11]
    axis = axis / np.linalg.norm(axis, axis=1, keepdims=True)
    section = control[ids] - foot
    along = np.einsum("ij,ij->i", section, axis)[:, None] * axis
    across = section - along
    turned = along + factor * (np.cos(angle) * across + np.sin(angle) * np.cross(axis, across))
    return ids, offset + turned - section


def _tangents(rings: MouthRings, control: Floats) -> Floats:
    """Return the horizontal tangents of the lips' edge towards the left, one per vertex of the loop, shape (L, 3)."""
    place = control[rings.rings[0]]
    result = np.zeros_like(place)
    for half in (rings.lower, ~rings.lower):
        order = np.flatnonzero(half)[np.argsort(place[half, 0])]
        x, z = place[order, 0], place[order, 2]
        slope = np.interp(x + 0.15, x, z) - np.interp(x - 0.15, x, z)
        result[order] = np.stack([np.full_like(x, 0.3), np.zeros_like(x), slope], axis=1)
    return result
