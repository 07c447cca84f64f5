"""Photos with their faces, and landmarks that can be moved."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from faceposer.geometry.camera import Camera
from faceposer.landmarks.feature_points import feature_pixels
from faceposer.photo.faces import FaceInPhoto, note_of_others, read_face, with_moved_features
from faceposer.progress import Progress

#: Feature points that can be moved: corners and middles of eyes, brows, nose, lips and chin.
MOVABLE = (
    *("3.7", "3.11", "3.1", "3.9", "3.8", "3.12", "3.2", "3.10"),
    *("4.1", "4.3", "4.5", "4.2", "4.4", "4.6"),
    *("9.1", "9.2", "9.3", "8.1", "8.2", "8.3", "8.4", "2.1"),
)
# Largest side of the pictures in pixels, and width of the part of the photo that they show, in heights of the face.
_SIDE, _AROUND = 1600, 2.0


@dataclass(frozen=True, eq=False)
class MarkedPhoto:
    """A photo with its face, and landmarks that can be moved.

    Attributes:
        found: The face as it was found.
        corner: Left top corner of the picture, in pixels of ``found.pixels``.
        scale: Pixels of the picture per pixel of ``found.pixels``.
        image: The picture: the part of the photo around the face, shape (h, w, 3).
        found_places: Where the movable feature points were found in pixels of ``found.pixels``, by name.
        placed: Where the user has moved some of them.
        note: A sentence on other faces, or "".
    """

    found: FaceInPhoto
    corner: tuple[float, float]
    scale: float
    image: NDArray[np.uint8]
    found_places: Mapping[str, tuple[float, float]]
    placed: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    note: str = ""

    @classmethod
    def of(cls, found: FaceInPhoto, note: str = "") -> "MarkedPhoto":
        """Return the photo with the face ``found``."""
        left, top, right, bottom = (float(edge) for edge in found.face.landmarks.box)
        height, width = found.pixels.shape[:2]
        half = 0.5 * _AROUND * max(bottom - top, right - left)
        middle = (0.5 * (left + right), 0.5 * (top + bottom))
        x0, y0 = (max(round(middle[k] - half), 0) for k in range(2))
        x1, y1 = min(round(middle[0] + half), width), min(round(middle[1] + half), height)
        scale = min(_SIDE / max(x1 - x0, y1 - y0), 1.0)
        part = found.pixels[y0:y1, x0:x1]
        if scale < 1.0:
            size = (max(round(scale * (x1 - x0)), 1), max(round(scale * (y1 - y0)), 1))
            part = np.asarray(Image.fromarray(part).resize(size, Image.Resampling.LANCZOS))
        pixels = feature_pixels(found.face.landmarks)
        places = {name: pixels[name] for name in MOVABLE if name in pixels}
        return cls(found, (float(x0), float(y0)), scale, part, places, note=note)

    @property
    def name(self) -> str:
        """Name of the file."""
        return self.found.path.name

    @property
    def moved(self) -> frozenset[str]:
        """Names of the feature points that the user has moved."""
        return frozenset(self.placed)

    @property
    def found_pixels(self) -> dict[str, tuple[float, float]]:
        """Pixels of the picture at which the movable feature points were found, by name."""
        return self._in_picture(self.found_places)

    @property
    def pixels(self) -> dict[str, tuple[float, float]]:
        """Pixels of the movable feature points in the picture, by name."""
        return self._in_picture({**self.found_places, **self.placed})

    def _in_picture(self, places: Mapping[str, tuple[float, float]]) -> dict[str, tuple[float, float]]:
        (x0, y0), scale = self.corner, self.scale
        return {name: (scale * (u - x0), scale * (v - y0)) for name, (u, v) in places.items()}

    def with_moved(self, name: str, pixel: tuple[float, float]) -> "MarkedPhoto":
        """Return the photo with feature point ``name`` at ``pixel`` of the picture."""
        height, width = self.image.shape[:2]
        u, v = (min(max(pixel[k], 0.0), (width, height)[k] - 1.0) / self.scale + self.corner[k] for k in range(2))
        return replace(self, placed={**self.placed, name: (u, v)})

    def with_reset(self, names: Collection[str]) -> "MarkedPhoto":
        """Return the photo with the feature points ``names`` where they were found."""
        return replace(self, placed={name: place for name, place in self.placed.items() if name not in names})

    def with_landmarks(self) -> FaceInPhoto:
        """Return the face with its landmarks, those that were moved included."""
        return with_moved_features(self.found, self.placed) if self.placed else self.found

    def camera(self, camera: Camera, side: int) -> tuple[Camera, tuple[int, int]]:
        """Return ``camera`` of ``found.pixels`` for the picture with ``side`` pixels, and its size."""
        height, width = self.image.shape[:2]
        factor = side / max(width, height)
        size = (max(round(factor * width), 1), max(round(factor * height), 1))
        scale = self.scale * factor
        principal = (camera.principal_point - self.corner) * scale
        shift = (float(principal[0]) - 0.5 * size[0], float(principal[1]) - 0.5 * size[1])
        return replace(camera, focal=camera.focal * scale, size=size, shift=shift), size

    def picture(self, size: tuple[int, int]) -> NDArray[np.uint8]:
        """Return the picture with another ``size``."""
        if size == (self.image.shape[1], self.image.shape[0]):
            return self.image
        return np.asarray(Image.fromarray(self.image).resize(size, Image.Resampling.LANCZOS))


def find_faces(files: Sequence[str], progress: Progress) -> list[MarkedPhoto]:
    """Read the photos and find their faces.

    Raises:
        FacePoserError: If a file cannot be read, or shows no face.
        CancelledError: If the user has cancelled the work.
    """
    marked = []
    for number, path in enumerate(files):
        stage = "Finding the face" if len(files) == 1 else f"Finding the face in photo {number + 1} of {len(files)}"
        progress.at(stage, number / len(files))
        found = read_face(Path(path))
        progress.at(stage, (number + 0.7) / len(files))
        note = note_of_others(found)
        marked.append(MarkedPhoto.of(found.cut(), note))
    return marked
