"""Meshes with their colours from files."""

from pathlib import Path

import numpy as np

from faceposer.errors import FacePoserError
from faceposer.files import paths
from faceposer.geometry.gltf_io import GLTF_SUFFIXES, read_gltf
from faceposer.geometry.mesh_io import MESH_SUFFIXES, read_mesh
from faceposer.geometry.mtl_io import read_obj_textures
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
    suffix = path.suffix.lower()
    if suffix not in MESH_SUFFIXES:
        return painted_character(load_character(what))
    mesh = read_mesh(path)
    textures: dict[str, bytes] = {}
    if suffix in GLTF_SUFFIXES:
        textures = dict(read_gltf(path).textures)
    elif suffix == ".obj":
        textures, _ = read_obj_textures(path, mesh)
    painted = painted_file(mesh, textures)
    if not len(painted.triangles) or not np.isfinite(painted.vertices).all():
        raise FacePoserError(f"The mesh '{path}' has no faces; choose a file with a surface.")
    return painted
