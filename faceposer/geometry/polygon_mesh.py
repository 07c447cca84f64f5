"""Meshes of polygons as files have them, with named groups of faces and morph targets."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Group:
    """A named run of faces.

    Attributes:
        name: Of the group; several runs may have the same.
        polygons: First face and the one after the last.
        material: Name of the material, if any.
    """

    name: str
    polygons: tuple[int, int]
    material: str = ""


def no_polygons(columns: int = 3) -> NDArray[np.int32]:
    """Return an empty table of faces."""
    return np.zeros((0, columns), dtype=np.int32)


@dataclass(frozen=True, eq=False)
class PolygonMesh:
    """A mesh as a file has it.

    Attributes:
        vertices: In the file's order and unit, shape (N, 3).
        polygons: Vertex indices per face in the file's order, shape (F, K); a face of fewer corners ends in -1.
        uv: Texture coordinates, v up as in OBJ, shape (U, 2); empty if the file has none.
        polygon_uvs: Indices into ``uv``, of the shape of ``polygons``; shape (0, 3) if there are none.
        normals: As the file lists them, shape (M, 3); empty if it has none.
        groups: Runs of faces, in order; what lies between them belongs to none.
    """

    vertices: NDArray[np.float64]
    polygons: NDArray[np.int32]
    uv: NDArray[np.float64] = field(default_factory=lambda: np.zeros((0, 2)))
    polygon_uvs: NDArray[np.int32] = field(default_factory=no_polygons)
    normals: NDArray[np.float64] = field(default_factory=lambda: np.zeros((0, 3)))
    groups: tuple[Group, ...] = ()

    def triangles(self) -> NDArray[np.int32]:
        """Return the faces as triangles about their first corner, shape (T, 3)."""
        return triangle_fans(self.polygons)


@dataclass(frozen=True, eq=False)
class MorphMesh:
    """A mesh with morph targets (blend shapes), as a file or a folder of files has them.

    Attributes:
        mesh: The neutral face.
        targets: Offsets of all vertices from the neutral, single precision, shape (N, 3), by the name in the file.
        textures: Encoded colour images (PNG or JPEG) by the name of their material.
    """

    mesh: PolygonMesh
    targets: Mapping[str, NDArray[np.float32]]
    textures: Mapping[str, bytes] = field(default_factory=dict)


def pad_polygons(faces: list[tuple[int, ...]]) -> NDArray[np.int32]:
    """Return ``faces`` as one array, shape (F, K) with K the most corners and at least 3, shorter ones ending in -1."""
    lengths = np.fromiter((len(face) for face in faces), dtype=np.intp, count=len(faces))
    padded = np.full((len(faces), max(3, int(lengths.max(initial=3)))), -1, dtype=np.int32)
    for length in np.unique(lengths).tolist():
        padded[lengths == length, :length] = [face for face in faces if len(face) == length]
    return padded


def triangle_fans(polygons: NDArray[np.int32]) -> NDArray[np.int32]:
    """Return ``polygons``, (F, K) padded with -1, as triangles about their first corners, shape (T, 3)."""
    columns = polygons.shape[1]
    fans = np.stack([polygons[:, [0, k, k + 1]] for k in range(1, columns - 1)], axis=1)
    triangles: NDArray[np.int32] = np.ascontiguousarray(fans[fans[:, :, 2] >= 0])
    return triangles
