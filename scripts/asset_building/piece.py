"""A piece of a character while it is being built."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from faceposer.model.character import Part

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]


@dataclass(frozen=True)
class Piece:
    """One part with its own vertex indices.

    Attributes:
        name: Name of the part.
        material: One of the character's materials.
        vertices: Positions in centimetres, shape (N, 3).
        quads: Vertex ids, shape (F, 4); a triangle ends in -1.
        uv: Texture coordinates, shape (U, 2).
        quad_uvs: Ids into ``uv``, shape (F, 4).
        shapes: Offsets of the expression shapes, shape (S, N, 3).
    """

    name: str
    material: str
    vertices: Floats
    quads: Ints
    uv: Floats
    quad_uvs: Ints
    shapes: Floats


@dataclass(frozen=True)
class Joined:
    """Pieces in one numbering: the fields of `Piece`, and the parts."""

    vertices: Floats
    quads: Ints
    uv: Floats
    quad_uvs: Ints
    shapes: Floats
    parts: tuple[Part, ...]


def join(pieces: list[Piece]) -> Joined:
    """Concatenate the vertices and polygons of ``pieces``."""
    parts, quads, quad_uvs = [], [], []
    n_vertices = n_uv = n_quads = 0
    for piece in pieces:
        stop = (n_quads + len(piece.quads), n_vertices + len(piece.vertices))
        parts.append(Part(piece.name, piece.material, (n_quads, stop[0]), (n_vertices, stop[1])))
        quads.append(np.where(piece.quads < 0, -1, piece.quads + n_vertices).astype(np.int32))
        quad_uvs.append(np.where(piece.quad_uvs < 0, -1, piece.quad_uvs + n_uv).astype(np.int32))
        n_quads, n_vertices = stop
        n_uv += len(piece.uv)
    return Joined(
        np.concatenate([piece.vertices for piece in pieces]),
        np.concatenate(quads),
        np.concatenate([piece.uv for piece in pieces]),
        np.concatenate(quad_uvs),
        np.concatenate([piece.shapes for piece in pieces], axis=1),
        tuple(parts),
    )


def grid_quads(rows: int, columns: int, *, closed: bool = False, first: int = 0) -> Ints:
    """Return the quads of a grid of vertices numbered row by row from ``first``.

    A quad's corners are (row, column), (row, column + 1), (row + 1, column + 1), (row + 1, column); ``closed`` joins
    the last column to the first.
    """
    row = np.arange(rows - 1)[:, None]
    column = np.arange(columns if closed else columns - 1)[None, :]
    after = (column + 1) % columns
    corners = [row * columns + column, row * columns + after, (row + 1) * columns + after, (row + 1) * columns + column]
    return (first + np.stack(corners, axis=-1)).reshape(-1, 4).astype(np.int32)


def facing_away(quads: Ints, points: Floats, inside: Floats) -> Ints:
    """Return ``quads``, reversed if they face towards ``inside``, one position per quad, shape (F, 3)."""
    p = points[quads]
    normal = np.cross(p[:, 2] - p[:, 0], p[:, 3] - p[:, 1])
    away = np.einsum("ij,ij->i", normal, p.mean(axis=1) - inside) > 0
    return np.where(away[:, None], quads, quads[:, [0, 3, 2, 1]]).astype(np.int32)
