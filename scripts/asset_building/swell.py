"""Smooth local stretching of a head beyond the range of identity targets."""

from dataclasses import dataclass

import numpy as np

from scripts.asset_building.piece import Floats


@dataclass(frozen=True)
class Swell:
    """Local stretch about a centre that fades out around it; off the middle of the face, it has a mirrored partner.

    Attributes:
        place: Centre on the base mesh in centimetres: x to the left, y up, z forward.
        radius: Radius of the falloff along each axis, in centimetres of the base mesh.
        stretch: Factor along each axis at the centre.
    """

    place: tuple[float, float, float]
    radius: tuple[float, float, float]
    stretch: tuple[float, float, float]


def swollen(vertices: Floats, place: Floats, swells: tuple[Swell, ...]) -> Floats:
    """Return ``vertices`` (N, 3) with ``swells`` applied in sequence; ``place`` has the positions on the base mesh."""
    result = vertices
    for swell in swells:
        sides = (1.0, -1.0) if swell.place[0] else (1.0,)
        moves = np.zeros_like(result)
        for side in sides:
            away = (place - np.multiply(swell.place, [side, 1.0, 1.0])) / swell.radius
            share = np.exp(-((away**2).sum(axis=1) ** 2))
            middle = share @ result / share.sum()
            if len(sides) == 1:
                middle[0] = 0.0
            moves += share[:, None] * (np.subtract(swell.stretch, 1.0) * (result - middle))
        result = result + moves
    return result
