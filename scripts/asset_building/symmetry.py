"""Make the two halves of the face exact mirror images, which the source's are only approximately."""

import numpy as np

from scripts.asset_building.piece import Floats, Ints

_FLIP = np.array([-1.0, 1.0, 1.0])


def even(vertices: Floats, mirror: Ints) -> Floats:
    """Return the mean of ``vertices`` (N, 3) and their mirror image; ``mirror`` (N,) is the vertex opposite in x."""
    return 0.5 * (vertices + _FLIP * vertices[mirror])


def even_units(units: dict[str, Floats], mirror: Ints) -> Floats:
    """Return the shapes of ``units`` in order, each made the mirror image of its partner, shape (S, N, 3).

    The partner of "...Left" is "...Right"; a shape without a side is its own.
    """
    return np.stack([0.5 * (unit + _FLIP * units[_partner(name)][mirror]) for name, unit in units.items()])


def _partner(name: str) -> str:
    for side, other in (("Left", "Right"), ("Right", "Left")):
        if name.endswith(side):
            return name.removesuffix(side) + other
    return name
