"""Materials and textures of a character for OBJ: the library (.mtl) and the pictures that it names.

A character from a file of its own keeps the names of that file's materials, of which only those are described that its
faces name.
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

# Strength of highlights, as grey level; lashes have none.
_SPECULAR: dict[str, float] = {"skin": 0.15, "eye": 0.5, "teeth": 0.4, "gums": 0.3, "tongue": 0.25, "lashes": 0.0}
_USUAL_SPECULAR = 0.5
_WHITE = (1.0, 1.0, 1.0)
_SRGB_GAMMA = 2.2
# Characters of a material's name in the file name of its picture; file systems take about 255 bytes in all.
_LONGEST_LABEL = 40


@dataclass(frozen=True)
class ObjMaterials:
    """What the faces of a character are made of.

    Attributes:
        groups: Runs of the faces of its OBJ file, with the names of their materials.
        materials: Each material once, without a file of its picture.
        pictures: Encoded picture of each material that has one, by its name.
    """

    groups: tuple[Group, ...]
    materials: tuple[MtlMaterial, ...]
    pictures: dict[str, bytes]


def materials_of(character: Character) -> ObjMaterials:
    """Return the materials of ``character``; none if its own file names none."""
    found: dict[str, MtlMaterial] = {}
    pictures: dict[str, bytes] = {}
    if character.origin is None:
        groups = tuple(Group(part.name, part.polygons, _material_name(character, part)) for part in character.parts)
        owners: Iterator[tuple[Group, Part | None, bool]] = (
            (group, part, True) for group, part in zip(groups, character.parts, strict=True)
        )
    else:
        groups = character.origin.groups
        owners = _owners(character, character.origin)
    for group, part, has_picture in owners:
        name = group.material
        if not name or (name in found and (name in pictures or not has_picture)):
            continue
        key = "" if part is None else part.name if part.name in character.textures else part.material
        picture = character.textures.get(key) if has_picture else None
        found[name] = _material(name, "skin" if part is None else part.material, picture)
        if picture is not None:
            pictures[name] = picture
    return ObjMaterials(groups, tuple(found.values()), pictures)


def _material_name(character: Character, part: Part) -> str:
    """Return the name of the material of ``part``: its own where it has a picture of its own."""
    if part.name not in character.textures or part.name == part.material:
        return part.material
    return f"{part.material}_{part.name}"


def _owners(character: Character, origin: Origin) -> Iterator[tuple[Group, Part | None, bool]]:
    """Yield each group of the file, the part that it is in, and whether the picture of the part is laid out for it.

    A part that joins several of the file's materials has the picture of its first, and eyes that had no picture have
    one of the program's, for which the file has no texture coordinates.
    """
    first: dict[str, str] = {}
    for group in origin.groups:
        ids = origin.vertex_ids[origin.polygons[slice(*group.polygons)].max(axis=1)]
        inside = ids[ids >= 0][:1].tolist()
        part = next((p for p in character.parts if inside and p.vertices[0] <= inside[0] < p.vertices[1]), None)
        if part is None:
            yield group, None, False
            continue
        own = first.setdefault(part.name, group.material) == group.material
        laid_out = int(character.polygon_uvs[slice(*part.polygons)].max(initial=-1)) < len(origin.uv)
        yield group, part, own and laid_out and len(origin.polygon_uvs) > 0


def _material(name: str, kind: str, picture: bytes | None) -> MtlMaterial:
    # Blender's correspondence of roughness and exponent.
    exponent = 1000.0 * (1.0 - roughness(kind)) ** 2
    red, green, blue = (channel ** (1.0 / _SRGB_GAMMA) for channel in base_colour(kind))
    colour = (red, green, blue) if picture is None else _WHITE
    transparent = picture is not None and kind == "lashes" and is_png(picture)
    specular = _SPECULAR.get(kind, _USUAL_SPECULAR)
    return MtlMaterial(name, colour, specular, exponent, transparent=transparent, opacity=opacity(kind))


def library_files(folder: Path, stem: str, looks: ObjMaterials, comment: str) -> dict[str, bytes]:
    """Return the contents of the library and of its pictures by the names of their files, the library last.

    Pictures are called after ``stem`` and their material, such as smile_skin.jpg. A picture in ``folder`` that has
    the name but is another, as after painting over it, is left alone: a number makes the name another one.

    Args:
        folder: Where they are to be written.
        stem: Name of the OBJ file, or of the sequence, without suffix.
        looks: The materials.
        comment: First line of the library.
    """
    files: dict[str, bytes] = {}
    materials = []
    for material in looks.materials:
        picture = looks.pictures.get(material.name)
        if picture is not None:
            label = re.sub(r"[^\w.-]+", "_", material.name)[:_LONGEST_LABEL]
            suffix = ".png" if is_png(picture) else ".jpg"
            chosen = _free_name(folder, writable_name(f"{stem}_{label}"), suffix, picture, files)
            files[chosen] = picture
            material = replace(material, picture=chosen)  # noqa: PLW2901
        materials.append(material)
    return files | {library_name(stem): mtl_text(materials, comment).encode(errors="replace")}


def library_name(stem: str) -> str:
    """Return the file name of the library of the OBJ file, or the sequence, ``stem``."""
    return f"{writable_name(stem)}.mtl"


def _free_name(folder: Path, stem: str, suffix: str, picture: bytes, taken: dict[str, bytes]) -> str:
    """Return the first name for ``picture`` that no other picture has, here or in ``folder``."""
    same = next((name for name, content in taken.items() if content == picture), None)
    if same is not None:
        return same
    lower = {name.lower() for name in taken}
    number = 1
    while True:
        name = f"{stem}{suffix}" if number == 1 else f"{stem}_{number}{suffix}"
        if name.lower() not in lower and holds(folder / name, picture) is not False:
            return name
        number += 1


def holds(path: Path, content: bytes) -> bool | None:
    """Return whether the file ``path`` holds ``content``, None if there is no such file."""
    try:
        return read_bytes(path, len(content)) == content
    except OSError:
        # A name that no file can have is free, so that writing it reports the error.
        return False if os.path.lexists(path) else None
