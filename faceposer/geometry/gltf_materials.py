"""Materials of a glTF file: names, colour textures and texture coordinates."""

from dataclasses import dataclass
from urllib.parse import unquote

import numpy as np
from numpy.typing import NDArray

from faceposer.errors import FacePoserError, counted
from faceposer.geometry.gltf_file import GltfFile, GltfObject
from faceposer.geometry.texture_images import TextureReader


@dataclass(frozen=True, eq=False)
class Material:
    """The properties of a material that affect the mesh.

    Attributes:
        name: Unique name; empty for no material.
        channel: Vertex attribute with the coordinates of the colour texture.
        transform: Homogeneous transform of these coordinates, shape (3, 3); None for the identity.
    """

    name: str = ""
    channel: str = "TEXCOORD_0"
    transform: NDArray[np.float64] | None = None


def material_names(file: GltfFile) -> list[str]:
    """Return a unique name for each material; materials without a name are numbered."""
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
    """Read the material of ``primitive``, including the transform of KHR_texture_transform.

    Raises:
        FacePoserError: If the material does not exist, or has invalid numbers.
    """
    if primitive.data.get("material") is None:
        return Material()
    material = file.get("materials", primitive, "material")
    texture = _colour_texture(material)
    extension = texture.child("extensions").child("KHR_texture_transform")
    channel = extension.integer("texCoord", texture.integer("texCoord", 0))
    transform = None
    if extension.data:
        (dx, dy), (sx, sy) = extension.numbers("offset", [0, 0]), extension.numbers("scale", [1, 1])
        angle = extension.number("rotation", 0.0)
        c, s = np.cos(angle), np.sin(angle)
        transform = np.array([[c * sx, s * sy, dx], [-s * sx, c * sy, dy], [0, 0, 1]])
    return Material(names[primitive.integer("material")], f"TEXCOORD_{channel}", transform)


def texture_coordinates(
    file: GltfFile, material: Material, attributes: GltfObject, count: int
) -> NDArray[np.float64] | None:
    """Return the coordinates of ``count`` vertices in the colour texture, v up as in OBJ, (count, 2), or None.

    Raises:
        FacePoserError: If their number differs, or one is not finite.
    """
    channel = material.channel if attributes.data.get(material.channel) is not None else "TEXCOORD_0"
    if attributes.data.get(channel) is None:
        return None
    uv = file.floats(attributes, channel, "VEC2").astype(np.float64)
    if len(uv) != count:
        raise attributes.error(f"{len(uv)} texture coordinates for {counted(count, 'vertex', 'vertices')}")
    if material.transform is not None:
        with np.errstate(over="ignore", invalid="ignore"):
            uv = uv @ material.transform[:2, :2].T + material.transform[:2, 2]
    if not np.isfinite(uv).all():
        vertex = int(np.argmin(np.isfinite(uv).all(axis=1)))
        raise attributes.error(f"the texture coordinate of vertex {vertex + 1} is not finite")
    uv[:, 1] = 1 - uv[:, 1]
    return uv


def read_textures(file: GltfFile, names: list[str], used: set[str]) -> tuple[dict[str, bytes], tuple[str, ...]]:
    """Return the encoded colour images, PNG or JPEG, of the materials named in ``used``, and notes for the user.

    Images that are missing, damaged or in formats that cannot be read (KTX2) are left out, as posing does not require
    them; other formats, such as WebP, are converted to PNG.
    """
    reader = TextureReader()
    for name, material in zip(names, file.all("materials"), strict=True):
        texture = _colour_texture(material)
        if name not in used or texture.data.get("index") is None:
            continue
        try:
            source = file.get("textures", texture, "index")
            extensions = source.child("extensions")
            # The extensions KHR_texture_basisu and EXT_texture_webp have a source of their own.
            holders = [source, *(extensions.child(key) for key in extensions.data)]
            holder = next((holder for holder in holders if holder.data.get("source") is not None), None)
            if holder is None:
                reader.problem(name, f"textures[{texture.integer('index')}]", "it has no image")
                continue
            image = file.get("images", holder, "source")
        except FacePoserError:
            reader.problem(name, texture.place, "it refers to a texture or an image that does not exist")
            continue
        uri = image.text("uri")
        title = image.place if not uri or uri.startswith("data:") else unquote(uri)
        if uri and (reason := file.unusable(uri)):
            reader.problem(name, title, reason)
            continue
        try:
            encoded = file.resource(image, uri) if uri else bytes(file.view(image)[0])
        except FacePoserError:
            reader.problem(name, title, "its data is missing or damaged")
            continue
        reader.read(name, title, encoded)
    return reader.textures, reader.notes


def _colour_texture(material: GltfObject) -> GltfObject:
    texture = material.child("pbrMetallicRoughness").child("baseColorTexture")
    if texture.data:
        return texture
    return material.child("extensions").child("KHR_materials_pbrSpecularGlossiness").child("diffuseTexture")
