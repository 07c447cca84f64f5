"""Low-poly inside of the mouth: a band with painted teeth for each jaw, palate, throat and tongue."""

import numpy as np
from numpy.typing import NDArray

from scripts.asset_building.dental_arch import LOWER, UPPER, Arch, MouthFrame
from scripts.asset_building.gums import build_throat, half_and_half
from scripts.asset_building.mouth import JawMotion, mouth_piece, tongue_piece
from scripts.asset_building.piece import Floats, Ints, Piece
from scripts.asset_building.raster import Noise, smoothstep
from scripts.asset_building.teeth import CrownShape

#: Number of teeth on a side, and of those with a column in their middle.
_TEETH, _WITH_MIDDLE = 6, 4
#: v of the rows: outer fold, margin of the gum, face, edge, inner edge, inner margin, palate or floor, its middle.
_V = (0.0, 0.40, 0.60, 0.78, 0.84, 0.90, 0.95, 1.0)
_THROAT_COLUMNS, _TONGUE_RINGS, _TONGUE_AROUND = 7, 12, 8


def build_simple_mouth(frame: MouthFrame, jaw: JawMotion) -> list[Piece]:
    """Return teeth with gums of both jaws, throat and tongue."""
    upper, lower = build_band(UPPER, frame), build_band(LOWER, frame)
    return [
        mouth_piece("teeth_upper", "teeth", upper, jaw.still),
        mouth_piece("teeth_lower", "teeth", lower, jaw.offsets),
        mouth_piece("throat", "gums", build_throat(frame, _THROAT_COLUMNS), jaw.still),
        tongue_piece(frame, jaw, _TONGUE_RINGS, _TONGUE_AROUND),
    ]


def build_band(arch: Arch, frame: MouthFrame) -> tuple[Floats, Ints, Floats]:
    """Return teeth, gum and palate or floor of a jaw: vertices (n, 3), quads (f, 4), texture coordinates (n, 2)."""
    touched: list[tuple[CrownShape, float]] = []
    count: list[float] = []
    for kind in range(_TEETH):
        shape = CrownShape(arch, kind)
        for u in (-1.0, 0.0) if kind < _WITH_MIDDLE else (-1.0,):
            touched.append((shape, u))
            count.append(kind + 0.5 + 0.5 * u)
    touched.append((CrownShape(arch, _TEETH - 1), 1.0))
    count.append(float(_TEETH))
    length = np.interp(count, np.arange(_TEETH + 1), arch.edges[: _TEETH + 1])
    line, normal = arch.at(length)
    tip = np.array([arch.tip[shape.kind] for shape, _ in touched])
    crown = np.array([shape.length for shape, _ in touched])
    between = np.array([abs(u) for _, u in touched])

    def outward(level: float, side: float) -> Floats:
        return np.array([float(shape.outward(np.array(level), np.array(side))) for shape, _ in touched])

    relief = np.array([float(shape.relief(np.array(0.8 * u), np.array(0.4))) for shape, u in touched])
    rows = (
        (outward(1.0, 1.0) + 0.10, tip + crown + 0.50),
        (outward(0.85, 1.0) + 0.03 - 0.04 * between, tip + crown * (0.92 - 0.30 * between)),
        (outward(0.5, 1.0) - 0.10 * between, tip + 0.48 * crown),
        (outward(0.0, 1.0) - 0.02 * between, tip + relief),
        (outward(0.0, -1.0), tip + relief),
        (outward(0.9, -1.0) - 0.04, tip + 0.9 * crown),
    )
    grid = [(line + out[:, None] * normal, height) for out, height in rows]
    points, quads = half_and_half(arch, frame, grid, np.array([0.55]))
    u = 0.5 + 0.48 * np.array(count) / _TEETH
    both = np.concatenate([1.0 - u[:0:-1], u])
    us = np.concatenate([*([both] * (len(_V) - 1)), u])
    vs = np.concatenate([*(np.full(len(both), v) for v in _V[:-1]), np.full(len(u), _V[-1])])
    return points, quads, np.stack([us, vs], axis=1)


def paint_bands(size: int = 256) -> NDArray[np.uint8]:
    """Return the bands' texture, shape (size, size, 3): u along the arch, v from gum over edge to inside."""
    row, column = np.mgrid[:size, :size].astype(np.float32)
    u, v = (column + 0.5) / size, 1.0 - (row + 0.5) / size
    across = np.abs(u - 0.5) / 0.48 * _TEETH
    # Position in the tooth: 0 at either side, 1 in the middle.
    bulge = 1.0 - np.abs(2.0 * (across % 1.0) - 1.0)
    noise = Noise(51)(np.stack([u * 12, v * 6, 0 * u], axis=-1), 0.6, 2)
    gum = np.maximum(smoothstep(0.02, -0.02, v - 0.40), smoothstep(0.885, 0.905, v))
    gap = smoothstep(0.16, 0.0, bulge) * smoothstep(0.92, 0.74, v)
    neck = smoothstep(0.56, 0.40, v)
    tooth = np.array([238, 230, 212], np.float32) - neck[..., None] * np.array([6, 12, 24], np.float32)
    tooth = tooth * (1.0 - 0.42 * gap - 0.18 * smoothstep(0.80, 0.90, v))[..., None]
    flesh = np.array([196, 112, 106], np.float32) * (1.0 + 0.05 * noise)[..., None]
    flesh = flesh * (1.0 - 0.25 * smoothstep(0.16, 0.0, v) - 0.35 * smoothstep(0.90, 1.0, v))[..., None]
    colour = tooth * (1.0 - gum[..., None]) + flesh * gum[..., None]
    # The cheeks shade the back of the mouth; the remaining light is red.
    colour = colour * (1.0 - smoothstep(1.8, 5.0, across)[..., None] * np.array([0.50, 0.60, 0.60], np.float32))
    return np.rint(np.clip(colour, 0, 255)).astype(np.uint8)
