"""Corrects the source's face units, shape by shape, on the base mesh that they were made for."""

from collections.abc import Callable

import numpy as np

from faceposer.model.subject import ARKIT_SHAPES
from scripts.asset_building.brow_shapes import lowered_brow, wrinkled_nose
from scripts.asset_building.piece import Floats

_SIDES = ("Left", "Right")
#: What makes a shape of ours from the source's offsets and the mesh that these are on.
_SCULPTED: dict[str, Callable[[Floats, Floats], Floats]] = {
    **{f"browDown{side}": lowered_brow for side in _SIDES},
    **{f"noseSneer{side}": wrinkled_nose for side in _SIDES},
}


def sculpted(units: Floats, rest: Floats) -> Floats:
    """Return ``units``, in the order of ``ARKIT_SHAPES``, as this program has them.

    Args:
        units: Offsets in centimetres, each the mirror image of its partner, shape (52, N, 3).
        rest: The base mesh in centimetres, symmetric, shape (N, 3).
    """
    return np.stack(
        [
            _SCULPTED[name](unit, rest) if name in _SCULPTED else unit
            for name, unit in zip(ARKIT_SHAPES, units, strict=True)
        ]
    )
