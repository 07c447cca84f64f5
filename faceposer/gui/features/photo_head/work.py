"""The work of the dialog in the background: faces in photos, and the fit with pictures of it."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from faceposer.geometry.camera import Camera
from faceposer.gui.features.head_making.state import MadeHead
from faceposer.identity.photos.head_from_photos import HeadFromPhotos, head_from_photos
from faceposer.landmarks.drawing import draw
from faceposer.landmarks.feature_points import feature_pixels
from faceposer.landmarks.painting import painted_character
from faceposer.model.character_names import checked_title, file_stem
from faceposer.photo.faces import FaceInPhoto, read_face, with_moved_features
from faceposer.photo.photo import Photo, Pin
from faceposer.progress import Progress

#: Feature points that can be moved: corners and middles of eyes, brows, nose, lips and chin.
MOVABLE = (
    *("3.7", "3.11", "3.1", "3.9", "3.8", "3.12", "3.2", "3.10"),
    *("4.1", "4.3", "4.5", "4.2", "4.4", "4.6"),
    *("9.1", "9.2", "9.3", "8.1", "8.2", "8.3", "8.4", "2.1"),
)
# Side of the pictures in pixels, and width of the part of the photo that they show, in heights of the face.
_SIDE, _AROUND = 720, 2.0


@dataclass(frozen=True, eq=False)
class MarkedPhoto:
    """A photo with its face, and landmarks that can be moved.

    Attributes:
        found: The face as it was found.
        corner: Top left corner of the picture, in pixels of ``found.pixels``.
        scale: Pixels of the picture per pixel of ``found.pixels``.
        image: The picture: the part of the photo around the face, shape (h, w, 3).
        places: Places of the movable feature points in pixels of ``found.pixels``, by name.
        moved: Names of those that the user has moved.
    """

    found: FaceInPhoto
    corner: tuple[float, float]
    scale: float
    image: NDArray[np.uint8]
    places: dict[str, tuple[float, float]]
    moved: frozenset[str] = frozenset()

    @classmethod
    def of(cls, found: FaceInPhoto) -> "MarkedPhoto":
        """Return the photo with the face ``found``."""
        left, top, right, bottom = (float(edge) for edge in found.face.landmarks.box)
        height, width = found.pixels.shape[:2]
        half = 0.5 * _AROUND * max(bottom - top, right - left)
        middle = (0.5 * (left + right), 0.5 * (top + bottom))
        x0, y0 = (max(round(middle[k] - half), 0) for k in range(2))
        x1, y1 = min(round(middle[0] + half), width), min(round(middle[1] + half), height)
        scale = _SIDE / max(x1 - x0, y1 - y0)
        size = (max(round(scale * (x1 - x0)), 1), max(round(scale * (y1 - y0)), 1))
        part = Image.fromarray(found.pixels[y0:y1, x0:x1]).resize(size, Image.Resampling.LANCZOS)
        pixels = feature_pixels(found.face.landmarks)
        places = {name: pixels[name] for name in MOVABLE if name in pixels}
        return cls(found, (float(x0), float(y0)), scale, np.asarray(part), places)

    @property
    def name(self) -> str:
        """Name of the file."""
        return self.found.path.name

    @property
    def pixels(self) -> dict[str, tuple[float, float]]:
        """Pixels of the movable feature points in the picture, by name."""
        (x0, y0), scale = self.corner, self.scale
        return {name: (scale * (u - x0), scale * (v - y0)) for name, (u, v) in self.places.items()}

    def with_moved(self, name: str, pixel: tuple[float, float]) -> "MarkedPhoto":
        """Return the photo with feature point ``name`` at ``pixel`` of the picture."""
        height, width = self.image.shape[:2]
        u, v = (min(max(pixel[k], 0.0), (width, height)[k] - 1.0) / self.scale + self.corner[k] for k in range(2))
        return replace(self, places={**self.places, name: (u, v)}, moved=self.moved | {name})

    def with_landmarks(self) -> FaceInPhoto:
        """Return the face with its landmarks, those that were moved included."""
        return with_moved_features(self.found, {name: self.places[name] for name in self.moved})

    def camera(self, camera: Camera) -> Camera:
        """Return ``camera`` of ``found.pixels`` for the picture."""
        height, width = self.image.shape[:2]
        principal = (camera.principal_point - self.corner) * self.scale
        shift = (float(principal[0]) - 0.5 * width, float(principal[1]) - 0.5 * height)
        return replace(camera, focal=camera.focal * self.scale, size=(width, height), shift=shift)


@dataclass(frozen=True, eq=False)
class PhotoHead(MadeHead):
    """The character, with the first photo and its expression.

    Attributes:
        photo: The photo with its camera and pins.
        pose: Coefficients of the expression, shape (r,).
        head: The picture with the head in it, shape (h, w, 3).
    """

    photo: Photo
    pose: NDArray[np.float64]
    head: NDArray[np.uint8]

    @property
    def over(self) -> NDArray[np.uint8]:
        """The head over the photo."""
        return self.head


def find_faces(files: Sequence[str], progress: Progress) -> list[MarkedPhoto]:
    """Read the photos and find their faces.

    Raises:
        FacePoserError: If a file cannot be read, or shows no face.
        CancelledError: If the user has cancelled the work.
    """
    marked = []
    for path in files:
        progress.at("Finding the face")
        marked.append(MarkedPhoto.of(read_face(Path(path))))
    return marked


def fit_head(
    marked: Sequence[MarkedPhoto], likelihood: float, title: str, painting: bool, progress: Progress
) -> PhotoHead:
    """Make a character of the photos.

    Raises:
        FacePoserError: If a face is seen from the side.
        CancelledError: If the user has cancelled the work.
    """
    found = [one.with_landmarks() for one in marked]
    shown = checked_title(title or "Head")
    made = head_from_photos(
        [one.face for one in found],
        [one.pixels for one in found],
        [str(one.path) for one in found],
        name=file_stem(shown),
        title=shown,
        likelihood=likelihood,
        painting=painting,
        progress=progress,
    )
    first, camera = found[0], made.cameras[0]
    pins = tuple(Pin(name, pixel) for name, pixel in feature_pixels(first.full_landmarks()).items())
    width, height = first.file.size
    inside = tuple(pin for pin in pins if 0.0 <= pin.pixel[0] <= width and 0.0 <= pin.pixel[1] <= height)
    photo = Photo(str(first.path.absolute()), first.file.size, inside, first.full_camera(camera), first.file.focal)
    photo = photo.with_expression(made.model, made.poses[0])
    errors = ", ".join(f"{one['landmark_px']:.1f}" for one in made.report["photos"])
    took = f"Landmarks are {errors} pixels off, in {made.report['seconds']:.0f} s."
    text = f"{took} Left the photo, right the head; drag the line between them."
    return PhotoHead(made.character, text, marked[0].image, photo, made.poses[0], _with_head(marked[0], made))


def _with_head(marked: MarkedPhoto, made: HeadFromPhotos) -> NDArray[np.uint8]:
    """Return the picture of the first photo with the head in its expression and camera over it."""
    posed = made.model.surface(made.poses[0])
    drawing = draw(painted_character(made.character, posed), marked.camera(made.cameras[0]))
    return np.where(drawing.faces[..., None] >= 0, drawing.image, marked.image)
