"""Correct the source's face units, shape by shape, on their base mesh."""

import numpy as np

from faceposer.identity.anatomy.falloff import ramp
from faceposer.model.character import ARKIT_SHAPES
from scripts.asset_building.brow_shapes import lowered_brow, raised_brow, wrinkled_nose
from scripts.asset_building.head import Skin
from scripts.asset_building.lip_shapes import lip_shapes
from scripts.asset_building.mouth_rings import mouth_rings
from scripts.asset_building.mouth_shapes import around_lips, drawn_down, even_cheeks, puffed, pushed_forward
from scripts.asset_building.piece import Floats
from scripts.asset_building.smile_shapes import smiles, squints

_SIDES = ("Left", "Right")
#: Shapes that also move the cheeks.
_PULL_CHEEKS = tuple(
    name + side
    for name in ("mouthFrown", "mouthPress", "mouthStretch", "mouthDimple", "mouth", "jaw")
    for side in _SIDES
)
#: Functions that derive a shape of either side from the source's.
_CORRECTIONS = {
    "browDown": lowered_brow,
    "browOuterUp": raised_brow,
    "noseSneer": wrinkled_nose,
    "mouthFrown": drawn_down,
}
#: Shapes to which the motion of the lips is added.
_ADDED = ("noseSneerLeft", "noseSneerRight")
#: Opening of the lips for the tongue, as weights of these shapes of both sides.
_TONGUE_PARTS_LIPS = {"mouthLowerDown": 1.3, "mouthUpperUp": 0.3}
#: Range towards the corners over which the parting of the lips fades out.
_TONGUE_SIDE = (0.9, 2.1)
#: Number of rings of the control mesh around the lips' contact that shapes refer to.
_MOUTH_RINGS = 5


def sculpted(units: Floats, rest: Floats, skin: Skin) -> Floats:
    """Return the corrected ``units``, in the order of ``ARKIT_SHAPES``.

    Args:
        units: Offsets in centimetres, each the mirror image of its partner, shape (52, N, 3).
        rest: The base mesh in centimetres, symmetric, shape (N, 3).
        skin: The part of it that is the face; teeth and tongue keep the source's offsets.
    """
    result = units.copy()
    row = {name: k for k, name in enumerate(ARKIT_SHAPES)}
    ids, control = skin.base_ids, rest[skin.base_ids]
    pulled = [row[name] for name in _PULL_CHEEKS]
    result[np.ix_(pulled, ids)] = even_cheeks(skin, control, units[np.ix_(pulled, ids)])
    rings = mouth_rings(skin, control, _MOUTH_RINGS)
    for side in _SIDES:
        for name, function in _CORRECTIONS.items():
            result[row[name + side], ids] = function(result[row[name + side], ids], control)
    inner = row["browInnerUp"]
    result[inner, ids] = raised_brow(units[inner, ids], control, aside=1.0)
    puff = row["cheekPuff"]
    result[puff, ids] = puffed(units[puff, ids], control)
    forward = row["jawForward"]
    result[forward, ids] = pushed_forward(units[forward, ids], around_lips(skin, control))
    parting = sum(share * units[row[name + side], ids] for name, share in _TONGUE_PARTS_LIPS.items() for side in _SIDES)
    result[row["tongueOut"], ids] = parting * (1.0 - ramp(*_TONGUE_SIDE, np.abs(control[:, :1])))
    for name, offsets in lip_shapes(skin, control, rings).items():
        result[row[name], ids] = offsets + (result[row[name], ids] if name in _ADDED else 0.0)
    lid = units[row["eyeSquintLeft"], ids]
    for name, pair in (("mouthSmile", smiles(skin, control, rings)), ("cheekSquint", squints(skin, control, lid))):
        for side, offsets in zip(_SIDES, pair, strict=True):
            result[row[name + side], ids] = offsets
    return result
