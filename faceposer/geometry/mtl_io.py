"""Material libraries for Wavefront OBJ (MTL): written, and read for their colour textures."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from faceposer.files.reading import read_bytes
from faceposer.geometry.polygon_mesh import PolygonMesh
from faceposer.geometry.texture_images import TextureReader, UnusableImageError, file_in

_MAX_LIBRARY_BYTES = 16 << 20
_MAX_TEXTURE_BYTES = 256 << 20
_MAX_TOTAL_BYTES = 512 << 20
# Number of arguments of the options before the file name of a texture; those of -o, -s and -t are one to three.
_OPTIONS = {"-blendu": 1, "-blendv": 1, "-boost": 1, "-mm": 2, "-o": 3, "-s": 3, "-t": 3, "-texres": 1, "-clamp": 1}
_OPTIONS |= {"-bm": 1, "-imfchan": 1, "-type": 1, "-cc": 1}
# Statements with an image besides those that begin with "map_".
_IMAGE_STATEMENTS = ("bump", "disp", "decal", "refl", "norm")
# Control characters, line ends and surrogates, which names cannot contain.
_UNWRITABLE = re.compile(r"[\x00-\x1f\x7f\x85\u2028\u2029\ud800-\udfff]")


@dataclass(frozen=True)
class MtlMaterial:
    """A Phong material in MTL.

    Attributes:
        name: Name, as in ``usemtl``.
        diffuse: Kd, sRGB colour from 0 to 1, multiplied with the texture.
        specular: Ks, grey level from 0 to 1.
        exponent: Ns, exponent of the highlight, 0 to 1000.
        picture: File name of the colour texture in the folder of the library; "" for none.
        transparent: True to use the alpha channel of the texture as opacity.
        opacity: d, 0 to 1.
    """

    name: str
    diffuse: tuple[float, float, float]
    specular: float
    exponent: float
    picture: str = ""
    transparent: bool = False
    opacity: float = 1.0


def writable_name(name: str) -> str:
    """Return ``name`` with underscores for all characters that OBJ and MTL cannot represent."""
    return _UNWRITABLE.sub("_", name)


def mtl_text(materials: Sequence[MtlMaterial], comment: str = "") -> str:
    """Return the content of a material library; ``comment`` is its first line."""
    lines = [f"# {comment}"] if comment else []
    for material in materials:
        red, green, blue = material.diffuse
        lines += [
            "",
            f"newmtl {writable_name(material.name)}",
            f"Kd {red:.4f} {green:.4f} {blue:.4f}",
            f"Ks {material.specular:.4f} {material.specular:.4f} {material.specular:.4f}",
            f"Ns {material.exponent:.2f}",
            f"d {material.opacity:g}",
            "illum 2",
        ]
        if material.picture:
            lines.append(f"map_Kd {material.picture}")
            lines += [f"map_d {material.picture}"] if material.transparent else []
    return "\n".join(lines) + "\n"


def read_obj_textures(obj: Path, mesh: PolygonMesh) -> tuple[dict[str, bytes], tuple[str, ...]]:
    """Return the encoded colour textures (PNG or JPEG) of an OBJ file's materials by name, and notes for the user.

    Libraries and images are searched in the folder of the OBJ file and below it; a path of another computer is reduced
    to its last part. Colours without an image are not read.

    Args:
        obj: Path of the OBJ file.
        mesh: Its mesh.
    """
    reader = TextureReader()
    wanted = {group.material for group in mesh.groups} - {""}
    notes: list[str] = []
    images: dict[str, str] = {}
    for names in mesh.libraries if wanted else ():
        for library in _library_files(obj.parent, names, notes):
            try:
                text = read_bytes(library, _MAX_LIBRARY_BYTES).decode("utf-8-sig", "replace")
            except OSError as error:
                notes.append(f"The material library '{library.name[:80]}' cannot be read: {error.strerror}.")
                continue
            images = _colour_images(text) | images
    total = 0
    for material in sorted(wanted & images.keys()):
        try:
            path = file_in(obj.parent, images[material])
            data = read_bytes(path, min(_MAX_TEXTURE_BYTES, _MAX_TOTAL_BYTES - total))
            total += len(data)
        except UnusableImageError as error:
            reader.problem(material, images[material], str(error))
        except OSError as error:
            reader.problem(material, images[material], f"it cannot be read ({error.strerror})")
        else:
            reader.read(material, images[material], data)
    if reader.textures and not len(mesh.uv):
        notes.append(f"The textures are not used, since faces of '{obj}' have no texture coordinates.")
        return {}, tuple(notes)
    return reader.textures, (*notes, *reader.notes)


def library_files(folder: Path, names: str) -> list[Path]:
    """Return the libraries in ``folder`` in the argument of an ``mtllib`` statement; none if they are missing."""
    return _library_files(folder, names, [])


def named_images(text: str) -> list[str]:
    """Return the file names of all images in the library ``text``, whatever they are for."""
    lines = (line.split(None, 1) for line in re.split(r"\r\n?|\n", text))
    statements = ((words[0].lower(), words[1].strip()) for words in lines if len(words) == 2)
    return [
        _without_options(rest)
        for keyword, rest in statements
        if keyword.startswith("map_") or keyword in _IMAGE_STATEMENTS
    ]


def _library_files(folder: Path, names: str, notes: list[str]) -> list[Path]:
    """Return the libraries in the argument of an ``mtllib`` statement: one name with spaces, or several names."""
    for candidates in ([names], names.split()):
        try:
            return [file_in(folder, name) for name in candidates]
        except UnusableImageError as error:
            reason = str(error)
    notes.append(f"The material library '{names[:80]}' is not read: {reason}.")
    return []


def _colour_images(text: str) -> dict[str, str]:
    """Return the file name of the colour texture (map_Kd) of each material in the library ``text``."""
    images: dict[str, str] = {}
    material = ""
    for line in re.split(r"\r\n?|\n", text):
        keyword, *words = line.split(None, 1) or [""]
        rest = words[0].strip() if words else ""
        if keyword == "newmtl":
            material = rest
        elif keyword.lower() == "map_kd" and material and (name := _without_options(rest)):
            images.setdefault(material, name)
    return images


def _without_options(rest: str) -> str:
    """Return the file name in the arguments ``rest`` of a texture statement; it may contain spaces."""
    while (option := rest.split(None, 1)[0] if rest else "") in _OPTIONS:
        rest = rest.removeprefix(option).lstrip()
        for number in range(_OPTIONS[option]):
            word = rest.split(None, 1)[0] if rest else ""
            is_number = re.fullmatch(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", word) is not None
            if number and option in ("-o", "-s", "-t") and not is_number:
                break
            rest = rest.removeprefix(word).lstrip()
    return rest
