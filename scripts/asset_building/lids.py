"""Keeps lids and eyeballs apart: the sockets' insides are tucked into the balls, the skin in front stays outside."""

import numpy as np
from scipy.ndimage import gaussian_filter1d

from scripts.asset_building.head import LASH_RING, Skin
from scripts.asset_building.piece import Floats, Ints

#: Rings around the eye that line the socket and are hidden by the ball, and how deep inside it they are kept.
_SOCKET_RINGS, _SOCKET_DEPTH = LASH_RING - 4, 0.96
#: Clearance in centimetres that lids keep from the ball, where they have it in the neutral face, and how far around
#: the ball skin is looked after, unless told.
_CLEARANCE, _REACH = 0.07, 0.9
#: How far closed lids overlap, in centimetres.
_LID_OVERLAP = 0.03


def socket_ids(skin: Skin, side: str) -> Ints:
    """Return the fine vertices that line the socket of ``side`` ("Left" or "Right") behind the lids."""
    rings = np.concatenate(skin.rings_left[: _SOCKET_RINGS + 1])
    share = np.zeros(len(skin.base_ids))
    share[rings if side == "Left" else skin.mirror[rings]] = 1.0
    return np.flatnonzero(skin.fine.split @ share > 1.0 - 1e-9).astype(np.int32)


def tuck_socket(vertices: Floats, ids: Ints, centre: Floats, radius: float) -> Floats:
    """Return ``vertices`` (N, 3) with those of the socket moved inside the eyeball."""
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
        blink: Offsets that close the eye, here and there too far.
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

    Every shape is mended at full strength, and on the way there as well: the straight path of a lid cuts into the
    ball, deepest at half strength if the lid was clear of the ball before.

    Args:
        vertices: The neutral skin, shape (N, 3).
        shapes: Its offsets per shape.
        ids: The socket's vertices, which are hidden and left alone, shape (n,).
        centre: Centre of the ball, shape (3,).
        radius: Its radius.
        strengths: Those at which shapes are mended.
        reach: How far around the ball skin is looked after, in centimetres.
    """
    rest_distance = np.linalg.norm(vertices - centre, axis=1)
    near = (rest_distance > radius) & (rest_distance < radius + reach) & (vertices[:, 2] > centre[2] - 0.2)
    near[ids] = False
    chosen = np.flatnonzero(near)
    wanted = radius + np.minimum(rest_distance[chosen] - radius, _CLEARANCE)
    result = shapes.copy()
    for strength in strengths:
        away = vertices[chosen] + strength * result[:, chosen] - centre
        distance = np.linalg.norm(away, axis=2)
        lack = np.maximum(wanted - distance, 0.0) * shapes[:, chosen].any(axis=2)
        result[:, chosen] += (lack / distance / strength)[..., None] * away
    return result
