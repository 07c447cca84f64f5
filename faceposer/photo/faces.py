"""Faces in photos, found by the landmark networks."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from faceposer.errors import FacePoserError, counted
from faceposer.geometry.camera import Camera
from faceposer.identity.photos.landmark_fit import PhotoFace
from faceposer.landmarks.crops import Picture, Square
from faceposer.landmarks.feature_points import feature_pixels
from faceposer.landmarks.points import Landmarks, find_all_landmarks, find_landmarks, landmarks_in
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
# Half the side of the part around a face that is kept of large photos, as a multiple of the face's.
_CUT = 1.25
# Longest side at which other faces are looked for, and least logarithm of the odds of one.
_SIDE_OF_OTHERS, _CERTAIN = 1024, 12.0
# Standard deviation of the logarithm of a focal length that is known.
_KNOWN_SPREAD = 0.03
# Reach of a moved feature point, as a share of the face's height, and ridge of the interpolation.
_MOVED_REACH, _RIDGE = 0.04, 1e-3
# Least number of pins by which a face is looked for, its sizes relative to their extent, and feature points of the
# right and of the left eye.
_LEAST_PINS, _ROOMS = 4, (1.5, 2.0, 2.8)
_EYES = (("3.8", "3.12", "3.6"), ("3.7", "3.11", "3.5"))
_PUPILS = ("3.6", "3.5")


@dataclass(frozen=True, eq=False)
class FaceInPhoto:
    """A photo with its face.

    Attributes:
        path: The image file.
        file: Its properties.
        pixels: The image, reduced if it is large, or the part around the face, shape (h, w, 3).
        face: The face, in pixels of ``pixels``.
        placed: Pixels of ``pixels`` of the feature points that were placed by hand, by name.
        whole: Width of the whole image that was reduced, or 0 if ``pixels`` is whole.
        corner: Left top corner of ``pixels`` in it.
    """

    path: Path
    file: PhotoFile
    pixels: NDArray[np.uint8]
    face: PhotoFace
    placed: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    whole: int = 0
    corner: tuple[int, int] = (0, 0)

    @property
    def factor(self) -> float:
        """Pixels of the photo per pixel of ``pixels``."""
        return self.file.size[0] / (self.whole or self.pixels.shape[1])

    def in_photo(self, pixel: tuple[float, float]) -> tuple[float, float]:
        """Return the pixel of the photo of a ``pixel`` of ``pixels``."""
        return (self.factor * (pixel[0] + self.corner[0]), self.factor * (pixel[1] + self.corner[1]))

    def cut(self) -> "FaceInPhoto":
        """Return the part of the photo around the face if the photo is large, for the memory's sake."""
        if max(self.pixels.shape[:2]) <= _SIDE:
            return self
        found = self.face.landmarks
        low, high = found.box[:2], found.box[2:]
        middle, half = 0.5 * (low + high), _CUT * float((high - low).max())
        height, width = self.pixels.shape[:2]
        x0, y0 = np.maximum(np.floor(middle - half), 0).astype(int).tolist()
        x1, y1 = np.minimum(np.ceil(middle + half), (width, height)).astype(int).tolist()
        moved = replace(
            found,
            points=found.points - (x0, y0, 0.0),
            iris=found.iris - (x0, y0, 0.0),
            box=found.box - (x0, y0, x0, y0),
        )
        u, v = self.face.centre
        face = replace(self.face, landmarks=moved, size=(x1 - x0, y1 - y0), principal=(u - x0, v - y0))
        return replace(
            self,
            pixels=self.pixels[y0:y1, x0:x1].copy(),
            face=face,
            placed={name: (x - x0, y - y0) for name, (x, y) in self.placed.items()},
            whole=self.whole or width,
            corner=(self.corner[0] + x0, self.corner[1] + y0),
        )

    def full_camera(self, camera: Camera) -> Camera:
        """Return ``camera`` of ``pixels`` for the whole photo."""
        u, v = self.in_photo((float(camera.principal_point[0]), float(camera.principal_point[1])))
        width, height = self.file.size
        shift = (u - width / 2.0, v - height / 2.0)
        return replace(camera, focal=camera.focal * self.factor, size=self.file.size, shift=shift)

    def features(self) -> dict[str, tuple[float, float]]:
        """Return the pixels of the whole photo of feature points by name: as placed, else as landmarks imply."""
        places = {**feature_pixels(self.face.landmarks), **self.placed}
        return {name: self.in_photo(place) for name, place in places.items()}


def read_face(
    path: Path, focal: float | None = None, pins: Mapping[str, tuple[float, float]] | None = None
) -> FaceInPhoto:
    """Return the photo ``path`` with its most distinct face.

    Args:
        path: Image file.
        focal: Focal length in pixels of the photo, if it is known; else it is taken from the EXIF data or estimated.
        pins: Pixels of the photo by name of feature point, to which the landmarks are moved. The face is looked for
            there if it is not found otherwise.

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
        # False colours hide faces from the networks, which a grey picture shows.
        found = find_landmarks(_grey(pixels))
    factor = pixels.shape[1] / file.size[0]
    placed = {name: (factor * u, factor * v) for name, (u, v) in (pins or {}).items()}
    if placed:
        found = _face_at(pixels, placed, found)
    if found is None:
        raise FacePoserError(
            f"No face was found in '{path}'; use a photo in which a face is larger and seen from the front"
            f"{', or pin more of it' if pins else ''}."
        )
    if _height(found) < _LEAST:
        raise FacePoserError(
            f"The face in '{path}' is {_height(found):.0f} pixels high, and at least {_LEAST:.0f} are needed; use a "
            "photo in which it is larger."
        )
    height, width = pixels.shape[:2]
    known = focal or file.focal
    expected = known * factor if known else focal_in_pixels(LIKELY_FOCAL_MM, (width, height))
    spread = _KNOWN_SPREAD if known else FOCAL_SPREAD
    face = FaceInPhoto(path, file, pixels, PhotoFace(found, (width, height), expected, spread))
    return with_moved_features(face, placed) if placed else face


def note_of_others(found: FaceInPhoto) -> str:
    """Return a note that the whole photo shows other faces than ``found``, and which is taken; "" if it does not.

    Faces of at least a third of its height count.
    """
    from PIL import Image

    image = Image.fromarray(found.pixels)
    image.thumbnail((_SIDE_OF_OTHERS, _SIDE_OF_OTHERS))
    factor = found.pixels.shape[1] / image.width
    left, top, right, bottom = found.face.landmarks.box
    middle = (0.5 * (left + right), 0.5 * (top + bottom))
    others = 0
    for face in find_all_landmarks(np.asarray(image)):
        box = factor * face.box
        same = box[0] < middle[0] < box[2] and box[1] < middle[1] < box[3]
        if not same and face.logit >= _CERTAIN and 3.0 * (box[3] - box[1]) >= bottom - top:
            others += 1
    if not others:
        return ""
    u, v = found.in_photo((float(middle[0]), float(middle[1])))
    return (
        f"{counted(others + 1, 'face')} were found; the most distinct one, at ({u:.0f}, {v:.0f}), is taken. For "
        "another, cut the photo to it."
    )


def _face_at(
    pixels: NDArray[np.uint8], pins: Mapping[str, tuple[float, float]], found: Landmarks | None
) -> Landmarks | None:
    """Return the landmarks of the face in ``pixels`` on which ``pins`` are: those ``found``, or others."""
    places = np.array(list(pins.values()))
    middle = places.mean(axis=0)
    if found is not None and (found.box[:2] < middle).all() and (middle < found.box[2:]).all():
        return found
    if len(pins) < _LEAST_PINS:
        return found
    right, left = (np.mean([pins[name] for name in eye if name in pins] or [middle], axis=0) for eye in _EYES)
    across = left - right
    angle = math.atan2(across[1], across[0]) if np.linalg.norm(across) > 1.0 else 0.0
    extent = float(np.ptp(places, axis=0).max())
    picture = Picture(pixels)
    tried = [
        landmarks_in(picture, Square(float(middle[0]), float(middle[1]), max(room * extent, 8.0), angle))
        for room in _ROOMS
    ]
    return max((face for face in tried if face is not None), key=lambda face: face.logit, default=found)


def _grey(pixels: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return the brightness of ``pixels``, (h, w, 3), over the whole range, shape (h, w)."""
    grey = pixels.mean(axis=2)
    low, high = np.quantile(grey, (0.005, 0.995))
    return np.clip(255.0 * (grey - low) / max(high - low, 1.0), 0.0, 255.0).astype(np.uint8)


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
    points, iris = landmarks.points.copy(), landmarks.iris.copy()
    points[:, :2] += kernel(points[:, :2]) @ weights
    for eye, name in enumerate(_PUPILS):
        iris[eye, :, :2] += offsets[names.index(name)]
    face = replace(found.face, landmarks=replace(landmarks, points=points, iris=iris))
    return replace(found, face=face, placed={**found.placed, **moved})
