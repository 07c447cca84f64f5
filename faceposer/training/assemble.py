"""Conversion of a file's mesh to the canonical form of characters."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from faceposer.geometry.alignment import Similarity
from faceposer.geometry.polygon_mesh import PolygonMesh
from faceposer.model.character import Part
from faceposer.model.character_file import load_character
from faceposer.model.origin import Origin
from faceposer.training.eyes import eye_uv
from faceposer.training.parts import PartedMesh, split_into_parts

Array = NDArray[np.float64]

# Length of the motion fingerprint that distinguishes coincident vertices.
_FINGERPRINTS = 4


@dataclass(frozen=True, eq=False)
class CanonicalMesh:
    """A file's mesh in the canonical axes, unit and vertex order, with the mapping back to the file.

    Attributes:
        vertices: Upright, in centimetres, shape (N, 3).
        polygons: Vertex ids, shape (F, 4).
        uv: Texture coordinates, shape (U, 2).
        polygon_uvs: Texture coordinate ids, shape (F, 4).
        parts: Parts of the mesh.
        textures: Encoded images by part or material.
        origin: The mesh as in the file.
        file_ids: One of the file's vertices for each vertex, shape (N,).
        regions: Vertex ids by the region names of the built-in characters, if known.
        resembles_man: True if the mesh aligns with the built-in man well enough to use his regions.
    """

    vertices: NDArray[np.float32]
    polygons: NDArray[np.int32]
    uv: NDArray[np.float32]
    polygon_uvs: NDArray[np.int32]
    parts: tuple[Part, ...]
    textures: Mapping[str, bytes]
    origin: Origin
    file_ids: NDArray[np.int32]
    regions: Mapping[str, NDArray[np.int32]] | None = None
    resembles_man: bool = True

    def displacements(self, of_file: NDArray[np.floating]) -> NDArray[np.float32]:
        """Convert displacements of the file's vertices, (..., M, 3), to those of this mesh, (..., N, 3)."""
        turned = of_file[..., self.file_ids, :] @ np.linalg.inv(self.origin.linear).T
        return turned.astype(np.float32)


def assemble(
    mesh: PolygonMesh, upright: Similarity, motion: NDArray[np.floating], textures: Mapping[str, bytes]
) -> CanonicalMesh:
    """Return ``mesh`` in canonical form.

    Args:
        mesh: The mesh as in the file, M vertices.
        upright: Similarity from the file's axes and unit to upright centimetres.
        motion: Sample displacements of its vertices, shape (k, M, 3).
        textures: Encoded images by material names of the file.
    """
    vertices = upright.apply(mesh.vertices)
    parted = split_into_parts(mesh, vertices, fingerprints(motion))
    positions = vertices[parted.file_ids]
    uv = mesh.uv if len(mesh.uv) else np.zeros((1, 2))
    uv, corner_uvs, images = _with_textures(parted, positions, uv, textures)
    inverse = upright.inverse()
    origin = Origin(
        float(inverse.scale) * inverse.rotation,
        mesh.vertices,
        parted.vertex_ids,
        mesh.polygons,
        mesh.uv,
        mesh.polygon_uvs,
        mesh.groups,
    )
    return CanonicalMesh(
        positions.astype(np.float32),
        parted.polygons,
        uv.astype(np.float32),
        corner_uvs,
        parted.parts,
        images,
        origin,
        parted.file_ids,
    )


def fingerprints(motion: NDArray[np.floating]) -> Array:
    """Return random projections of the displacements ``motion``, (f, M, 3), that distinguish vertices, shape (M, k)."""
    rng = np.random.default_rng(0)
    directions = rng.standard_normal((len(motion), 3, _FINGERPRINTS))
    numbers: Array = np.einsum("fmd,fdk->mk", motion, directions, optimize=True)
    return numbers


def _with_textures(
    parted: PartedMesh, vertices: Array, uv: Array, textures: Mapping[str, bytes]
) -> tuple[Array, NDArray[np.int32], dict[str, bytes]]:
    """Return texture coordinates, their ids and images; eyes without an image get those of the built-in man."""
    corner_uvs = parted.corner_uvs.copy()
    images: dict[str, bytes] = {}
    for part, material in zip(parted.parts, parted.materials, strict=True):
        if material in textures:
            images[part.name] = textures[material]
        elif part.material == "eye":
            corners = parted.polygons[slice(*part.polygons)]
            rows = np.where(corners >= 0, corners - part.vertices[0] + len(uv), -1)
            corner_uvs[slice(*part.polygons)] = rows
            uv = np.vstack([uv, eye_uv(vertices[slice(*part.vertices)])])
            images["eye"] = _default_eye_texture()
    return uv, corner_uvs, images


@lru_cache(maxsize=1)
def _default_eye_texture() -> bytes:
    return load_character("man").textures["eye"]
