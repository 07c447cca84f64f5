"""Meshes with their colours, from characters and from files."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from faceposer.geometry.polygon_mesh import PolygonMesh, triangle_fans
from faceposer.landmarks.drawing import PLAIN, PaintedMesh
from faceposer.model.character import Character, Part
from faceposer.model.materials import BASE_COLOURS

_HIDDEN = ("lashes", "film")


def painted_character(character: Character, vertices: NDArray[np.floating] | None = None) -> PaintedMesh:
    """Return the mesh of ``character`` with its textures, without lashes; ``vertices``, (N, 3), replace the neutral."""
    return painted_parts(
        character.vertices if vertices is None else vertices,
        character.polygons,
        character.uv,
        character.polygon_uvs,
        character.parts,
        character.textures,
    )


def painted_parts(
    vertices: NDArray[np.floating],
    polygons: NDArray[np.int32],
    uv: NDArray[np.floating],
    polygon_uvs: NDArray[np.int32],
    parts: Sequence[Part],
    textures: Mapping[str, bytes],
) -> PaintedMesh:
    """Return the mesh of a character's ``parts``, as in `Character`, without lashes and films."""
    shown = [part for part in parts if part.material not in _HIDDEN]
    names = list(textures)
    colours = np.tile(np.array(PLAIN), (len(vertices), 1))
    chosen, image_of = [], []
    for part in shown:
        key = next((key for key in (part.name, part.material) if key in textures), None)
        if key is None and part.material != "skin":
            linear = np.array(BASE_COLOURS.get(part.material, (0.5, 0.5, 0.5)))
            colours[slice(*part.vertices)] = 255.0 * linear ** (1.0 / 2.2)
        chosen.append(np.arange(*part.polygons))
        image_of.append(np.full(part.polygons[1] - part.polygons[0], -1 if key is None else names.index(key)))
    rows = np.concatenate([*chosen, np.zeros(0, dtype=np.int64)]).astype(np.intp)
    return _painted(
        np.asarray(vertices, dtype=np.float64),
        polygons[rows],
        np.asarray(uv, dtype=np.float64),
        polygon_uvs[rows] if len(polygon_uvs) else polygon_uvs,
        np.concatenate([*image_of, np.zeros(0, dtype=np.int64)]).astype(np.intp),
        tuple(textures.values()),
        colours,
    )


def painted_file(mesh: PolygonMesh, textures: Mapping[str, bytes]) -> PaintedMesh:
    """Return a mesh read from a file, with ``textures`` by material."""
    names = list(textures)
    image_of = np.full(len(mesh.polygons), -1, dtype=np.intp)
    for group in mesh.groups:
        if group.material in textures:
            image_of[slice(*group.polygons)] = names.index(group.material)
    images = tuple(textures.values())
    uvs = mesh.polygon_uvs if len(mesh.polygon_uvs) == len(mesh.polygons) else np.zeros((0, 3), dtype=np.int32)
    colours = mesh.colours if len(mesh.colours) == len(mesh.vertices) else np.array(PLAIN)
    return _painted(mesh.vertices, mesh.polygons, mesh.uv, uvs, image_of, images, colours)


def _painted(
    vertices: NDArray[np.float64],
    polygons: NDArray[np.int32],
    uv: NDArray[np.float64],
    polygon_uvs: NDArray[np.int32],
    image_of: NDArray[np.intp],
    images: tuple[bytes, ...],
    colours: NDArray[np.float64],
) -> PaintedMesh:
    triangles = triangle_fans(polygons)
    if not (images and len(polygon_uvs) and len(uv)):
        return PaintedMesh(vertices, triangles, colours)
    corners = np.maximum((polygons >= 0).sum(axis=1) - 2, 0)
    ids = _fans(polygon_uvs, polygons)
    missing = (ids < 0).any(axis=1)
    textured = np.where(missing, -1, np.repeat(image_of, corners))
    return PaintedMesh(vertices, triangles, colours, uv[np.maximum(ids, 0)], textured, images)


def _fans(values: NDArray[np.int32], polygons: NDArray[np.int32]) -> NDArray[np.int32]:
    """Return the ``values`` of corners at the corners of the triangle fans of ``polygons``, shape (T, 3)."""
    face, last = np.nonzero(polygons[:, 2:] >= 0)
    return np.stack([values[face, 0], values[face, last + 1], values[face, last + 2]], axis=1)
