"""Vertices of the sockets, and the lids of coarse meshes."""

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import dijkstra

from faceposer.identity.anatomy.lids import upper_and_lower
from faceposer.identity.anatomy.loops import SOCKET_RINGS, among
from scripts.asset_building.head import Skin
from scripts.asset_building.piece import Floats, Ints

#: For coarse lids: distances of the upper edge in front of and below the lower one, and distance from the edges in
#: which lids follow them, in centimetres.
_LID_BEFORE, _LID_BELOW, _FOLLOWS = 0.02, 0.02, 0.6
#: For coarse lids: distance of the inner edges of closed lids behind the line where they meet, in centimetres.
_BEHIND = 0.1


def socket_ids(skin: Skin, side: str) -> Ints:
    """Return the fine vertices that line the socket of ``side`` ("Left" or "Right") behind the lids."""
    rings = np.concatenate(skin.rings_left[: SOCKET_RINGS + 1])
    return among(skin.fine, rings if side == "Left" else skin.mirror[rings])


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
