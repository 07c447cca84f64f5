"""Eyeballs: spheres with a cornea, rings of vertices around the gaze axis, turned by the gaze shapes."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from faceposer.identity.anatomy.eyeballs import GAZE, IRIS_ANGLE, ball_of, surface_radius
from scripts.asset_building.piece import Floats, Piece, facing_away, grid_quads

#: Angle of the border of the pupil from the gaze axis in degrees.
PUPIL_ANGLE = 7.5


@dataclass(frozen=True)
class EyeDetail:
    """Resolution of an eyeball: angles of its rings from the gaze axis, and the even number of vertices in each."""

    rings: tuple[float, ...]
    sectors: int


#: Pupil and iris end on a ring.
FULL_DETAIL = EyeDetail((PUPIL_ANGLE, 13.0, 18.5, IRIS_ANGLE, 30.0, 38.0, 48.0, 60.0, 75.0, 95.0, 125.0, 160.0), 28)
LOW_DETAIL = EyeDetail((PUPIL_ANGLE, 15.0, IRIS_ANGLE, 36.0, 56.0, 90.0), 14)
#: Angle from the gaze axis at the border of the texture, which has the axis in its middle.
TEXTURE_ANGLE = 100.0
TEXTURE_RADIUS = 0.49


def build_eye(
    side: str, centre: Floats, radius: float, shape_names: tuple[str, ...], detail: EyeDetail = FULL_DETAIL
) -> Piece:
    """Return the eyeball of ``side`` ("Left" or "Right") around ``centre`` (3,), looking along +z.

    Vertex 0 is the middle of the pupil.
    """
    sign = 1.0 if side == "Left" else -1.0
    rings, sectors = len(detail.rings), detail.sectors
    theta = np.radians(detail.rings)[:, None]
    phi = np.arange(sectors)[None, :] * (2 * np.pi / sectors)
    directions = np.stack(
        np.broadcast_arrays(np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)), -1
    )
    directions = np.concatenate([[[0.0, 0.0, 1.0]], directions.reshape(-1, 3), [[0.0, 0.0, -1.0]]])
    # The eyes mirror each other vertex by vertex.
    directions[:, 0] *= sign
    angle = np.degrees(np.arccos(np.clip(directions[:, 2], -1, 1)))
    local = directions * (radius * surface_radius(angle))[:, None]

    last = len(local) - 1
    sides = grid_quads(rings, sectors, closed=True, first=1)
    quads = np.concatenate([_cap(0, 1, sectors), sides, _cap(last, last - sectors, sectors)])
    quads = facing_away(quads, local, np.zeros((len(quads), 3)))
    reach = TEXTURE_RADIUS * np.minimum(angle / TEXTURE_ANGLE, 1.0)
    around = np.hypot(directions[:, 0], directions[:, 1])
    flat = directions[:, :2] / np.maximum(around, 1e-9)[:, None]
    shapes = np.zeros((len(shape_names), len(local), 3))
    for action, (about_x, about_y) in GAZE.items():
        turn = _rotation(about_x, sign * about_y)
        shapes[shape_names.index(f"eye{action}{side}")] = local @ (turn - np.eye(3)).T
    return Piece(f"eye_{side.lower()}", "eye", local + centre, quads, 0.5 + flat * reach[:, None], quads.copy(), shapes)


def turned_eye(vertices: Floats, side: str, strengths: dict[str, float]) -> Floats:
    """Return the offsets, shape (N, 3), of the eyeball ``vertices`` of `build_eye`, rotated by gaze shapes together.

    Args:
        vertices: The eyeball, shape (N, 3); its poles are its first and last vertices.
        side: "Left" or "Right".
        strengths: Strength of each gaze shape ("LookUp", ...).
    """
    sign = 1.0 if side == "Left" else -1.0
    about_x = sum(strength * GAZE[action][0] for action, strength in strengths.items())
    about_y = sum(strength * GAZE[action][1] for action, strength in strengths.items())
    centre, _ = ball_of(vertices)
    return (vertices - centre) @ (_rotation(about_x, sign * about_y) - np.eye(3)).T


def _cap(pole: int, first: int, sectors: int) -> NDArray[np.int32]:
    """Return quads between a pole and the ring of ``sectors`` that starts at ``first``, two sectors each."""
    even = np.arange(0, sectors, 2)
    return np.stack(
        [np.full_like(even, pole), first + even, first + even + 1, first + (even + 2) % sectors], axis=-1
    ).astype(np.int32)


def _rotation(about_x: float, about_y: float) -> Floats:
    x, y = np.radians(about_x), np.radians(about_y)
    turn_x = np.array([[1, 0, 0], [0, np.cos(x), -np.sin(x)], [0, np.sin(x), np.cos(x)]])
    turn_y = np.array([[np.cos(y), 0, np.sin(y)], [0, 1, 0], [-np.sin(y), 0, np.cos(y)]])
    return turn_y @ turn_x
