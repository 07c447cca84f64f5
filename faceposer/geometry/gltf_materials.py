"""Names, pictures and texture coordinates of the materials of a glTF file."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from faceposer.errors import FacePoserError
from faceposer.geometry.gltf_file import GltfFile, GltfObject

_PICTURES = (b"\x89PNG\r\n\x1a\n", b"\xff\xd8\xff")


@dataclass(frozen=True, eq=False)
class Material:
    """What a mesh needs to know of its material.

    Attributes:
        name: Unlike those of all other materials; empty for no material.
        channel: Attribute with the coordinates of its colour picture.
        transform: Of those coordinates, homogeneous, shape (3, 3).
    """

    name: str = ""
    channel: str = "TEXCOORD_0"
    transform: NDArray[np.float64] | None = None


def material_names(file: GltfFile) -> list[str]:
    """Return a name for each material, none twice: materials without one are called by their number."""
    names: list[str] = []
    taken = set()
    for i, material in enumerate(file.all("materials")):
        name = material.name() or f"material {i + 1}"
        if name in taken:
            name = f"{name} ({i + 1})"
        taken.add(name)
        names.append(name)
    return names


def read_material(file: GltfFile, names: list[str], primitive: GltfObject) -> Material:
    """Return the material of ``primitive``, with the transform of KHR_texture_transform if it has one.

    Raises:
        FacePoserError: If it names a material that is not there, or its numbers are broken.
    """
    if primitive.data.get("material") is None:
        return Material()
    material = file.get("materials", primitive, "material")
    texture = _colour_texture(material)
    moved = texture.child("extensions").child("KHR_texture_transform")
    channel = moved.integer("texCoord", texture.integer("texCoord", 0))
    transform = None
    if moved.data:
        (dx, dy), (sx, sy) = moved.numbers("offset", [0, 0]), moved.numbers("scale", [1, 1])
        angle = moved.number("rotation", 0.0)
        c, s = np.cos(angle), np.sin(angle)
        transform = np.array([[c * sx, s * sy, dx], [-s * sx, c * sy, dy], [0, 0, 1]])
    return Material(names[primitive.integer("material")], f"TEXCOORD_{channel}", transform)


def texture_coordinates(
    file: GltfFile, material: Material, attributes: GltfObject, count: int
) -> NDArray[np.float64] | None:
    """Return the coordinates of ``count`` vertices in the colour picture, if any: v up as in OBJ, shape (N, 2).

    Raises:
        FacePoserError: If they are of another number, or one is not finite.
    """
    channel = material.channel if attributes.data.get(material.channel) is not None else "TEXCOORD_0"
    if attributes.data.get(channel) is None:
        return None
    uv = file.floats(attributes, channel, "VEC2").astype(np.float64)
    if len(uv) != count:
        raise attributes.error(f"{len(uv)} texture coordinates for {count} vertices")
    if material.transform is not None:
        with np.errstate(over="ignore", invalid="ignore"):
            uv = uv @ material.transform[:2, :2].T + material.transform[:2, 2]
    if not np.isfinite(uv).all():
        vertex = int(np.argmin(np.isfinite(uv).all(axis=1)))
        raise attributes.error(f"the texture coordinate of vertex {vertex + 1} is not finite")
    uv[:, 1] = 1 - uv[:, 1]
    return uv


def read_textures(file: GltfFile, names: list[str], used: set[str]) -> dict[str, bytes]:
    """Return the colour pictures, PNG or JPEG, of the materials called ``used``.

    Pictures in other forms (KTX2, WebP), missing, or broken are left out: a face can be posed without.
    """
    textures = {}
    for name, material in zip(names, file.all("materials"), strict=True):
        texture = _colour_texture(material)
        if name not in used or texture.data.get("index") is None:
            continue
        try:
            source = file.get("textures", texture, "index")
            if source.data.get("source") is None:
                continue
            image = file.get("images", source, "source")
            uri = image.text("uri")
            picture = file.resource(image, uri) if uri else bytes(file.view(image)[0])
        except FacePoserError:
            continue
        if picture.startswith(_PICTURES):
            textures[name] = picture
    return textures


def _colour_texture(material: GltfObject) -> GltfObject:
    texture = material.child("pbrMetallicRoughness").child("baseColorTexture")
    if texture.data:
        return texture
    return material.child("extensions").child("KHR_materials_pbrSpecularGlossiness").child("diffuseTexture")
