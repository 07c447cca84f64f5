"""Small pictures of the frames of a film: for the dialog, and to be shown beside the face."""

import io

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from faceposer.film.film import FilmFrame, reduced_size
from faceposer.landmarks.points import Landmarks

Pixels = NDArray[np.uint8]

# Longer side of the pictures, and most of them that are kept; of longer films, only every second or third is.
_SIDE, _MOST = 360, 4000
_QUALITY = 80
_GREEN = (60, 230, 90)


class Stills:
    """The pictures of a film, collected while its face is followed."""

    def __init__(self) -> None:
        self._pictures: dict[int, bytes] = {}
        self._every = 1
        self._decoded: tuple[int, Pixels] | None = None
        #: The last frame with the landmarks of its face.
        self.preview: Pixels | None = None

    def watch(self, frame: FilmFrame, face: Landmarks | None) -> None:
        """Take the ``frame`` with its ``face``."""
        height, width = frame.pixels.shape[:2]
        size = reduced_size((width, height), _SIDE)
        small = Image.fromarray(frame.pixels).resize(size, Image.Resampling.BOX)
        if frame.number % self._every == 0:
            data = io.BytesIO()
            small.save(data, "JPEG", quality=_QUALITY)
            self._pictures[frame.number] = data.getvalue()
            if len(self._pictures) > _MOST:
                self._every *= 2
                self._pictures = {k: kept for k, kept in self._pictures.items() if k % self._every == 0}
        picture = np.array(small)
        if face is not None:
            places = np.floor(face.points[:, :2] * (size[0] / width)).astype(int)
            # Dots of two by two pixels.
            for corner in ((0, 0), (0, 1), (1, 0), (1, 1)):
                dots = places + corner
                inside = ((dots >= 0) & (dots < size)).all(axis=1)
                picture[dots[inside, 1], dots[inside, 0]] = _GREEN
        self.preview = picture

    def at(self, number: int) -> Pixels | None:
        """Return the picture of frame ``number`` or the last one before it that was kept, or None."""
        number -= number % self._every
        near = next((k for k in range(number, number - 2 * self._every - 30, -1) if k in self._pictures), None)
        if near is None:
            return None
        if self._decoded is None or self._decoded[0] != near:
            image = Image.open(io.BytesIO(self._pictures[near]), formats=["JPEG"]).convert("RGB")
            self._decoded = (near, np.asarray(image))
        return self._decoded[1]
