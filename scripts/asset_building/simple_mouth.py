"""Teeth and gums of few polygons: a band for each jaw, on which they are painted."""

import numpy as np
from numpy.typing import NDArray

from scripts.asset_building.mouth import Arch, affine
from scripts.asset_building.piece import Floats, Piece, facing_away, grid_quads
from scripts.asset_building.raster import smoothstep

#: Half the length of the band, and how many columns it has.
_HALF_LENGTH, _COLUMNS = 4.6, 13
#: Rows of the band: how far outside the middle of the teeth, how far from the bite, and v in the texture.
_ROWS = ((0.28, 1.45, 0.0), (0.26, 0.80, 0.45), (0.06, 0.0, 0.78), (-0.34, 0.05, 0.86), (-0.46, 1.2, 1.0))
#: Teeth from the middle to the end, as widths.
_TEETH = (0.80, 0.64, 0.74, 0.76, 0.76, 0.90)


def build_band(name: str, arch: Arch, rest_band: Floats, band: Floats, band_shapes: Floats) -> Piece:
    """Return teeth and gums of one jaw; the arguments are those of `build_jaw`."""
    length = np.linspace(-_HALF_LENGTH, _HALF_LENGTH, _COLUMNS)
    position, _, normal = arch.at(length)
    rise = np.array([0.0, float(arch.up), 0.0])
    points = np.concatenate([position + normal * out + rise * height for out, height, _ in _ROWS])
    quads = grid_quads(len(_ROWS), _COLUMNS)
    inside = (position + rise * 0.8)[quads[:, 0] % _COLUMNS]
    quads = facing_away(quads, points, inside)
    u = np.tile(np.linspace(0.0, 1.0, _COLUMNS), len(_ROWS))
    v = np.repeat([v for _, _, v in _ROWS], _COLUMNS)
    place = affine(rest_band, band)
    shapes = np.stack([affine(rest_band, offsets)(points) for offsets in band_shapes])
    return Piece(f"teeth_{name}", "teeth", place(points), quads, np.stack([u, v], axis=1), quads.copy(), shapes)


def paint_bands(size: int = 256) -> NDArray[np.uint8]:
    """Return the bands' texture, shape (size, size, 3): u along the arch, v from gum over edge to inside."""
    row, column = np.mgrid[:size, :size].astype(np.float32)
    u, v = (column + 0.5) / size, 1.0 - (row + 0.5) / size
    across = np.abs(u - 0.5) * 2.0 * _HALF_LENGTH
    ends = np.concatenate([[0.0], np.cumsum(_TEETH)])
    # Where in its tooth: 0 at either side, 1 in the middle.
    bulge = np.interp(
        across,
        np.sort(np.concatenate([ends, 0.5 * (ends[1:] + ends[:-1])])),
        np.append(np.tile([0.0, 1.0], len(_TEETH)), 0.0),
    ).astype(np.float32)
    margin = 0.36 - 0.10 * smoothstep(0.0, 0.8, bulge)
    gum = smoothstep(0.02, -0.02, v - margin) + smoothstep(0.90, 0.95, v)
    gap = smoothstep(0.16, 0.0, bulge) * smoothstep(0.0, 0.08, v - margin)
    tooth = np.array([226, 219, 203], np.float32) * (1.0 - 0.30 * smoothstep(0.2, 4.5, across))[..., None]
    tooth = tooth * (1.0 - 0.55 * gap)[..., None]
    colour = tooth * (1.0 - gum[..., None]) + np.array([168, 86, 84], np.float32) * gum[..., None]
    return np.rint(np.clip(colour, 0, 255)).astype(np.uint8)
