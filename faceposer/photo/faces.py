"""Faces in photos, found by the landmark networks."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from faceposer.errors import FacePoserError
from faceposer.geometry.camera import Camera
from faceposer.identity.photos.landmark_fit import PhotoFace
from faceposer.landmarks.feature_points import feature_pixels
from faceposer.landmarks.points import Landmarks, find_landmarks
from faceposer.photo.reading import (
    FOCAL_SPREAD,
    LIKELY_FOCAL_MM,
    PhotoFile,
    focal_in_pixels,
    inspect_photo,
    read_photo,
)

# Longest side to which photos are reduced, and that at which small faces are read again.
_SIDE, _LARGEST_SIDE = 2048, 8192
# Height of a face, in pixels, below which it is read again at the larger size, and below which it is too small.
_SMALL, _LEAST = 250.0, 60.0
# Standard deviation of the logarithm of a focal length that is known.
_KNOWN_SPREAD = 0.03
# Reach of a moved feature point, as a share of the face's height, and ridge of the interpolation.
_MOVED_REACH, _RIDGE = 0.04, 1e-3


@dataclass(frozen=True, eq=False)
class FaceInPhoto:
    """A photo with its face.

    Attributes:
        path: The image file.
        file: Its properties.
        pixels: The image, reduced if it is large, shape (h, w, 3).
        face: The face, in pixels of ``pixels``.
    """

    path: Path
    file: PhotoFile
    pixels: NDArray[np.uint8]
    face: PhotoFace

    @property
    def factor(self) -> float:
        """Pixels of the photo per pixel of ``pixels``."""
        return self.file.size[0] / self.pixels.shape[1]

    def full_camera(self, camera: Camera) -> Camera:
        """Return ``camera`` of ``pixels`` for the whole photo."""
        principal = camera.principal_point * self.factor
        width, height = self.file.size
        shift = (float(principal[0]) - width / 2.0, float(principal[1]) - height / 2.0)
        return replace(camera, focal=camera.focal * self.factor, size=self.file.size, shift=shift)

    def full_landmarks(self) -> Landmarks:
        """Return the landmarks in pixels of the whole photo."""
        found, factor = self.face.landmarks, self.factor
        return replace(found, points=factor * found.points, iris=factor * found.iris, box=factor * found.box)


def read_face(path: Path, focal: float | None = None) -> FaceInPhoto:
    """Return the photo ``path`` with its most distinct face.

    Args:
        path: Image file.
        focal: Focal length in pixels of the photo, if it is known; else it is taken from the EXIF data or estimated.

    Raises:
        FacePoserError: If the photo cannot be read, or shows no face that is large enough.
    """
    file = inspect_photo(path)
    pixels = read_photo(path, _SIDE)
    found = find_landmarks(pixels)
    if (found is None or _height(found) < _SMALL) and max(file.size) > _SIDE:
        pixels = read_photo(path, _LARGEST_SIDE)
        found = find_landmarks(pixels)
    if found is None:
        raise FacePoserError(
            f"No face was found in '{path}'; use a photo in which a face is larger and seen from the front."
        )
    if _height(found) < _LEAST:
        raise FacePoserError(
            f"The face in '{path}' is {_height(found):.0f} pixels high, and at least {_LEAST:.0f} are needed; use a "
            "photo in which it is larger."
        )
    height, width = pixels.shape[:2]
    known = focal or file.focal
    factor = width / file.size[0]
    expected = known * factor if known else focal_in_pixels(LIKELY_FOCAL_MM, (width, height))
    spread = _KNOWN_SPREAD if known else FOCAL_SPREAD
    return FaceInPhoto(path, file, pixels, PhotoFace(found, (width, height), expected, spread))


def _height(found: Landmarks) -> float:
    return float(found.box[3] - found.box[1])


def with_moved_features(found: FaceInPhoto, moved: Mapping[str, tuple[float, float]]) -> FaceInPhoto:
    """Return ``found`` with some feature points at other places, and the landmarks around them moved along.

    The motion of landmarks is interpolated between the feature points, those that are not moved included, by Gaussians.

    Args:
        found: A face.
        moved: Pixels of ``found.pixels`` by name of feature point.
    """
    before = feature_pixels(found.face.landmarks)
    names = list(before)
    places = np.array([before[name] for name in names])
    offsets = np.array([np.subtract(moved.get(name, before[name]), before[name]) for name in names])
    reach = _MOVED_REACH * _height(found.face.landmarks)

    def kernel(points: NDArray[np.float64]) -> NDArray[np.float64]:
        squared = np.square(points[:, None] - places[None]).sum(axis=2)
        result: NDArray[np.float64] = np.exp(-squared / (2.0 * reach**2))
        return result

    weights = np.linalg.solve(kernel(places) + _RIDGE * np.eye(len(places)), offsets)
    landmarks = found.face.landmarks
    points = landmarks.points.copy()
    points[:, :2] += kernel(points[:, :2]) @ weights
    return replace(found, face=replace(found.face, landmarks=replace(landmarks, points=points)))
