"""Teeth and gums, placed where the base mesh has its bands of teeth and moved as these are, and the tongue."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from faceposer.model.subject import ARKIT_SHAPES
from scripts.asset_building.head import compact, split_uv
from scripts.asset_building.piece import Floats, Ints, Piece, facing_away, grid_quads
from scripts.asset_building.source import BaseMesh
from scripts.asset_building.subdivision import catmull_clark

#: Widths and heights of the crowns in centimetres, from the middle to the first molar, and their depths.
_UPPER_WIDTH = np.array([0.86, 0.67, 0.77, 0.72, 0.69, 1.02])
_UPPER_HEIGHT = np.array([1.12, 0.98, 1.08, 0.92, 0.84, 0.78])
_LOWER_WIDTH = np.array([0.54, 0.60, 0.68, 0.72, 0.73, 1.10])
_LOWER_HEIGHT = np.array([0.86, 0.90, 1.00, 0.86, 0.78, 0.70])
_DEPTH = np.array([0.62, 0.60, 0.74, 0.84, 0.88, 1.02])
#: Depth of the cutting edge as a share of the crown's depth: incisors are thin there, molars are not.
_EDGE_SHARE = np.array([0.30, 0.30, 0.42, 0.80, 0.85, 0.90])
_AROUND = 8
_LEVELS = np.array([0.0, 0.30, 0.62, 0.88, 1.0])
_COLUMNS_PER_TOOTH = 4
#: The floor of the tongue in centimetres of the base mesh, how much of its height above is kept, and how it sinks.
_TONGUE_FLOOR, _TONGUE_FLATNESS, _TONGUE_DROP = 63.0, 0.45, 0.65
#: Where the lips meet in the base mesh, in centimetres.
_LIP_LINE = 65.95


@dataclass(frozen=True)
class Arch:
    """Half an ellipse in the plane of the bite, in centimetres of the base mesh.

    Attributes:
        half_width: At the open end.
        depth: From the open end to the front.
        back: Position in z of the open end.
        bite: Position in y of the cutting edges.
        up: +1 if the crowns grow upwards from the bite (upper jaw), else -1.
    """

    half_width: float
    depth: float
    back: float
    bite: float
    up: int

    def at(self, length: Floats) -> tuple[Floats, Floats, Floats]:
        """Return position, tangent (to the left) and outward normal at signed arc ``length`` from the front."""
        angle = np.linspace(-0.5, 0.5, 2001) * np.pi
        curve = np.stack([self.half_width * np.sin(angle), 0 * angle, self.back + self.depth * np.cos(angle)], axis=1)
        curve[:, 1] = self.bite
        run = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(curve, axis=0), axis=1))])
        run -= run[1000]
        position = np.stack([np.interp(length, run, curve[:, k]) for k in range(3)], axis=-1)
        t = np.interp(length, run, angle)
        tangent = np.stack([self.half_width * np.cos(t), 0 * t, -self.depth * np.sin(t)], axis=-1)
        tangent /= np.linalg.norm(tangent, axis=-1, keepdims=True)
        normal = np.stack([-tangent[..., 2], 0 * t, tangent[..., 0]], axis=-1)
        return position, tangent, normal


UPPER = Arch(half_width=2.75, depth=5.0, back=9.85, bite=65.45, up=1)
LOWER = Arch(half_width=2.55, depth=4.75, back=9.75, bite=65.75, up=-1)


def build_jaw(name: str, arch: Arch, rest_band: Floats, band: Floats, band_shapes: Floats) -> tuple[Piece, Piece]:
    """Return teeth and gums of one jaw.

    Args:
        name: "upper" or "lower".
        arch: Where the teeth stand in the unmodified base mesh.
        rest_band: The base mesh's band of teeth, unmodified, shape (n, 3).
        band: The same in the wanted identity.
        band_shapes: Its offsets per expression shape, shape (S, n, 3).
    """
    upper = arch.up > 0
    width, height = (_UPPER_WIDTH, _UPPER_HEIGHT) if upper else (_LOWER_WIDTH, _LOWER_HEIGHT)
    edges = np.concatenate([[0.0], np.cumsum(width)])
    crowns, crown_quads, crown_uv = [], [], []
    for side in (1, -1):
        for k in range(len(width)):
            points, quads, uv = _crown(arch, side * 0.5 * (edges[k] + edges[k + 1]), width[k], height[k], k)
            inside = np.broadcast_to(points.mean(axis=0), (len(quads), 3))
            crown_quads.append(facing_away(quads, points, inside) + sum(map(len, crowns)))
            crowns.append(points)
            crown_uv.append(uv)
    teeth = np.concatenate(crowns)
    gums, gum_quads, gum_uv = _gums(arch, edges, height)

    place = affine(rest_band, band)
    moves = [affine(rest_band, offsets) for offsets in band_shapes]

    def piece(kind: str, points: Floats, quads: Ints, uv: Floats) -> Piece:
        shapes = np.stack([move(points) for move in moves])
        return Piece(f"{kind}_{name}", kind, place(points), quads, uv, quads.copy(), shapes)

    return (
        piece("teeth", teeth, np.concatenate(crown_quads), np.concatenate(crown_uv)),
        piece("gums", gums, gum_quads, gum_uv),
    )


def build_tongue(base: BaseMesh, ids: Ints, rest: Floats, everyone: Floats, units: Floats) -> Piece:
    """Return the tongue of the base mesh, flattened: the source's fills the mouth up to the upper lip.

    Args:
        base: The base mesh.
        ids: The tongue's vertices in it, in rising order, shape (n,).
        rest: The base mesh in centimetres, shape (N, 3).
        everyone: The same in the wanted identity.
        units: Offsets per expression shape in the order of `ARKIT_SHAPES`, shape (S, N, 3).
    """
    chosen = base.groups == "helper-tongue"
    quads = np.searchsorted(ids, base.quads[chosen]).astype(np.int32)
    uv_ids, quad_uvs = compact(base.quad_uvs[chosen])
    flat = rest[ids].copy()
    flat[:, 1] = _TONGUE_FLOOR + (flat[:, 1] - _TONGUE_FLOOR) * _TONGUE_FLATNESS - _TONGUE_DROP
    # Stuck out, the front of the tongue lies between the lips, flatter than in the source, whatever its rest is.
    tongue_out = ARKIT_SHAPES.index("tongueOut")
    out = rest[ids] + units[tongue_out][ids]
    front = np.clip((out[:, 2] - 9.0) / 5.0, 0.0, 1.0)
    between_lips = _LIP_LINE + (out[:, 1] - _LIP_LINE) * _TONGUE_FLATNESS
    out[:, 1] = flat[:, 1] + front * (between_lips - flat[:, 1])
    place = affine(rest[ids], everyone[ids])
    offsets = [unit[ids] for unit in units]
    offsets[tongue_out] = place(out) - place(flat)
    fine = catmull_clark(quads, len(ids))
    uv = base.uv[uv_ids] - base.uv[uv_ids].min(axis=0)
    uv, fine_uvs = split_uv(0.02 + 0.96 * uv / uv.max(axis=0), quad_uvs)
    shapes = np.stack([fine.matrix @ offset for offset in offsets])
    return Piece("tongue", "tongue", fine.matrix @ place(flat), fine.quads, uv, fine_uvs, shapes)


def _crown(arch: Arch, length: float, width: float, height: float, k: int) -> tuple[Floats, Ints, Floats]:
    """Return one crown: rings from below the gum to the cutting edge, and a cap; u is the tooth, v the height."""
    position, tangent, normal = arch.at(np.array(length))
    angle = np.arange(_AROUND) * (2 * np.pi / _AROUND) + np.pi / _AROUND
    # A superellipse: corners rounder than a box, fuller than an ellipse.
    across = np.sign(np.cos(angle)) * np.abs(np.cos(angle)) ** 0.6
    through = np.sign(np.sin(angle)) * np.abs(np.sin(angle)) ** 0.6
    across, through = across / across.max(), through / through.max()
    rings = []
    for level in _LEVELS:
        neck = 1.0 - level
        half_width = 0.5 * width * (1.0 - 0.20 * neck**1.5 - (0.04 if level == 1.0 else 0.0))
        half_depth = 0.5 * _DEPTH[k] * (_EDGE_SHARE[k] + (1.0 - _EDGE_SHARE[k]) * min(1.0, neck * 1.5 + 0.05))
        # The front of the crown is upright, slightly rounded; the back slopes.
        shift = 0.5 * _DEPTH[k] - half_depth - 0.05 * neck**2 - (0.03 if level == 1.0 else 0.0)
        y = arch.up * height * (1.12 * neck - 0.0)
        point = k == 2 and level == 1.0
        ring = position + np.outer(across * half_width, tangent) + np.outer(through * half_depth + shift, normal)
        ring[:, 1] += y - arch.up * (0.05 * (1.0 - np.abs(across)) if point else 0.0)
        rings.append(ring)
    cap = rings[-1].mean(axis=0)
    cap[1] -= arch.up * (0.03 if k < 3 else -0.05)
    points = np.concatenate([*rings, [cap]])
    last = (len(_LEVELS) - 1) * _AROUND
    even = np.arange(0, _AROUND, 2)
    fan = np.stack(
        [np.full_like(even, len(points) - 1), last + even, last + even + 1, last + (even + 2) % _AROUND], axis=-1
    )
    quads = np.concatenate([grid_quads(len(_LEVELS), _AROUND, closed=True), fan]).astype(np.int32)
    u = (k + 0.5 + 0.42 * across) / len(_DEPTH)
    uv = np.concatenate([*(np.stack([u, np.full(_AROUND, level)], -1) for level in _LEVELS), [[(k + 0.5) / 6, 1.0]]])
    uv[:, 1] = 0.02 + 0.96 * uv[:, 1]
    return points, quads, uv


def _gums(arch: Arch, edges: Floats, height: Floats) -> tuple[Floats, Ints, Floats]:
    """Return the gum: a band along the arch, its margin scalloped around the crowns."""
    steps = np.linspace(0.0, 1.0, _COLUMNS_PER_TOOTH, endpoint=False)
    half = np.concatenate([e + w * steps for e, w in zip(edges[:-1], np.diff(edges), strict=True)] + [edges[-1:]])
    crown_height = np.interp(half, 0.5 * (edges[1:] + edges[:-1]), height)
    scallop = np.concatenate([np.tile(0.5 - 0.5 * np.cos(2 * np.pi * steps), len(height)), [0.0]])
    depth = np.interp(half, 0.5 * (edges[1:] + edges[:-1]), _DEPTH)
    length = np.concatenate([-half[:0:-1], half])
    crown_height, scallop, depth = (np.concatenate([a[:0:-1], a]) for a in (crown_height, scallop, depth))
    position, _, normal = arch.at(length)
    # Rows: from the outer fold over the margins of the gum, in front of and behind the crowns, to the inner fold.
    margin = crown_height * (0.91 + 0.14 * scallop)
    rows = [
        (0.5 * depth + 0.04, crown_height + 0.55),
        (0.5 * depth + 0.07, crown_height + 0.25),
        (0.5 * depth + 0.05, margin + 0.10),
        (0.5 * depth - 0.08, margin),
        (-0.5 * depth + 0.02, margin),
        (-0.5 * depth - 0.12, margin + 0.16),
        (-0.5 * depth - 0.20, crown_height + 0.70),
    ]
    points = np.concatenate(
        [position + normal * out[:, None] + np.stack([0 * rise, arch.up * rise, 0 * rise], -1) for out, rise in rows]
    )
    u = np.broadcast_to((length - length[0]) / (length[-1] - length[0]), (len(rows), len(length)))
    v = np.broadcast_to(np.linspace(0.0, 1.0, len(rows))[:, None], u.shape)
    quads = grid_quads(len(rows), len(length))
    core = position + np.stack([0 * margin, arch.up * (crown_height + 0.5), 0 * margin], -1)
    inside = core[quads[:, 0] % len(length)]
    return points, facing_away(quads, points, inside), np.stack([u, v], -1).reshape(-1, 2)


def affine(source: Floats, target: Floats) -> Callable[[Floats], Floats]:
    """Return the affine map that takes ``source`` (n, 3) to ``target`` (n, 3) in the sense of least squares."""
    coefficients = np.linalg.lstsq(_with_one(source), target, rcond=None)[0]
    return lambda points: _with_one(points) @ coefficients


def _with_one(points: Floats) -> Floats:
    return np.hstack([points, np.ones((len(points), 1))])
