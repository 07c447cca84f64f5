"""Reading of meshes in common formats: STL by trimesh, all others by this package."""

import os
import re
import struct
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from faceposer.errors import FacePoserError, counted
from faceposer.files.reading import open_file
from faceposer.geometry.gltf_io import GLTF_SUFFIXES, read_gltf
from faceposer.geometry.mesh import first_unusable
from faceposer.geometry.mtl_io import read_obj_textures
from faceposer.geometry.obj_io import read_obj
from faceposer.geometry.off_io import read_off
from faceposer.geometry.ply_io import read_ply
from faceposer.geometry.polygon_mesh import PolygonMesh

_MAX_BYTES = 1 << 30
_APPLE_DOUBLE = b"\x00\x05\x16\x07"
# Limits of an OBJ file, of which a face of half a million vertices stays below.
_MAX_BYTES_OBJ, _MAX_LINES, _LONGEST_LINE = 160 << 20, 4_000_000, 1 << 22
# The readers of trimesh take many times the size of a file.
_MAX_BYTES_TRIMESH = 128 << 20
#: Suffixes of meshes of poses, whose vertices keep their order.
POSED_MESH_SUFFIXES = (".obj", ".ply")
MESH_SUFFIXES = (".obj", ".ply", ".stl", *GLTF_SUFFIXES, ".off")


def texture_notes(path: Path, mesh: PolygonMesh) -> tuple[str, ...]:
    """Return sentences about the textures of the ``mesh`` in ``path`` that cannot be used."""
    if path.suffix.lower() in GLTF_SUFFIXES:
        return read_gltf(path).notes
    return read_obj_textures(path, mesh)[1] if path.suffix.lower() == ".obj" else ()


def read_mesh(path: Path) -> PolygonMesh:
    """Read the mesh in ``path``; OBJ, PLY and glTF keep their vertex order, polygons and groups.

    Raises:
        FacePoserError: If the file cannot be read as a mesh.
    """
    return _checked(path)[0]


def read_textured_mesh(path: Path) -> tuple[PolygonMesh, Mapping[str, bytes]]:
    """Read the mesh in ``path`` like ``read_mesh``, and the image files of its colour textures by material.

    Raises:
        FacePoserError: If the file cannot be read as a mesh.
    """
    mesh, textures = _checked(path)
    if path.suffix.lower() == ".obj":
        textures, _ = read_obj_textures(path, mesh)
    return mesh, textures


def _checked(path: Path) -> tuple[PolygonMesh, Mapping[str, bytes]]:
    """Return the mesh in ``path``, and its textures if they are known without reading further files."""
    try:
        with open_file(path, _MAX_BYTES) as file:
            is_apple_double = file.read(4) == _APPLE_DOUBLE
        if is_apple_double:
            raise FacePoserError(
                f"'{path}' is not a mesh but a file of macOS about one; choose the file without '._' in its name."
            )
        mesh, textures = _read(path)
    except OSError as error:
        raise FacePoserError(f"The mesh '{path}' cannot be read: {error.strerror}.") from error
    if len(mesh.vertices) == 0 or len(mesh.polygons) == 0:
        raise FacePoserError(f"The mesh '{path}' has no faces; choose a file with a surface.")
    for noun, values in (("Vertex", mesh.vertices), ("Texture coordinate", mesh.uv), ("Normal", mesh.normals)):
        if (row := first_unusable(values)) is not None:
            problem = "too far away" if np.isfinite(values[row]).all() else "not finite"
            raise FacePoserError(f"{noun} {row + 1} of the mesh '{path}' is {problem}; export it again.")
    return mesh, textures


def _read(path: Path) -> tuple[PolygonMesh, Mapping[str, bytes]]:
    suffix = path.suffix.lower()
    if suffix not in MESH_SUFFIXES:
        raise FacePoserError(f"'{path}' is not a supported mesh; choose a file of type {', '.join(MESH_SUFFIXES)}.")
    if suffix == ".obj":
        _check_lines(path)
    if suffix in GLTF_SUFFIXES:
        found = read_gltf(path)
        return found.mesh, found.textures
    return {".obj": read_obj, ".ply": read_ply, ".off": read_off}.get(suffix, _read_with_trimesh)(path), {}


def _check_lines(path: Path) -> None:
    """Raise a FacePoserError if the OBJ file ``path`` has far more lines than a face."""
    lines = longest = 0
    last = b""
    with open_file(path, _MAX_BYTES_OBJ) as file:
        while block := file.read(1 << 24):
            lines += block.count(b"\n") + block.count(b"\r") - (last + block).count(b"\r\n")
            end = max(block.rfind(b"\n"), block.rfind(b"\r")) + 1
            longest = len(block) - end if end else longest + len(block)
            last = block[-1:]
            if lines > _MAX_LINES or longest > _LONGEST_LINE:
                raise FacePoserError(
                    f"The mesh '{path}' has more than {_MAX_LINES:,} lines, or lines of more than "
                    f"{_LONGEST_LINE >> 20} MB; export the face only."
                )


def _check_stl(path: Path) -> None:
    """Raise a FacePoserError if the STL file ``path`` is truncated."""
    with open_file(path, _MAX_BYTES_TRIMESH) as file:
        head = file.read(84)
        size = file.seek(0, os.SEEK_END)
        declared = struct.unpack_from("<I", head, 80)[0] if len(head) == 84 else 0
        is_text = head.lstrip()[:5].lower() == b"solid" and size != 84 + 50 * declared
        if is_text:
            file.seek(0)
            text = file.read().lower()
            declared, found = len(re.findall(rb"(?m)^\s*facet\b", text)), text.count(b"endfacet")
        else:
            found = max(size - 84, 0) // 50
    if declared > found:
        raise FacePoserError(
            f"The mesh '{path}' is truncated: it declares {counted(declared, 'triangle')}, but has {found}; copy or "
            "export it again."
        )


def _read_with_trimesh(path: Path) -> PolygonMesh:
    import trimesh  # imported late, since it takes over a second

    _check_stl(path)
    file_type = path.suffix.lower().removeprefix(".")
    try:
        with open_file(path, _MAX_BYTES_TRIMESH) as file:
            mesh: Any = trimesh.load(file, file_type, force="mesh", process=False, maintain_order=True)
        vertices, faces = np.asarray(mesh.vertices, dtype=np.float64), np.asarray(mesh.faces)
    except OSError:
        raise
    except Exception as error:  # the readers of trimesh raise arbitrary exceptions, with messages for programmers
        raise FacePoserError(
            f"The mesh '{path}' is broken or is not a mesh of type {file_type.upper()}; export it again."
        ) from error
    return PolygonMesh(vertices, faces.astype(np.int32))
