"""Polygon meshes as stored in files, with named groups of faces and morph targets."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import chain

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Group:
    """A named range of faces.

    Attributes:
        name: Name of the group, not necessarily unique.
        polygons: Half-open range of faces (first, end).
        material: Name of the material, or "".
    """

    name: str
    polygons: tuple[int, int]
    material: str = ""


def no_polygons(columns: int = 3) -> NDArray[np.int32]:
    """Return an empty array of faces, shape (0, columns)."""
    return np.zeros((0, columns), dtype=np.int32)


@dataclass(frozen=True, eq=False)
class PolygonMesh:
    """A mesh as stored in a file.

    Attributes:
        vertices: Positions in the file's order and unit, shape (N, 3).
        polygons: Vertex indices of each face in the file's order, shape (F, K); faces of fewer corners end in -1.
        uv: Texture coordinates, v up as in OBJ, shape (U, 2); empty if the file has none.
        polygon_uvs: Indices into ``uv``, of the same shape as ``polygons``; shape (0, 3) if there are none.
        normals: Normals as listed in the file, shape (M, 3); empty if there are none.
        groups: Groups in the order of their faces; faces between them belong to no group.
        libraries: Names of the material libraries of an OBJ file.
        colours: Colours of the vertices, 0 to 255, shape (N, 3); empty if the file has none, or they are not read.
    """

    vertices: NDArray[np.float64]
    polygons: NDArray[np.int32]
    uv: NDArray[np.float64] = field(default_factory=lambda: np.zeros((0, 2)))
    polygon_uvs: NDArray[np.int32] = field(default_factory=no_polygons)
    normals: NDArray[np.float64] = field(default_factory=lambda: np.zeros((0, 3)))
    groups: tuple[Group, ...] = ()
    libraries: tuple[str, ...] = ()
    colours: NDArray[np.float64] = field(default_factory=lambda: np.zeros((0, 3)))

    def triangles(self) -> NDArray[np.int32]:
        """Return the faces split into triangle fans, shape (T, 3)."""
        return triangle_fans(self.polygons)


@dataclass(frozen=True, eq=False)
class MorphMesh:
    """A mesh with morph targets (blend shapes), as stored in a file or a folder of files.

    Attributes:
        mesh: The neutral face.
        targets: Offsets of all vertices from the neutral face, single precision, shape (N, 3), by name in the file.
        textures: Encoded colour images (PNG or JPEG) by material name.
        notes: Findings for the user, one sentence each.
        unusable: Reason, one sentence, why a target cannot be used, by its name.
    """

    mesh: PolygonMesh
    targets: Mapping[str, NDArray[np.float32]]
    textures: Mapping[str, bytes] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    unusable: Mapping[str, str] = field(default_factory=dict)


def pad_polygons(faces: list[tuple[int, ...]]) -> NDArray[np.int32]:
    """Return ``faces`` as an array of shape (F, K), padded with -1; K is the most corners and at least 3."""
    lengths = np.array([len(face) for face in faces], dtype=np.int32)
    return padded([np.fromiter(chain.from_iterable(faces), dtype=np.int32, count=int(lengths.sum()))], lengths)


def padded(corners: list[NDArray[np.int32]], lengths: NDArray[np.int32]) -> NDArray[np.int32]:
    """Return faces as an array of shape (F, K), padded with -1; K is the most corners and at least 3.

    Args:
        corners: Values of the corners of all faces, in parts.
        lengths: Number of corners of each face, shape (F,).
    """
    columns = max(3, int(lengths.max(initial=3)))
    values = np.concatenate([*corners, np.zeros(0, dtype=np.int32)])
    if len(values) == len(lengths) * columns:
        return values.reshape(-1, columns)
    faces = np.full((len(lengths), columns), -1, dtype=np.int32)
    faces[np.arange(columns) < lengths[:, None]] = values
    return faces


def triangle_fans(polygons: NDArray[np.int32]) -> NDArray[np.int32]:
    """Split ``polygons``, (F, K) padded with -1, into triangle fans around their first corners, shape (T, 3)."""
    if polygons.shape[1] == 3 and (polygons[:, 2] >= 0).all():
        return polygons.copy()
    # Memory follows the triangles, not the width of the array.
    face, last = np.nonzero(polygons[:, 2:] >= 0)
    return np.stack([polygons[face, 0], polygons[face, last + 1], polygons[face, last + 2]], axis=1)
