"""Mesh of the eyelashes: a strip along the edge of either lid."""

import numpy as np

from faceposer.identity.anatomy.lashes import lash_strips
from faceposer.identity.anatomy.lids import upper_and_lower
from scripts.asset_building.piece import Floats, Ints, Piece, grid_quads


def build_lashes(
    side: str, skin: Floats, skin_shapes: Floats, ring: Ints, lid: Ints, centre: Floats, length: float
) -> Piece:
    """Return the lashes of one eye, which grow from the closed ``ring`` of vertices; for the rest see `lash_strips`."""
    vertices, quads, uv, shapes = [], [], [], []
    halves = upper_and_lower(skin, ring, side)
    strips = lash_strips(side, skin, skin_shapes, halves, lid, centre, length)
    for (strip, offsets), is_upper in zip(strips, (True, False), strict=True):
        rows, roots = strip.shape[:2]
        t = np.linspace(0.0, 1.0, roots)
        v = (0.52 if is_upper else 0.02) + 0.46 * np.linspace(0.0, 1.0, rows)
        strip_quads = grid_quads(rows, roots, first=sum(map(len, vertices)))
        # The upper lashes are visible from above, the lower ones from below or in front; both from their outside.
        quads.append(strip_quads if (side == "Left") == is_upper else strip_quads[:, ::-1])
        vertices.append(strip.reshape(-1, 3))
        uv.append(np.stack(np.broadcast_arrays(t[None, :], v[:, None]), axis=-1).reshape(-1, 2))
        shapes.append(offsets.reshape(len(offsets), -1, 3))
    all_quads = np.concatenate(quads).astype(np.int32)
    return Piece(
        f"lashes_{side.lower()}",
        "lashes",
        np.concatenate(vertices),
        all_quads,
        np.concatenate(uv),
        all_quads.copy(),
        np.concatenate(shapes, axis=1),
    )
