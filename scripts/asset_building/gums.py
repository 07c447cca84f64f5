"""Gums around the teeth, with the hard palate above and the floor of the mouth below, and the throat."""

from dataclasses import dataclass

import numpy as np

from scripts.asset_building.dental_arch import N_KINDS, PREMOLAR, SECOND_MOLAR, Arch, MouthFrame, smooth
from scripts.asset_building.piece import Floats, Ints, grid_quads
from scripts.asset_building.teeth import CrownShape

#: Columns of the gum for each front tooth and each of those behind, as u on the crown: at the crown's own edges, so
#: that the two surfaces meet in a straight line from column to column.
_COLUMNS, _COLUMNS_BEHIND = (-1.0, -0.83, -0.49, 0.0, 0.49, 0.83), (-1.0, -0.7, 0.0, 0.7)
#: Height of the gum on the crown in its middle and between two teeth, as shares of the crown's length.
_ZENITH, _PAPILLA = 0.95, 0.68
#: Exponent of the margin's arch from its middle to the papilla: lower is rounder.
_SCALLOP = 2.8
#: Range around a crown, as u on it, in which the margin, the rounded edge above it and the attached gum follow its
#: surface; beyond, they bridge the gap to the next crown.
_MARGIN_FOLLOWS, _EDGE_FOLLOWS, _ATTACHED_FOLLOWS = 0.97, 0.92, 0.86
#: Length of the gum behind the last tooth, in centimetres.
_BEHIND = np.array([0.22, 0.50])
#: Rows from the outer fold over the margins to the beginning of palate and floor, as v of the texture.
_V_OUTSIDE = (0.0, 0.16, 0.31, 0.37, 0.40, 0.44)
_V_INSIDE = (0.48, 0.52, 0.56, 0.66)
#: Positions of the rows of palate and floor on the way to the middle; the last one is 1.
_ACROSS = np.array([0.28, 0.55, 0.80])
#: Distances behind the incisors along the middle, and height of the palate over the bite, in centimetres.
_VAULT = ((0.6, 1.1, 1.8, 2.6, 3.4, 5.0), (1.05, 1.25, 1.62, 1.90, 2.0, 1.95))
#: The same of the floor of the mouth, downwards.
_FLOOR = ((0.6, 1.4, 2.5, 5.0), (1.35, 1.75, 1.95, 2.1))


@dataclass(frozen=True)
class _Columns:
    """The n columns of one side of a gum from the middle backwards.

    Attributes:
        length: Lengths along the arch, shape (n,).
        shapes: Crowns that each column touches, with u on them: one, or two between teeth.
        margin: Height of the margin on the crown, as a share of its length, shape (n,).
        past: Distance behind the last tooth, in centimetres, shape (n,).
    """

    length: Floats
    shapes: list[list[tuple[CrownShape, float]]]
    margin: Floats
    past: Floats

    def mean(self, value: "list[list[float]]") -> Floats:
        return np.array([float(np.mean(one)) for one in value])


def build_gum(arch: Arch, frame: MouthFrame) -> tuple[Floats, Ints, Floats]:
    """Return gum and palate, or gum and floor, of a jaw: vertices (n, 3), quads (f, 4), texture coordinates (n, 2).

    u of the texture runs along the arch, v from the outer fold over the margins to the middle of palate or floor.
    """
    half = _columns(arch)
    rows = _rows(arch, half)
    line, normal = _line(arch, half)
    grid = [(line + out[:, None] * normal, height) for out, height in rows]
    points, quads = half_and_half(arch, frame, grid, _ACROSS)
    u = 0.5 + 0.48 * half.length / half.length[-1]
    both = np.concatenate([1.0 - u[:0:-1], u])
    v = [*_V_OUTSIDE, *_V_INSIDE, *(0.66 + 0.32 * _ACROSS), 0.98]
    # In the shared row both sides have the texture of the left one.
    uv = [np.stack([both, np.full(len(both), row)], axis=1) for row in v[:-1]]
    return points, quads, np.concatenate([*uv, np.stack([u, np.full(len(u), v[-1])], axis=1)])


def half_and_half(
    arch: Arch, frame: MouthFrame, grid: list[tuple[Floats, Floats]], across: Floats
) -> tuple[Floats, Ints]:
    """Return both sides of a jaw with the palate or the floor between them: vertices (n, 3) and quads (f, 4).

    Columns run from the right end over the middle to the left end. The last row is in the plane of symmetry and has
    only the columns of the left side.

    Args:
        arch: The jaw.
        frame: Frame of the mouth.
        grid: Rows of the left side, the outermost first: positions (c, 2) to the left and backwards, and distances
            from the bite towards the roots (c,); the first column is in the middle.
        across: Positions of the rows of palate or floor on the way to the middle, ascending below 1.
    """
    start, start_height = grid[-1]
    back = start[:, 1] + 0.62 * (1.0 - smooth(start[:, 1] / 5.0))
    deep = np.interp(back, *(_VAULT if arch.up > 0 else _FLOOR))
    sheet = []
    for share in (*across, 1.0):
        along = start[:, 1] + (back - start[:, 1]) * share
        rise = 1.0 - (1.0 - share) ** 2.2
        sheet.append((np.stack([start[:, 0] * (1.0 - share), along], 1), start_height + (deep - start_height) * rise))
    count = len(start)
    points = []
    for place, height in (*grid, *sheet[:-1]):
        left = frame.place(place[:, 0], place[:, 1], arch.up * height)
        right = frame.place(-place[:, 0], place[:, 1], arch.up * height)
        points.append(np.concatenate([right[:0:-1], left]))
    place, height = sheet[-1]
    points.append(frame.place(0.0 * height, place[:, 1], arch.up * height))
    columns, n_rows = 2 * count - 1, len(points) - 1
    first = (n_rows - 1) * columns
    middle = n_rows * columns + np.abs(np.arange(columns) - (count - 1))
    c = np.arange(columns - 1)
    inner = np.stack([first + c, first + c + 1, middle[c + 1], middle[c]], axis=1)
    quads = np.concatenate([grid_quads(n_rows, columns), inner])
    return np.concatenate(points), (quads if arch.up < 0 else quads[:, ::-1]).astype(np.int32)


def _columns(arch: Arch) -> _Columns:
    shapes = [CrownShape(arch, kind) for kind in range(N_KINDS)]
    lengths: list[float] = []
    touching: list[list[tuple[CrownShape, float]]] = []
    margins: list[float] = []
    for kind, shape in enumerate(shapes):
        start, stop = arch.edges[kind], arch.edges[kind + 1]
        for u in _COLUMNS if kind <= PREMOLAR else _COLUMNS_BEHIND:
            between = [(shape, u)]
            if u == -1.0:
                between.append((shapes[max(kind - 1, 0)], -1.0 if kind == 0 else 1.0))
            lengths.append(float(start + (stop - start) * (0.5 + 0.5 * u)))
            touching.append(between)
            margins.append(_ZENITH - (_ZENITH - _PAPILLA) * abs(u) ** _SCALLOP)
    end = float(arch.edges[-1])
    last = shapes[SECOND_MOLAR]
    lengths += [end, *(end + _BEHIND).tolist()]
    touching += [[(last, 1.0)]] * (1 + len(_BEHIND))
    margins += [0.55, *np.linspace(0.72, 1.0, len(_BEHIND)).tolist()]
    past = np.maximum(np.array(lengths) - end, 0.0)
    return _Columns(np.array(lengths), touching, np.array(margins), past)


def _line(arch: Arch, columns: _Columns) -> tuple[Floats, Floats]:
    """Return the positions of the columns and the outward normals, shape (n, 2) each.

    Crowns stand on tangents of the arch, and so does the gum around them; behind them it follows the arch itself.
    """
    line, normal = arch.at(columns.length)
    middle, outside = arch.at(0.5 * (arch.edges[1:] + arch.edges[:-1]))
    tangent = np.stack([-outside[:, 1], outside[:, 0]], axis=-1)
    for k in np.flatnonzero(columns.past == 0.0):
        if columns.length[k] > 0.0:
            touched = [(shape.kind, 0.5 * u * arch.width[shape.kind]) for shape, u in columns.shapes[k]]
            line[k] = np.mean([middle[kind] + along * tangent[kind] for kind, along in touched], axis=0)
            both = np.sum([outside[kind] for kind, _ in touched], axis=0)
            normal[k] = both / np.linalg.norm(both)
    return line, normal


def _rows(arch: Arch, columns: _Columns) -> list[tuple[Floats, Floats]]:
    """Return the distances of each row outside the arch's line and from the bite, outer fold first."""

    def out(level: Floats, side: float, follows: float) -> Floats:
        value = []
        for at, touched in zip(level, columns.shapes, strict=True):
            value.append(
                [float(shape.outward(np.array(at), side * _surface(shape, at, u, follows))) for shape, u in touched]
            )
        # Behind the last tooth the ridge narrows.
        narrow = 1.0 - 0.45 * smooth(columns.past / _BEHIND[-1])
        return columns.mean(value) * narrow

    def height(level: Floats) -> Floats:
        value = [
            [float(arch.tip[shape.kind] + at * shape.length) for shape, _ in touched]
            for at, touched in zip(level, columns.shapes, strict=True)
        ]
        return columns.mean(value)

    one = np.ones_like(columns.margin)
    behind = columns.past > 0.0
    margin_height = height(columns.margin)
    neck_height = height(one)
    bulge = np.minimum(columns.margin + 0.10, 1.0)
    attached = np.minimum(columns.margin + 0.26, 1.12)
    tuck = np.where(behind, 0.25, 1.0)
    sunk = np.where(behind, -0.03, 0.07)
    rows = []
    for side in (1.0, -1.0):
        base = _along(out(1.1 * one, side, _ATTACHED_FOLLOWS))
        # Below the surface of the crown, so that the gum meets it in a line.
        margin = out(columns.margin, side, _MARGIN_FOLLOWS) - side * np.where(behind, -0.014, 0.018)
        strip = [
            (base + (-0.06 if side > 0 else -0.16), neck_height + (0.50 if side > 0 else 0.42)),
            (base + (0.05 if side > 0 else -0.11), neck_height + (0.22 if side > 0 else 0.20)),
            (out(attached, side, _ATTACHED_FOLLOWS) + side * 0.05, np.maximum(height(attached), margin_height + 0.10)),
            (out(bulge, side, _EDGE_FOLLOWS) + side * 0.03, height(bulge)),
            (margin, margin_height),
            (margin * tuck - side * 0.13 * tuck, margin_height + sunk),
        ]
        if side < 0:
            strip = [strip[5], strip[4], strip[2], strip[0]]
        rows += strip
    return [(outside, _along(high) if k < 2 else high) for k, (outside, high) in enumerate(rows)]


def _surface(shape: CrownShape, level: float, u: float, follows: float) -> float:
    """Return v of the crown's outer side at ``level`` and the offset ``u`` from its middle on the arch."""
    half = 0.5 * shape.arch.width[shape.kind]
    on_crown = abs(u) * half / float(shape.half_width(np.array(level)))
    return float(shape.drawn_face_at(np.array(min(on_crown, follows))))


def _along(values: Floats, rounds: int = 6) -> Floats:
    """Return ``values`` along the arch smoothed; the middle is a mirror."""
    for _ in range(rounds):
        padded = np.concatenate([values[1:2], values, values[-1:]])
        values = 0.25 * padded[:-2] + 0.5 * padded[1:-1] + 0.25 * padded[2:]
    return values


def build_throat(frame: MouthFrame, n_columns: int = 21) -> tuple[Floats, Ints, Floats]:
    """Return soft palate with its uvula and the wall of the throat behind: vertices, quads, texture coordinates."""
    columns = np.linspace(-1.0, 1.0, n_columns)
    columns = np.sign(columns) * np.abs(columns) ** 1.7
    # The soft palate, from behind the hard one down to its free edge.
    back = np.array([3.9, 4.6, 5.2, 5.7, 6.1, 6.35, 6.45])
    middle = np.array([2.0, 1.97, 1.80, 1.42, 0.80, 0.15, -0.20])
    side = np.array([0.95, 0.85, 0.55, 0.0, -0.8, -1.8, -2.6])
    wide = np.array([2.45, 2.65, 2.70, 2.65, 2.55, 2.45, 2.40])
    hang = np.array([0.0, 0.0, 0.0, 0.02, 0.16, 0.55, 1.0])
    fall = np.abs(columns) ** 2.6
    x = np.outer(wide, columns)
    h = middle[:, None] - np.outer(middle - side, np.ones_like(columns)) * fall
    h = h - hang[:, None] * np.exp(-((x / 0.27) ** 4))
    forward = 0.22 * hang[:, None] * np.exp(-((x / 0.34) ** 2))
    soft = frame.place(x, back[:, None] - forward, h).reshape(-1, 3)
    # The wall: half a tube, wider than the opening, with its front edges hidden by the pillars.
    angle = 0.5 * np.pi * columns
    level = np.array([2.4, 1.2, 0.0, -1.2, -2.4, -3.8])
    bow = 1.0 - 0.10 * np.linspace(-1.0, 1.0, len(level)) ** 2
    wall = frame.place(
        np.outer(2.85 * bow, np.sin(angle)),
        5.9 + np.outer(0.7 + 1.3 * bow, np.cos(angle)),
        level[:, None],
    ).reshape(-1, 3)
    n = len(columns)
    one = grid_quads(len(back), n)
    other = grid_quads(len(level), n, first=len(soft))
    u = 0.02 + 0.48 * (columns + 1.0)
    v_soft, v_wall = np.linspace(0.02, 0.48, len(back)), np.linspace(0.52, 0.98, len(level))
    uv = np.concatenate([np.stack([np.tile(u, len(v)), np.repeat(v, n)], axis=1) for v in (v_soft, v_wall)])
    return np.concatenate([soft, wall]), np.concatenate([one, other])[:, ::-1], uv
