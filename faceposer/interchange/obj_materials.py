"""Materials and textures of a character for OBJ: the material library (.mtl) and its images.

An imported character keeps the material names of its original file; only materials that its polygons use are written.
"""

import os
import re
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

from faceposer.files.reading import read_bytes
from faceposer.geometry.mtl_io import MtlMaterial, mtl_text, writable_name
from faceposer.geometry.polygon_mesh import Group
from faceposer.interchange.surfaces import base_colour, is_png, opacity, roughness
from faceposer.model.character import Character, Part
from faceposer.model.origin import Origin

# Specular reflection, as grey level; lashes have none.
_SPECULAR: dict[str, float] = {"skin": 0.15, "eye": 0.5, "teeth": 0.4, "gums": 0.3, "tongue": 0.25, "lashes": 0.0}
_DEFAULT_SPECULAR = 0.5
_WHITE = (1.0, 1.0, 1.0)
_SRGB_GAMMA = 2.2
# Characters of a material's name in the file name of its image; file systems allow about 255 bytes in all.
_LONGEST_LABEL = 40


@dataclass(frozen=True)
class ObjMaterials:
    """Materials of the polygons of a character.

    Attributes:
        groups: Ranges of the polygons of its OBJ file, with the names of their materials.
        materials: Each material once, without the file name of its image.
        images: Encoded image of each textured material, by the material's name.
    """

    groups: tuple[Group, ...]
    materials: tuple[MtlMaterial, ...]
    images: dict[str, bytes]


def materials_of(character: Character) -> ObjMaterials:
    """Return the materials of ``character``; none if its original file has none."""
    materials: dict[str, MtlMaterial] = {}
    images: dict[str, bytes] = {}
    if character.origin is None:
        groups = tuple(Group(part.name, part.polygons, _material_name(character, part)) for part in character.parts)
        owners: Iterator[tuple[Group, Part | None, bool]] = (
            (group, part, True) for group, part in zip(groups, character.parts, strict=True)
        )
    else:
        groups = character.origin.groups
        owners = _owners(character, character.origin)
    for group, part, is_textured in owners:
        name = group.material
        if not name or (name in materials and (name in images or not is_textured)):
            continue
        key = "" if part is None else part.name if part.name in character.textures else part.material
        image = character.textures.get(key) if is_textured else None
        materials[name] = _material(name, "skin" if part is None else part.material, image)
        if image is not None:
            images[name] = image
    return ObjMaterials(groups, tuple(materials.values()), images)


def _material_name(character: Character, part: Part) -> str:
    """Return the name of the material of ``part``; parts with a separate texture have a separate material."""
    if part.name not in character.textures or part.name == part.material:
        return part.material
    return f"{part.material}_{part.name}"


def _owners(character: Character, origin: Origin) -> Iterator[tuple[Group, Part | None, bool]]:
    """Yield each group of the file, its part, and True if the part's texture fits the group's texture coordinates.

    A part that joins several materials of the file has the texture of the first, and eyes without a texture get a
    built-in one, for which the file has no texture coordinates.
    """
    first: dict[str, str] = {}
    for group in origin.groups:
        ids = origin.vertex_ids[origin.polygons[slice(*group.polygons)].max(axis=1)]
        inside = ids[ids >= 0][:1].tolist()
        part = next((p for p in character.parts if inside and p.vertices[0] <= inside[0] < p.vertices[1]), None)
        if part is None:
            yield group, None, False
            continue
        is_first = first.setdefault(part.name, group.material) == group.material
        has_uvs = int(character.polygon_uvs[slice(*part.polygons)].max(initial=-1)) < len(origin.uv)
        yield group, part, is_first and has_uvs and len(origin.polygon_uvs) > 0


def _material(name: str, kind: str, image: bytes | None) -> MtlMaterial:
    # Blender's conversion of roughness to the specular exponent.
    exponent = 1000.0 * (1.0 - roughness(kind)) ** 2
    red, green, blue = (channel ** (1.0 / _SRGB_GAMMA) for channel in base_colour(kind))
    colour = (red, green, blue) if image is None else _WHITE
    transparent = image is not None and kind == "lashes" and is_png(image)
    specular = _SPECULAR.get(kind, _DEFAULT_SPECULAR)
    return MtlMaterial(name, colour, specular, exponent, transparent=transparent, opacity=opacity(kind))


def library_files(folder: Path, stem: str, materials: ObjMaterials, comment: str) -> dict[str, bytes]:
    """Return the contents of the material library and its images by file name, the library last.

    Images are named after ``stem`` and their material, such as smile_skin.jpg. If ``folder`` contains a different image
    of that name, for example one that was painted over, it is kept, and a number is added to the new name.

    Args:
        folder: Folder to which the files will be written.
        stem: Name of the OBJ file, or of the sequence, without suffix.
        materials: The materials.
        comment: First line of the library.
    """
    files: dict[str, bytes] = {}
    entries = []
    for material in materials.materials:
        image = materials.images.get(material.name)
        if image is not None:
            label = re.sub(r"[^\w.-]+", "_", material.name)[:_LONGEST_LABEL]
            suffix = ".png" if is_png(image) else ".jpg"
            name = _free_name(folder, writable_name(f"{stem}_{label}"), suffix, image, files)
            files[name] = image
            material = replace(material, picture=name)  # noqa: PLW2901
        entries.append(material)
    return files | {library_name(stem): mtl_text(entries, comment).encode(errors="replace")}


def library_name(stem: str) -> str:
    """Return the file name of the material library of the OBJ file or sequence ``stem``."""
    return f"{writable_name(stem)}.mtl"


def _free_name(folder: Path, stem: str, suffix: str, image: bytes, taken: dict[str, bytes]) -> str:
    """Return a file name for ``image`` that no other image has, in ``taken`` or in ``folder``."""
    existing = next((name for name, content in taken.items() if content == image), None)
    if existing is not None:
        return existing
    taken_names = {name.lower() for name in taken}
    number = 1
    while True:
        name = f"{stem}{suffix}" if number == 1 else f"{stem}_{number}{suffix}"
        if name.lower() not in taken_names and has_content(folder / name, image) is not False:
            return name
        number += 1


def has_content(path: Path, content: bytes) -> bool | None:
    """Return True if the file ``path`` exists with ``content``, False if with another, None if it does not exist."""
    try:
        return read_bytes(path, len(content)) == content
    except OSError:
        # A name that no file can have is free, so that writing it reports the error.
        return False if os.path.lexists(path) else None
