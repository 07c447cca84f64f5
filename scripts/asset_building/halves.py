"""Split the two-sided shapes of ARKit, browInnerUp and cheekPuff, into a left and a right half."""

import numpy as np

from faceposer.identity.anatomy.falloff import ramp
from scripts.asset_building.piece import Floats

#: Half the width in centimetres over which a half fades out across the middle of the face. The brows' inner ends lie
#: 1.5 cm from the middle and move with their own half alone.
_FADE = {"browInnerUp": 1.4, "cheekPuff": 2.2}


def in_halves(names: tuple[str, ...], shapes: Floats, x: Floats) -> tuple[tuple[str, ...], Floats]:
    """Return names and offsets with each of the shapes above replaced by two halves, which sum to the whole.

    Args:
        names: Names of the S shapes.
        shapes: Their offsets, shape (S, N, 3).
        x: Coordinate of each vertex, positive on the character's left, in centimetres, shape (N,).
    """
    halved_names: list[str] = []
    halved: list[Floats] = []
    for name, shape in zip(names, shapes, strict=True):
        if name not in _FADE:
            halved_names.append(name)
            halved.append(shape)
            continue
        left = shape * ramp(-_FADE[name], _FADE[name], x)[:, None]
        halved_names += [f"{name}Left", f"{name}Right"]
        halved += [left, shape - left]
    return tuple(halved_names), np.stack(halved)
