"""The work of the dialog in the background: the fit with pictures of it."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from faceposer.geometry.camera import Camera
from faceposer.gui.features.head_making.contents import Compared, MadeHead
from faceposer.gui.features.head_making.previews import SIDE, Previews
from faceposer.gui.features.photo_head.marked_photo import MarkedPhoto
from faceposer.identity.photos.fit_so_far import FitSoFar
from faceposer.identity.photos.head_from_photos import HeadFromPhotos, head_from_photos
from faceposer.landmarks.drawing import PaintedMesh, draw
from faceposer.landmarks.painting import painted_character
from faceposer.model.character_names import checked_title, file_stem
from faceposer.photo.photo import Photo, Pin
from faceposer.progress import Progress

# Longer side in pixels of the pictures of the result.
_SIDE = 1080


@dataclass(frozen=True, eq=False)
class PhotoHead(MadeHead):
    """The character, with the first photo and its expression.

    Attributes:
        photo: The photo with its camera and pins.
        pose: Coefficients of the expression, shape (r,).
        compared: The photos and the head over each.
    """

    photo: Photo
    pose: NDArray[np.float64]
    compared: tuple[Compared, ...]

    @property
    def views(self) -> Sequence[Compared]:
        """The photos, and over them the head."""
        return self.compared


def fit_head(
    marked: Sequence[MarkedPhoto],
    likelihood: float,
    title: str,
    painting: bool,
    show: Callable[[NDArray[np.uint8]], None],
    progress: Progress,
) -> PhotoHead:
    """Make a character of the photos.

    Args:
        marked: The photos with their landmarks.
        likelihood: Weight of the density of heads.
        title: Title of the character.
        painting: The photos are paintings or drawings.
        show: Called with pictures of the fit.
        progress: Progress to update.

    Raises:
        FacePoserError: If a face is turned too far.
        CancelledError: If the user has cancelled the work.
    """
    found = [one.with_landmarks() for one in marked]
    shown = checked_title(title or "Head")
    previews = Previews(show)

    def watch(fit: FitSoFar) -> None:
        previews.draw(lambda: _with_head(marked[0], fit.mesh(0), fit.camera(0), SIDE)[1])

    made = head_from_photos(
        [one.face for one in found],
        [one.pixels for one in found],
        [str(one.path) for one in found],
        name=file_stem(shown),
        title=shown,
        likelihood=likelihood,
        painting=painting,
        progress=progress.part(0.0, 0.92),
        watch=watch,
    )
    drawing, compared = progress.part(0.92, 1.0), list[Compared]()
    for number, one in enumerate(marked):
        drawing.at("Drawing the head", number / len(marked))
        compared.append(_compared(one, made, number))
    progress.check()
    first = found[0]
    width, height = first.file.size
    pins = tuple(Pin(name, pixel) for name, pixel in first.features().items())
    inside = tuple(pin for pin in pins if 0.0 <= pin.pixel[0] <= width and 0.0 <= pin.pixel[1] <= height)
    camera = first.full_camera(made.cameras[0])
    photo = Photo(str(first.path.absolute()), first.file.size, inside, camera, first.file.focal)
    photo = photo.with_expression(made.model, made.poses[0])
    errors = ", ".join(f"{one['landmark_px']:.1f}" for one in made.report["photos"])
    text = (
        f"Landmarks are {errors} pixels off, in {made.report['seconds']:.0f} s. Left of the line is the photo, right "
        "the head; drag the line."
    )
    return PhotoHead(made.character, text, compared[0].picture, photo, made.poses[0], tuple(compared))


def _compared(marked: MarkedPhoto, made: HeadFromPhotos, number: int) -> Compared:
    """Return photo ``number``, and over it the head in its expression."""
    mesh = painted_character(made.character, made.model.surface(made.poses[number]))
    return Compared(marked.name, *_with_head(marked, mesh, made.cameras[number], _SIDE))


def _with_head(
    marked: MarkedPhoto, mesh: PaintedMesh, camera: Camera, side: int
) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
    """Return the picture of the photo with ``side`` pixels, and the same with the head ``mesh`` over it."""
    here, size = marked.camera(camera, side)
    picture, drawing = marked.picture(size), draw(mesh, here)
    return picture, np.where(drawing.faces[..., None] >= 0, drawing.image, picture)
