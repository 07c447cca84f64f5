"""Lids of the eyes: blinks that close, lids that follow the gaze, sockets inside the balls, skin in front of them."""

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d
from scipy.spatial import cKDTree

from faceposer.identity.anatomy.eyeballs import GAZE, surface_radius
from faceposer.identity.anatomy.falloff import ramp

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

#: Depth inside the ball of the part of the socket that it hides, in radii.
_SOCKET_DEPTH = 0.96
#: Clearance in centimetres of lids from the ball, if they have it in the neutral face, and default distance around the
#: ball in which skin is corrected.
_CLEARANCE, _REACH = 0.07, 0.9
#: Overlap of closed lids in centimetres.
_LID_OVERLAP = 0.03
#: Distances from the lids' edges over which the skin's motion with the gaze fades out, in centimetres.
_GAZE_REACH = (0.3, 2.0)
#: Shares of the eye's rotation of the upper and the lower lid, and fullness towards the corners. In the source, the
#: upper lid covers the pupil of an eye that looks up, and the lower one that of an eye that looks down.
_LIDS_FOLLOW = {"LookUp": (0.5, 0.25, 2.0), "LookDown": (0.65, 0.6, 3.0)}


def tuck_socket(vertices: Floats, ids: Ints, centre: Floats, radius: float) -> Floats:
    """Return ``vertices`` (N, 3) with the socket moved inside the eyeball."""
    result = vertices.copy()
    away = vertices[ids] - centre
    distance = np.linalg.norm(away, axis=1, keepdims=True)
    result[ids] = centre + away * np.minimum(1.0, _SOCKET_DEPTH * radius / distance)
    return result


def upper_and_lower(vertices: Floats, ring: Ints, side: str) -> tuple[Ints, Ints]:
    """Return upper and lower half of a ``ring`` around the eye of ``side``, each from its inner to its outer corner."""
    sign = 1.0 if side == "Left" else -1.0
    ring = np.roll(ring, -int(np.argmin(sign * vertices[ring, 0])))
    outer = int(np.argmax(sign * vertices[ring, 0]))
    one, other = ring[: outer + 1], np.concatenate([ring[:1], ring[: outer - 1 : -1]])
    return (one, other) if vertices[one, 1].mean() > vertices[other, 1].mean() else (other, one)


def close_exactly(vertices: Floats, blink: Floats, ring: Ints, side: str) -> Floats:
    """Return the shape ``blink`` (N, 3), scaled along the lid so that at full strength the lids just meet.

    Args:
        vertices: The neutral skin, shape (N, 3).
        blink: Offsets that close the eye, in places too far.
        ring: The closed loop along the lids' edges.
        side: "Left" or "Right".
    """
    halves = []
    for half in upper_and_lower(vertices, ring, side):
        order = half[np.argsort(vertices[half, 0])]
        halves.append((vertices[order, 0], vertices[order, 1], blink[order, 1]))
    (upper_x, upper_y, upper_rise), (lower_x, lower_y, lower_rise) = halves
    x = np.linspace(max(upper_x[0], lower_x[0]), min(upper_x[-1], lower_x[-1]), 41)[2:-2]
    gap = np.interp(x, upper_x, upper_y) - np.interp(x, lower_x, lower_y)
    closing = np.interp(x, lower_x, lower_rise) - np.interp(x, upper_x, upper_rise)
    scale = np.clip((gap + _LID_OVERLAP) / np.maximum(closing, 1e-3), 0.6, 1.1)
    smooth = gaussian_filter1d(scale, 3.0, mode="nearest")
    return blink * np.interp(vertices[:, 0], x, smooth)[:, None]


def gaze_lids(vertices: Floats, ring: Ints, centre: Floats) -> dict[str, Floats]:
    """Return the offsets, shape (N, 3), of lids that follow an eye looking up and down, by action ("LookUp", ...).

    Args:
        vertices: The neutral skin, shape (N, 3).
        ring: The closed loop along the lids' edges.
        centre: Centre of the eyeball, shape (3,).
    """
    return {
        action: following_gaze(vertices, ring, centre, GAZE[action][0], (upper, lower), fullness)
        for action, (upper, lower, fullness) in _LIDS_FOLLOW.items()
    }


def following_gaze(
    vertices: Floats, ring: Ints, centre: Floats, degrees: float, shares: tuple[float, float], fullness: float
) -> Floats:
    """Return the offsets of lids that follow an eye rotating about its horizontal axis, shape (N, 3).

    The skin turns with the eye by a share of its angle, most at the lids' edges and least at the corners, so that it
    remains on the ball (levator palpebrae and the retractors of the lower lid move with the recti).

    Args:
        vertices: The neutral skin, shape (N, 3).
        ring: The closed loop along the lids' edges.
        centre: Centre of the eyeball, shape (3,).
        degrees: Rotation of the eye; positive looks down.
        shares: Shares of this angle at the middle of the upper and of the lower lid's edge.
        fullness: Exponent of their falloff to zero at the corners: 2 is round, larger values are fuller.
    """
    side = "Left" if centre[0] > 0.0 else "Right"
    upper, lower = (half[np.argsort(vertices[half, 0])] for half in upper_and_lower(vertices, ring, side))
    corners = vertices[upper[[0, -1]]]
    line = np.interp(vertices[:, 0], corners[:, 0], corners[:, 1])
    across = np.clip((vertices[:, 0] - corners[:, 0].mean()) / (0.5 * np.ptp(corners[:, 0])), -1.0, 1.0)
    above = np.interp(vertices[:, 0], vertices[upper, 0], vertices[upper, 1]) - line
    below = line - np.interp(vertices[:, 0], vertices[lower, 0], vertices[lower, 1])
    height = vertices[:, 1] - line
    share = shares[0] * ramp(0.0, 1.0, height / np.maximum(above, 0.05))
    share += shares[1] * ramp(0.0, 1.0, -height / np.maximum(below, 0.05))
    away = cKDTree(vertices[ring]).query(vertices)[0]
    share *= (1.0 - ramp(*_GAZE_REACH, away)) * (1.0 - np.abs(across) ** fullness)
    angle = np.deg2rad(degrees) * share
    y, z = vertices[:, 1] - centre[1], vertices[:, 2] - centre[2]
    turned_y, turned_z = np.cos(angle) * y - np.sin(angle) * z, np.sin(angle) * y + np.cos(angle) * z
    return np.stack([np.zeros_like(y), turned_y - y, turned_z - z], axis=1)


def keep_clear(
    vertices: Floats,
    shapes: Floats,
    ids: Ints,
    centre: Floats,
    radius: float,
    strengths: tuple[float, ...] = (1.0, 0.5),
    reach: float = _REACH,
) -> Floats:
    """Return ``shapes`` (S, N, 3) with skin that would enter the eyeball pushed out of it.

    The eyeball looks ahead. Every shape is corrected at full strength and at intermediate strengths, since the straight
    path of a lid cuts into the ball, deepest at half strength.

    Args:
        vertices: The neutral skin, shape (N, 3).
        shapes: Its offsets per shape.
        ids: The hidden vertices of the socket, which are not changed, shape (n,).
        centre: Centre of the ball, shape (3,).
        radius: Its radius.
        strengths: Strengths at which shapes are corrected.
        reach: Distance around the ball in which skin is corrected, in centimetres.
    """
    rest_distance, surface = _distances(vertices - centre, radius)
    near = (rest_distance > radius) & (rest_distance < surface + reach) & (vertices[:, 2] > centre[2] - 0.2)
    near[ids] = False
    chosen = np.flatnonzero(near)
    clearance = np.minimum(rest_distance - surface, _CLEARANCE)[chosen]
    result = shapes.copy()
    for strength in strengths:
        away = vertices[chosen] + strength * result[:, chosen] - centre
        distance, surface = _distances(away, radius)
        lack = np.maximum(surface + clearance - distance, 0.0) * shapes[:, chosen].any(axis=2)
        result[:, chosen] += (lack / distance / strength)[..., None] * away
    return result


def _distances(away: Floats, radius: float) -> tuple[Floats, Floats]:
    """Return the distances of ``away`` (..., 3) from the centre of a ball looking ahead, and of its surface there."""
    distance = np.linalg.norm(away, axis=-1)
    angle = np.degrees(np.arccos(np.clip(away[..., 2] / np.maximum(distance, 1e-9), -1.0, 1.0)))
    return distance, radius * surface_radius(angle)
