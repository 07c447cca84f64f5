"""Locally subdivided meshes."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from faceposer.geometry.subdivision import Subdivision
from scripts.asset_building.piece import Ints, Piece


@dataclass(frozen=True)
class Reduced:
    """Mesh on a subset of the vertices of a subdivided one.

    Attributes:
        kept: Vertices of the subdivided mesh that it uses, ascending, shape (K,).
        polygons: Its faces as positions in ``kept``, shape (P, 4); a triangle ends in -1.
        corners: Flat index of each corner in the subdivided mesh's quads, shape (P, 4); -1 likewise.
    """

    kept: Ints
    polygons: Ints
    corners: Ints

    def index(self, n_vertices: int) -> Ints:
        """Return the new index of each of ``n_vertices`` old vertices, or -1, shape (N,)."""
        index = np.full(n_vertices, -1, dtype=np.int32)
        index[self.kept] = np.arange(len(self.kept), dtype=np.int32)
        return index

    def applied(self, piece: Piece) -> Piece:
        """Return ``piece`` of the subdivided mesh on this mesh."""
        quad_uvs = np.where(self.corners < 0, -1, piece.quad_uvs.ravel()[self.corners])
        used, local = np.unique(quad_uvs[quad_uvs >= 0], return_inverse=True)
        quad_uvs[quad_uvs >= 0] = local
        return Piece(
            piece.name,
            piece.material,
            piece.vertices[self.kept],
            self.polygons,
            piece.uv[used],
            quad_uvs.astype(np.int32),
            piece.shapes[:, self.kept],
        )


def refined_in_places(fine: Subdivision, chosen: NDArray[np.bool_]) -> Reduced:
    """Return the mesh with only some of the quads subdivided, without gaps.

    A quad adjacent to a subdivided one becomes three triangles around the new vertex on their common edge; one with
    two or more such edges is subdivided too.

    Args:
        fine: The mesh with all quads subdivided.
        chosen: Mask of the old quads to subdivide, shape (F,).
    """
    quads = fine.quads.reshape(-1, 4, 4)
    chosen = chosen.copy()
    while True:
        kept = np.zeros(fine.matrix.shape[0], dtype=bool)
        kept[quads[chosen].ravel()] = True
        halved = kept[quads[:, :, 1]] & ~chosen[:, None]
        more = halved.sum(axis=1) > 1
        if not more.any():
            break
        chosen |= more
    code = np.arange(fine.quads.size).reshape(-1, 4, 4)
    whole = ~chosen & ~halved.any(axis=1)
    split, edge = np.nonzero(halved)
    middle = code[split, edge, 1]
    a, b, c, d = (code[split, (edge + k) % 4, 0] for k in range(4))
    none = np.full_like(middle, -1)
    corners = np.concatenate(
        [
            code[chosen].reshape(-1, 4),
            code[whole][:, :, 0],
            *(np.stack([middle, one, other, none], axis=1) for one, other in ((b, c), (c, d), (d, a))),
        ]
    )
    return reduced(fine.quads, corners)


def reduced(quads: Ints, corners: NDArray[np.integer]) -> Reduced:
    """Return the mesh with the given ``corners`` (P, 4), flat indices into ``quads`` (F, 4)."""
    vertices = np.where(corners < 0, -1, quads.ravel()[corners])
    kept, local = np.unique(vertices[vertices >= 0], return_inverse=True)
    vertices[vertices >= 0] = local
    return Reduced(kept.astype(np.int32), vertices.astype(np.int32), corners.astype(np.int32))
