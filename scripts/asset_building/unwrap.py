"""Unwrap the skin: one chart for the outside of the head, small ones for the insides of mouth and sockets.

The chart of the base mesh gives the face very few texels, so the outside is unwrapped again, cut along the middle of
the back of the head: an embedding with convex border as in W. T. Tutte, "How to draw a graph" (1963), which has no
fold-overs for any positive weights. The weights are spring constants, increased over a few iterations for edges that
are too long and decreased for edges that are too short.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import spsolve

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

_ROUNDS = 8
_DAMPING = 0.5
#: Height above which the outside fills the texture; the insides of the mouth and the sockets are below it.
_STRIP = 0.11
_MARGIN = 0.004
#: Radius of the square's upper corners.
_ROUNDING = 0.42


@dataclass(frozen=True)
class Layout:
    """Texture coordinates of a mesh of quads: ``uv`` (U, 2) and, per quad corner, ids into it (F, 4)."""

    uv: Floats
    quad_uvs: Ints


def texel_density(vertices: Floats) -> Floats:
    """Return the relative texel density of each vertex of the base mesh's skin, per centimetre, shape (N,).

    Args:
        vertices: Positions in centimetres, shape (N, 3).
    """
    nose = vertices[vertices[:, 2].argmax()]
    density = 1.0 + 5.0 * np.exp(-((np.linalg.norm((vertices - nose + [0, 0, 3]) / [1, 1.2, 1], axis=1) / 7.0) ** 2))
    for spot, radius in (([3.0, 73.0, 14.0], 2.5), ([-3.0, 73.0, 14.0], 2.5), ([0.0, 66.3, 15.0], 3.0)):
        density += 3.0 * np.exp(-((np.linalg.norm(vertices - spot, axis=1) / radius) ** 2))
    return density


def unwrap_skin(vertices: Floats, quads: Ints, old: Layout, density: Floats) -> Layout:
    """Lay out the skin in the unit square.

    Args:
        vertices: Positions in centimetres, shape (N, 3), symmetric in x.
        quads: Vertex ids, shape (F, 4).
        old: The layout of the base mesh; its charts of the mouth's and sockets' insides are kept.
        density: Relative texel density of each vertex, per centimetre, shape (N,).
    """
    chart = _charts(old)
    # The insides are smaller charts of the old layout than head and neck, which are joined here.
    by_depth = {c: vertices[quads[chart == c].ravel(), 2].mean() for c in np.unique(chart)}
    crown, neck = vertices[quads, 1].mean(axis=1).argmax(), vertices[quads, 1].mean(axis=1).argmin()
    outside = np.isin(chart, [chart[crown], chart[neck]])
    inner = sorted((c for c in by_depth if c not in (chart[crown], chart[neck])), key=lambda c: -(chart == c).sum())

    uv, quad_uvs = [], np.empty_like(quads)
    flat = _unwrap_outside(vertices, quads[outside], density)
    scale = np.array([1.0 - 2 * _MARGIN, 1.0 - _STRIP - _MARGIN])
    uv.append(flat.uv * scale + [_MARGIN, _STRIP])
    quad_uvs[outside] = flat.quad_uvs
    used = len(flat.uv)
    left = _MARGIN
    for c in inner:
        ids, local = np.unique(old.quad_uvs[chart == c], return_inverse=True)
        piece = old.uv[ids] - old.uv[ids].min(axis=0)
        height = _STRIP - 3 * _MARGIN
        piece *= height / piece[:, 1].max()
        uv.append(piece + [left, _MARGIN])
        left += float(piece[:, 0].max()) + 2 * _MARGIN
        quad_uvs[chart == c] = local.reshape(-1, 4) + used
        used += len(ids)
    return Layout(np.concatenate(uv), quad_uvs)


def _charts(layout: Layout) -> Ints:
    """Return a chart number for each quad, shape (F,)."""
    n = len(layout.uv)
    corners = layout.quad_uvs
    links = sparse.coo_array((np.ones(corners.size), (corners.ravel(), np.roll(corners, -1, 1).ravel())), shape=(n, n))
    _, label = connected_components(links, directed=False)
    chart: Ints = label[corners[:, 0]]
    return chart


def _unwrap_outside(vertices: Floats, quads: Ints, density: Floats) -> Layout:
    ids, local = np.unique(quads, return_inverse=True)
    local = local.reshape(-1, 4).astype(np.int32)
    points, density = vertices[ids], density[ids]
    local, copied = _cut_back(points, local)
    points, density = np.concatenate([points, points[copied]]), np.concatenate([density, density[copied]])

    loops = _border_loops(local)
    loop = max(loops, key=lambda hole: np.linalg.norm(np.diff(points[hole], axis=0), axis=1).sum())
    # A hole is closed by a fan around a new vertex, so that the embedding's guarantee holds.
    holes = [hole for hole in loops if hole is not loop]
    n = len(points)
    spokes = np.array([(n + k, v) for k, hole in enumerate(holes) for v in hole], dtype=np.int32).reshape(-1, 2)
    centres = np.array([points[hole].mean(axis=0) for hole in holes]).reshape(-1, 3)
    density = np.concatenate([density, np.ones(len(holes))])
    uv = _embed(np.concatenate([points, centres]), local, spokes, loop, _on_square(points, loop), density)
    return Layout(uv[:n], local)


def _cut_back(points: Floats, quads: Ints) -> tuple[Ints, Ints]:
    """Cut the mesh along x = 0 from the crown down the back to the neck's border.

    Returns:
        The quads, in which those of the character's right use new vertices along the cut, and the old ids of these.
    """
    crown = int(points[:, 1].argmax())
    middle = np.flatnonzero(np.abs(points[:, 0]) < 1e-6)
    neighbours = {int(v): set() for v in middle}
    for a, b in np.stack([quads, np.roll(quads, -1, 1)], -1).reshape(-1, 2).tolist():
        if a in neighbours and b in neighbours:
            neighbours[a].add(b)
            neighbours[b].add(a)
    path = [crown]
    here = min(neighbours[crown], key=lambda v: points[v, 2])
    while True:
        onward = [v for v in neighbours[here] if v != path[-1]]
        path.append(here)
        if not onward:
            break
        (here,) = onward
    copied = np.array(path[1:], dtype=np.int32)
    to_copy = np.arange(len(points), dtype=np.int32)
    to_copy[copied] = len(points) + np.arange(len(copied))
    on_right = points[quads, 0].mean(axis=1) < 0
    return np.where(on_right[:, None], to_copy[quads], quads).astype(np.int32), copied


def _border_loops(quads: Ints) -> list[list[int]]:
    directed = np.stack([quads, np.roll(quads, -1, 1)], -1).reshape(-1, 2).tolist()
    have = set(map(tuple, directed))
    onward = {a: b for a, b in have if (b, a) not in have}
    loops = []
    while onward:
        start, here = onward.popitem()
        loop = [start]
        while here != start:
            loop.append(here)
            here = onward.pop(here)
        loops.append(loop)
    return loops


def _on_square(points: Floats, loop: list[int]) -> Floats:
    """Place the outer border on the unit square: the neck at the bottom, the seam up the sides and along the top.

    The upper corners are rounded: the surface around a sharp one would be laid out with a crease.

    Returns:
        One position per vertex of ``loop``, shape (L, 2).
    """
    p = points[loop]
    crown = int(p[:, 1].argmax())
    order = np.roll(np.arange(len(loop)), -crown)
    middle = np.flatnonzero(np.abs(p[order, 0]) < 1e-6)
    # The seam's two sides are the unbroken runs of x = 0 after and before the crown; the neck lies between.
    gaps = np.flatnonzero(np.diff(middle) > 1)
    first_end, second_start = int(middle[gaps[0]]), int(middle[gaps[-1] + 1])
    steps = np.linalg.norm(np.diff(p[np.append(order, order[0])], axis=0), axis=1)
    run = np.concatenate([[0.0], np.cumsum(steps)])
    down = run[: first_end + 1] / run[first_end]
    along = (run[first_end : second_start + 1] - run[first_end]) / (run[second_start] - run[first_end])
    up = (run[second_start:] - run[second_start]) / (run[-1] - run[second_start])
    # Seen from outside, counter-clockwise: the crown's left neighbourhood comes first.
    path_down = _rounded_quarter()
    at = np.linspace(0.0, 1.0, len(path_down))
    seam = np.stack([np.interp(down, at, path_down[:, k]) for k in range(2)], axis=1)
    bottom = np.stack([along, np.zeros_like(along)], axis=1)
    back = np.stack([1.0 - np.interp(1.0 - up, at, path_down[:, 0]), np.interp(1.0 - up, at, path_down[:, 1])], axis=1)
    placed = np.concatenate([seam[:-1], bottom[:-1], back[:-1]])
    result = np.empty_like(placed)
    result[order] = placed
    return result


def _rounded_quarter() -> Floats:
    """Return evenly spaced points from the top middle of the square around its left corner to the bottom, (n, 2)."""
    turn = np.linspace(0.0, np.pi / 2.0, 40)
    arc = _ROUNDING + _ROUNDING * np.stack([-np.sin(turn), np.cos(turn)], axis=1) + [0.0, 1.0 - 2.0 * _ROUNDING]
    corners = np.concatenate([[[0.5, 1.0]], arc, [[0.0, 0.0]]])
    run = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(corners, axis=0), axis=1))])
    steps = np.linspace(0.0, run[-1], 400)
    return np.stack([np.interp(steps, run, corners[:, k]) for k in range(2)], axis=1)


def _embed(points: Floats, quads: Ints, spokes: Ints, loop: list[int], border: Floats, density: Floats) -> Floats:
    """Return the embedding, shape (N, 2), with fixed ``border`` and edges about as long as in space times density."""
    n = len(points)
    sides = np.stack([quads, np.roll(quads, -1, 1)], -1).reshape(-1, 2)
    pairs = np.unique(np.sort(np.concatenate([sides, spokes]), axis=1), axis=0)
    i, j = np.concatenate([pairs, pairs[:, ::-1]]).T
    wanted = np.maximum(np.linalg.norm(points[i] - points[j], axis=1), 0.02) * 0.5 * (density[i] + density[j])
    stiffness = 1.0 / wanted
    fixed = np.zeros(n, dtype=bool)
    fixed[loop] = True
    uv = np.zeros((n, 2))
    uv[loop] = border
    for _ in range(_ROUNDS):
        springs = sparse.csr_array((stiffness, (i, j)), shape=(n, n))
        laplacian = sparse.csr_array(sparse.diags_array(springs.sum(axis=1)) - springs)
        uv[~fixed] = spsolve(laplacian[~fixed][:, ~fixed].tocsc(), springs[~fixed][:, fixed] @ uv[fixed])
        ratio = np.linalg.norm(uv[i] - uv[j], axis=1) / wanted
        stiffness = stiffness * np.clip(ratio / np.median(ratio), 1e-3, 1e3) ** _DAMPING
    return uv
