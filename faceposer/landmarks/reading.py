"""Meshes with their colours from files."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from faceposer.errors import FacePoserError
from faceposer.files import paths
from faceposer.files.reading import read_bytes
from faceposer.geometry.mesh_companions import pictures_beside
from faceposer.geometry.mesh_io import MESH_SUFFIXES, read_textured_mesh
from faceposer.geometry.obj_io import read_obj_colours
from faceposer.geometry.polygon_mesh import Group
from faceposer.geometry.texture_images import UnusableImageError, texture_image
from faceposer.landmarks.drawing import PaintedMesh
from faceposer.landmarks.painting import painted_character, painted_file
from faceposer.model.character_file import available_characters, load_character


def is_mesh(what: str) -> bool:
    """Return True if ``what`` is the name of a mesh file, a character file or an installed character."""
    if Path(what).suffix.lower() in (*MESH_SUFFIXES, ".npz"):
        return True
    return not paths.exists(Path(what)) and what in [name for name, _ in available_characters()]


def read_painted(what: str) -> PaintedMesh:
    """Return the mesh of a file, a character file or an installed character, with its textures.

    Raises:
        FacePoserError: If it cannot be read.
    """
    path = paths.expand_user(what)
    if path.suffix.lower() not in MESH_SUFFIXES:
        return painted_character(load_character(what))
    mesh, textures = read_textured_mesh(path)
    if not textures and path.suffix.lower() == ".obj":
        mesh = replace(mesh, colours=read_obj_colours(path, len(mesh.vertices)))
    if not textures and len(mesh.uv) and (image := _image_beside(path)) is not None:
        mesh = replace(mesh, groups=(Group("", (0, len(mesh.polygons)), "scan"),))
        textures = {"scan": image}
    painted = painted_file(mesh, textures)
    if not np.isfinite(painted.vertices).all():
        raise FacePoserError(f"The mesh '{path}' has coordinates that are not finite numbers; save it again.")
    if not len(painted.triangles):
        raise FacePoserError(f"The mesh '{path}' has no faces; choose a file with a surface.")
    return painted


def _image_beside(path: Path) -> bytes | None:
    """Return the image with the name of the mesh ``path``, as scans have that name no material, or None."""
    for image in pictures_beside(path):
        try:
            return texture_image(read_bytes(image), image.name)
        except (OSError, FacePoserError, UnusableImageError):
            continue
    return None
