"""Landmarks of faces in photos and on meshes, from files or arrays (docs/landmarks.md)."""

import numpy as np
from numpy.typing import NDArray

from faceposer.api import checks
from faceposer.api.posing import PathName
from faceposer.errors import FacePoserError
from faceposer.landmarks import on_meshes, points
from faceposer.landmarks.on_meshes import MeshLandmarks
from faceposer.landmarks.points import Landmarks
from faceposer.landmarks.reading import read_painted
from faceposer.photo.reading import read_photo


def find_landmarks(photo: PathName | NDArray[np.uint8]) -> Landmarks | None:
    """Return the landmarks of the most distinct face in a photo, or None if no face is found.

    Args:
        photo: Path of an image, or its pixels: 8-bit, top row first, of shape (h, w), (h, w, 3) or (h, w, 4).

    Raises:
        FacePoserError: If the photo cannot be read, or the pixels are of another shape or type.
    """
    return points.find_landmarks(_pixels(photo))


def find_all_landmarks(photo: PathName | NDArray[np.uint8]) -> list[Landmarks]:
    """Return the landmarks of all faces in a photo, the largest first; see ``find_landmarks``.

    Raises:
        FacePoserError: If the photo cannot be read, or the pixels are of another shape or type.
    """
    return points.find_all_landmarks(_pixels(photo))


def find_mesh_landmarks(mesh: PathName) -> MeshLandmarks | None:
    """Return the landmarks of a mesh of a head, in any unit and orientation, or None if no face is found.

    Args:
        mesh: Path of a mesh or a character file, or the name of a built-in character.

    Raises:
        FacePoserError: If the mesh cannot be read.
    """
    return on_meshes.find_mesh_landmarks(read_painted(checks.path_name(mesh, "A mesh")))


def _pixels(photo: PathName | NDArray[np.uint8]) -> NDArray[np.uint8]:
    if not isinstance(photo, np.ndarray):
        return read_photo(checks.file_path(photo, "A photo"))
    if photo.dtype != np.uint8 or photo.ndim not in (2, 3) or (photo.ndim == 3 and photo.shape[2] not in (1, 3, 4)):
        raise FacePoserError(
            f"A photo must be an array of 8-bit values of shape (h, w), (h, w, 3) or (h, w, 4), not {photo.dtype} of "
            f"shape {photo.shape}."
        )
    if not photo.size:
        raise FacePoserError("A photo must have pixels.")
    return photo
