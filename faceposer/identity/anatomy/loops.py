"""Loops and rings of edges in a mesh of quads, and in the subdivided skin of a head."""

from collections import defaultdict
from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from faceposer.geometry.subdivision import Subdivision

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

#: The ring around the eye of the lashes' roots, and the rings of the lid's edge.
LASH_RING = 13
LID_RINGS = (10, 11, 12, 13)
#: Rings around the eye that line the socket, hidden by the ball.
SOCKET_RINGS = LASH_RING - 4


def rings(quads: Ints, start: int, count: int) -> list[Ints]:
    """Return vertices by their distance in the mesh of ``quads`` (F, 4) from ``start``: that, and ``count`` rings."""
    ring = np.array([start])
    seen = ring
    found = [ring]
    for _ in range(count):
        touched = np.unique(quads[np.isin(quads, ring).any(axis=1)])
        ring = np.setdiff1d(touched, seen)
        seen = np.concatenate([seen, ring])
        found.append(ring.astype(np.int32))
    return found


def ordered_ring(quads: Ints, ring: Ints) -> Ints:
    """Return the vertices of a closed edge loop in order, starting with the first of ``ring``."""
    members = set(ring.tolist())
    onward = defaultdict(set)
    for a, b in np.stack([quads, np.roll(quads, -1, 1)], -1).reshape(-1, 2).tolist():
        if a in members and b in members:
            onward[a].add(b)
            onward[b].add(a)
    order = [int(ring[0]), min(onward[int(ring[0])])]
    while len(order) < len(members):
        (after,) = onward[order[-1]] - {order[-2]}
        order.append(after)
    return np.array(order, dtype=np.int32)


def faces_at_edges(quads: Ints, chosen: Iterable[int]) -> dict[frozenset[int], list[int]]:
    """Return the ids of the ``chosen`` quads at each edge."""
    faces_at: dict[frozenset[int], list[int]] = defaultdict(list)
    for face in chosen:
        corners = quads[face].tolist()
        for edge in zip(corners, corners[1:] + corners[:1], strict=True):
            faces_at[frozenset(edge)].append(face)
    return faces_at


def edge_loop(faces_at: dict[frozenset[int], list[int]], vertices: Floats, start: int) -> list[int]:
    """Follow the edges sideways from ``start``, straight through vertices of four edges, back to ``start``."""
    edges_at: dict[int, list[frozenset[int]]] = defaultdict(list)
    for edge in faces_at:
        for vertex in edge:
            edges_at[vertex].append(edge)

    def is_sideways(edge: frozenset[int]) -> bool:
        a, b = edge
        along = np.abs(vertices[a] - vertices[b])
        return bool(along[0] > along[1])

    edge = next(edge for edge in edges_at[start] if is_sideways(edge))
    loop = [start]
    vertex = start
    while True:
        (vertex,) = edge - {vertex}
        if vertex == loop[0]:
            return loop
        loop.append(vertex)
        adjacent = set(faces_at[edge])
        (edge,) = (other for other in edges_at[vertex] if adjacent.isdisjoint(faces_at[other]))


def among(fine: Subdivision, control: Ints) -> Ints:
    """Return the vertices of the mesh ``fine`` that subdivision derives from the old vertices ``control`` only."""
    share = np.zeros(fine.split.shape[1])
    share[control] = 1.0
    return np.flatnonzero(fine.split @ share > 1.0 - 1e-9).astype(np.int32)


def fine_loop(fine: Subdivision, loop: Ints) -> Ints:
    """Return a closed ``loop`` of old vertices of the mesh ``fine`` with those that subdivision inserts."""
    # Each quad starts at an old corner, and its second corner is the midpoint of the old edge that leaves there.
    corners = fine.quads[:, 0].reshape(-1, 4)
    after = np.roll(corners, -1, axis=1).ravel().tolist()
    edges = zip(corners.ravel().tolist(), after, strict=True)
    middle = {frozenset(edge): m for edge, m in zip(edges, fine.quads[:, 1].tolist(), strict=True)}
    pairs = zip(loop.tolist(), np.roll(loop, -1).tolist(), strict=True)
    return np.array([vertex for a, b in pairs for vertex in (a, middle[frozenset((a, b))])], dtype=np.int32)
