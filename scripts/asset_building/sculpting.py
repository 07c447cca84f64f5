"""Corrects the source's face units, shape by shape, on the base mesh that they were made for."""

from faceposer.model.subject import ARKIT_SHAPES
from scripts.asset_building.brow_shapes import lowered_brow, wrinkled_nose
from scripts.asset_building.head import Skin
from scripts.asset_building.mouth_rings import mouth_rings
from scripts.asset_building.mouth_shapes import around_lips, drawn_down, pushed_forward
from scripts.asset_building.piece import Floats
from scripts.asset_building.smile_shapes import smiles, squints

_SIDES = ("Left", "Right")
#: Rings of the control mesh around the lips' contact that shapes speak of.
_MOUTH_RINGS = 5


def sculpted(units: Floats, rest: Floats, skin: Skin) -> Floats:
    """Return ``units``, in the order of ``ARKIT_SHAPES``, as this program has them.

    Args:
        units: Offsets in centimetres, each the mirror image of its partner, shape (52, N, 3).
        rest: The base mesh in centimetres, symmetric, shape (N, 3).
        skin: The part of it that is the face; teeth and tongue keep the source's offsets.
    """
    result = units.copy()
    row = {name: k for k, name in enumerate(ARKIT_SHAPES)}
    ids, control = skin.base_ids, rest[skin.base_ids]
    rings = mouth_rings(skin, control, _MOUTH_RINGS)
    for side in _SIDES:
        for name, function in (("browDown", lowered_brow), ("noseSneer", wrinkled_nose), ("mouthFrown", drawn_down)):
            result[row[name + side], ids] = function(units[row[name + side], ids], control)
    forward = row["jawForward"]
    result[forward, ids] = pushed_forward(units[forward, ids], around_lips(skin, control))
    lid = units[row["eyeSquintLeft"], ids]
    for name, pair in (("mouthSmile", smiles(skin, control, rings)), ("cheekSquint", squints(skin, control, lid))):
        for side, offsets in zip(_SIDES, pair, strict=True):
            result[row[name + side], ids] = offsets
    return result
