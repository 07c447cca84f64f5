"""Long pointed ears and their motion, as smooth deformations of the base mesh's ears."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from scripts.asset_building.piece import Floats

#: Lowest and highest position of the ears on the base mesh in centimetres.
_LOBE, _TOP = 68.3, 73.4
#: Distance from the head, in centimetres of the base mesh, over which an ear detaches from it.
_FREE = 1.1


@dataclass(frozen=True)
class EarShape:
    """Parameters of pointed ears.

    Attributes:
        reach: Offset of the top, in centimetres to the left, up and forward (left ear).
        sharpness: Growth of the offset towards the top.
        narrowing: Share of the width that is lost at the tip.
    """

    reach: tuple[float, float, float]
    sharpness: float
    narrowing: float


def ear_freedom(place: Floats, ears: Floats) -> Floats:
    """Return the weight of each vertex in the free part of an ear, from 0 at its root to 1, shape (N,).

    Args:
        place: Positions on the base mesh in centimetres, shape (N, 3).
        ears: Mask of the ears, 0..1, shape (N,).
    """
    on_ear = (ears > 0.5) & (np.abs(place[:, 0]) > 6.0)
    head = (ears < 0.5) & (place[:, 1] > 60.0)
    distance = cKDTree(place[head]).query(place)[0]
    t = np.clip(distance / _FREE, 0.0, 1.0)
    free: Floats = np.where(on_ear, t * t * (3.0 - 2.0 * t), 0.0)
    return free


def ear_height(place: Floats) -> Floats:
    """Return the relative height of base-mesh positions in the ear, 0 at the lobe to 1 at the top, shape (N,)."""
    height: Floats = np.clip((place[:, 1] - _LOBE) / (_TOP - _LOBE), 0.0, 1.0)
    return height


def point_ears(vertices: Floats, place: Floats, free: Floats, shape: EarShape) -> Floats:
    """Return ``vertices`` (N, 3) with the ears drawn out to a point.

    Args:
        vertices: The head in centimetres, shape (N, 3).
        place: The same vertices on the base mesh, shape (N, 3).
        free: Weights from `ear_freedom`, shape (N,).
        shape: Parameters of the ears.
    """
    side = np.sign(place[:, 0])[:, None] * [1.0, 0.0, 0.0] + [0.0, 1.0, 1.0]
    height = ear_height(place)
    pull = (free * height**shape.sharpness)[:, None]
    result = vertices.copy()
    # The outline narrows towards the line through the ear's middle as it rises.
    on_ear = free > 0.0
    middle = vertices[on_ear, 2].mean()
    result[:, 2] += free * shape.narrowing * height**1.5 * (middle - vertices[:, 2])
    moved: Floats = result + pull * side * shape.reach
    return moved


def turn_ears(vertices: Floats, place: Floats, free: Floats, side: str, axis: Floats) -> Floats:
    """Return the offsets, shape (N, 3), of a rotation of one ear about its root, increasing towards its tip.

    Args:
        vertices: The head in centimetres, shape (N, 3).
        place: The same vertices on the base mesh, shape (N, 3).
        free: Weights from `ear_freedom`, shape (N,).
        side: "Left" or "Right".
        axis: Rotation vector in degrees for the left ear, shape (3,); the right ear mirrors it.
    """
    sign = 1.0 if side == "Left" else -1.0
    moved = np.where(sign * place[:, 0] > 0.0, free, 0.0) * (0.55 + 0.45 * ear_height(place))
    root = (free > 0.02) & (free < 0.4) & (sign * place[:, 0] > 0.0)
    hinge = vertices[root].mean(axis=0)
    # A mirrored rotation turns the other way about y and z.
    turns = moved[:, None] * (np.radians(axis) * [1.0, sign, sign])[None, :]
    moves: Floats = Rotation.from_rotvec(turns).apply(vertices - hinge) + hinge - vertices
    return moves
