"""Separate lids and eyeballs: hide the insides of the sockets in the balls, and keep the skin in front outside."""

import numpy as np
from scipy import sparse
from scipy.ndimage import gaussian_filter1d
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import cKDTree

from scripts.asset_building.eyes import surface_radius
from scripts.asset_building.falloff import ramp
from scripts.asset_building.head import LASH_RING, Skin
from scripts.asset_building.piece import Floats, Ints

#: Rings around the eye that line the socket, hidden by the ball, and their depth inside it.
_SOCKET_RINGS, _SOCKET_DEPTH = LASH_RING - 4, 0.96
#: Clearance in centimetres of lids from the ball, if they have it in the neutral face, and default distance around the
#: ball in which skin is corrected.
_CLEARANCE, _REACH = 0.07, 0.9
#: Overlap of closed lids in centimetres.
_LID_OVERLAP = 0.03
#: For coarse lids: distances of the upper edge in front of and below the lower one, and distance from the edges in
#: which lids follow them, in centimetres.
_LID_BEFORE, _LID_BELOW, _FOLLOWS = 0.02, 0.02, 0.6
#: For coarse lids: distance of the inner edges of closed lids behind the line where they meet, in centimetres.
_BEHIND = 0.1
#: Distances from the lids' edges over which the skin's motion with the gaze fades out, in centimetres.
_GAZE_REACH = (0.3, 2.0)


def socket_ids(skin: Skin, side: str) -> Ints:
    """Return the fine vertices that line the socket of ``side`` ("Left" or "Right") behind the lids."""
    rings = np.concatenate(skin.rings_left[: _SOCKET_RINGS + 1])
    share = np.zeros(len(skin.base_ids))
    share[rings if side == "Left" else skin.mirror[rings]] = 1.0
    return np.flatnonzero(skin.fine.split @ share > 1.0 - 1e-9).astype(np.int32)


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


def meet_exactly(vertices: Floats, blink: Floats, ring: Ints, centre: Floats, faces: Ints) -> Floats:
    """Return the shape ``blink`` (N, 3), changed so that the edges of both lids coincide at full strength.

    The line is halfway between the edges, with its corners at the vertices of the upper edge, in front of the lower
    one.

    Args:
        vertices: The neutral skin, shape (N, 3).
        blink: Offsets that nearly close the eye.
        ring: The closed loop along the lids' edges.
        centre: Centre of the eyeball, shape (3,).
        faces: Corners of the skin's triangles, shape (F, 3).
    """
    side = "Left" if centre[0] > 0.0 else "Right"
    posed = vertices + blink
    upper, lower = (half[np.argsort(posed[half, 0])] for half in upper_and_lower(vertices, ring, side))
    wanted = posed.copy()
    inner = upper[1:-1]
    wanted[inner] = 0.5 * (posed[inner] + _at(posed[lower], posed[inner, 0]))
    wanted[lower[1:-1]] = _at(wanted[upper], posed[lower[1:-1], 0])
    outwards = wanted[inner] - centre
    wanted[inner] += _LID_BEFORE * outwards / np.linalg.norm(outwards, axis=1, keepdims=True)
    wanted[inner, 1] -= _LID_BELOW
    ends = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    lengths = np.linalg.norm(vertices[ends[:, 0]] - vertices[ends[:, 1]], axis=1)
    graph = sparse.csr_array((lengths, ends.T), shape=(len(vertices), len(vertices)))
    away, _, nearest = dijkstra(graph, False, ring, return_predecessors=True, limit=_FOLLOWS, min_only=True)
    near = np.flatnonzero(np.isfinite(away))
    result = blink.copy()
    result[near] += (1.0 - away[near] / _FOLLOWS)[:, None] * (wanted - posed)[nearest[near]]
    return result


def tuck_inner_edge(vertices: Floats, blink: Floats, ring: Ints, inner: Ints, centre: Floats) -> Floats:
    """Return the shape ``blink`` (N, 3) of `meet_exactly` with the inner edges behind the line where lids meet.

    Args:
        vertices: The neutral skin, shape (N, 3).
        blink: Offsets that close the eye.
        ring: The closed loop along the lids' outer edges.
        inner: Vertices of the lids' inner edges.
        centre: Centre of the eyeball, shape (3,).
    """
    posed = vertices + blink
    upper, _ = upper_and_lower(vertices, ring, "Left" if centre[0] > 0.0 else "Right")
    away = _at(posed[upper[np.argsort(posed[upper, 0])]], posed[inner, 0]) - centre
    distance = np.linalg.norm(away, axis=1, keepdims=True)
    result = blink.copy()
    result[inner] = centre + away * (1.0 - _BEHIND / distance) - vertices[inner]
    return result


def _at(line: Floats, x: Floats) -> Floats:
    """Return the points with the given ``x`` (n,) on a ``line`` (m, 3) with ascending x, shape (n, 3)."""
    return np.column_stack([np.interp(x, line[:, 0], line[:, k]) for k in range(3)])


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
