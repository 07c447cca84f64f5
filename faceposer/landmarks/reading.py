"""Meshes with their colours from files."""

from pathlib import Path

import numpy as np

from faceposer.errors import FacePoserError
from faceposer.files import paths
from faceposer.geometry.mesh_io import MESH_SUFFIXES, read_textured_mesh
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
    painted = painted_file(*read_textured_mesh(path))
    if not len(painted.triangles) or not np.isfinite(painted.vertices).all():
        raise FacePoserError(f"The mesh '{path}' has no faces; choose a file with a surface.")
    return painted
