"""The other files that a mesh consists of: material libraries, buffers and images, which no output may replace."""

import re
import struct
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any
from urllib.parse import unquote

from faceposer.errors import FacePoserError
from faceposer.files import paths
from faceposer.files.atomic import check_not_input
from faceposer.files.json_documents import parse_json
from faceposer.files.reading import read_bytes
from faceposer.geometry.gltf_io import GLTF_SUFFIXES
from faceposer.geometry.mtl_io import library_files, named_images
from faceposer.geometry.texture_images import UnusableImageError, file_in

#: Suffixes of images that belong to a mesh of the same name if it has no textures of its own.
PICTURE_SUFFIXES = (".jpg", ".jpeg", ".png", ".tif", ".bmp")

_MAX_BYTES = 1 << 30
# Header of a binary glTF, with that of its first chunk; and the kind of that chunk.
_GLB, _JSON = struct.Struct("<4sIIII"), 0x4E4F534A
_LIBRARY = re.compile(rb"^[ \t]*mtllib[ \t]+([^\r\n]+)", re.MULTILINE)
_OBJ_UV = re.compile(rb"^[ \t]*vt[ \t]", re.MULTILINE)
_PLY_HEADER = re.compile(rb"\Aply\b.*?^end_header", re.MULTILINE | re.DOTALL)
_PLY_IMAGE = re.compile(rb"^comment[ \t]+TextureFile[ \t]+([^\r\n]+)", re.MULTILINE | re.IGNORECASE)
_PLY_UV = re.compile(rb"^property[ \t].*\b(s|u|texture_u|texcoord)[ \t\r]*$", re.MULTILINE)


def check_not_of_meshes(path: Path | None, *meshes: Path | str) -> None:
    """Check that an output ``path`` replaces neither one of the ``meshes`` nor a file that belongs to one.

    Raises:
        FacePoserError: If it does.
    """
    check_not_input(path, *meshes)
    if path is not None and paths.exists(path):
        for mesh in meshes:
            check_not_input(path, *companions_of(paths.expand_user(mesh)))


def companions_of(mesh: Path) -> list[Path]:
    """Return the files that exist and belong to the file ``mesh``; none if it cannot be read."""
    try:
        content = read_bytes(mesh, _MAX_BYTES)
    except OSError:
        return []
    suffix = mesh.suffix.lower()
    if suffix in GLTF_SUFFIXES:
        return _of_gltf(mesh.parent, content)
    if suffix == ".obj":
        files, has_uv = _of_obj(mesh, content), _OBJ_UV.search(content) is not None
    elif suffix == ".ply":
        header = match.group() if (match := _PLY_HEADER.search(content)) else b""
        files = _existing(mesh.parent, (_text(found) for found in _PLY_IMAGE.findall(header)))
        has_uv = _PLY_UV.search(header) is not None
    else:
        return []
    has_image = any(file.suffix.lower() != ".mtl" for file in files)
    return files if has_image or not has_uv else [*files, *pictures_beside(mesh)]


def pictures_beside(mesh: Path) -> list[Path]:
    """Return the images with the name of the file ``mesh``, as scans have that name no material."""
    return _existing(mesh.parent, (mesh.stem + suffix for suffix in PICTURE_SUFFIXES))


def _of_obj(mesh: Path, content: bytes) -> list[Path]:
    files: list[Path] = []
    for found in _LIBRARY.findall(content):
        for library in library_files(mesh.parent, _text(found)):
            files.append(library)
            with suppress(OSError):
                files += _existing(mesh.parent, named_images(_text(read_bytes(library, _MAX_BYTES))))
    return files


def _of_gltf(folder: Path, content: bytes) -> list[Path]:
    if content[:4] == b"glTF" and len(content) >= _GLB.size:
        _, _, _, length, kind = _GLB.unpack_from(content)
        content = content[_GLB.size : _GLB.size + length] if kind == _JSON else b""
    try:
        data = parse_json(content)
    except FacePoserError:
        return []
    return _existing(folder, _uris(data))


def _uris(data: Any) -> Iterator[str]:
    for key in ("buffers", "images"):
        entries = data.get(key) if isinstance(data, dict) else None
        for entry in entries if isinstance(entries, list) else ():
            uri = entry.get("uri") if isinstance(entry, dict) else None
            if isinstance(uri, str) and not uri.startswith("data:"):
                yield unquote(uri)


def _existing(folder: Path, names: Iterator[str] | list[str]) -> list[Path]:
    files = []
    for name in names:
        with suppress(UnusableImageError):
            files.append(file_in(folder, name))
    return files


def _text(content: bytes) -> str:
    return content.decode("utf-8-sig", "replace").strip()
