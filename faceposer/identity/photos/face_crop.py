"""The part of a photo with the face, at the size at which faces are fitted."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from faceposer.geometry.camera import Camera
from faceposer.identity.photos.landmark_fit import PhotoFace
from faceposer.landmarks.points import N_POINTS

Array = NDArray[np.float64]

# Height of the landmarks in the crop, in pixels, and the margin around them, as a share of their extent.
_HEIGHT, _MARGIN = 280.0, 0.35
_LARGEST_FACTOR = 2.0


@dataclass(frozen=True, eq=False)
class FaceCrop:
    """A crop of a photo.

    Attributes:
        face: The face, in pixels of the crop.
        image: Colours, 0 to 1, shape (h, w, 3).
        corner: Its left top corner in the photo.
        factor: Pixels of the crop per pixel of the photo.
        photo_size: Width and height of the photo.
    """

    face: PhotoFace
    image: Array
    corner: tuple[float, float]
    factor: float
    photo_size: tuple[int, int]

    @classmethod
    def of(cls, face: PhotoFace, pixels: NDArray[np.uint8], height: float = _HEIGHT) -> "FaceCrop":
        """Return the crop of the photo with ``pixels`` around its ``face``, whose landmarks get the ``height``."""
        points = face.landmarks.points[:N_POINTS, :2]
        low, high = points.min(axis=0), points.max(axis=0)
        margin = _MARGIN * float((high - low).max())
        first = np.maximum(np.floor(low - margin), 0.0)
        last = np.minimum(np.ceil(high + margin), face.size)
        last = np.maximum(last, first + 1.0)
        factor = min(height / max(float((high - low).max()), 1.0), _LARGEST_FACTOR)
        width, tall = (max(round(extent * factor), 8) for extent in (last - first).tolist())
        box = (*first.tolist(), *(first + np.array([width, tall]) / factor).tolist())
        box = (box[0], box[1], min(box[2], face.size[0]), min(box[3], face.size[1]))
        picture = Image.fromarray(pixels).resize((width, tall), Image.Resampling.BICUBIC, box=box)
        x, y = first.tolist()
        landmarks = face.landmarks
        moved = replace(
            landmarks,
            points=(landmarks.points - (x, y, 0.0)) * factor,
            iris=(landmarks.iris - (x, y, 0.0)) * factor,
            box=(landmarks.box - (x, y, x, y)) * factor,
        )
        u, v = ((centre - start) * factor for centre, start in zip(face.centre, (x, y), strict=True))
        cropped = replace(
            face, landmarks=moved, size=(width, tall), focal=face.focal * factor, principal=(float(u), float(v))
        )
        return cls(cropped, np.asarray(picture, dtype=np.float64) / 255.0, (x, y), factor, face.size)

    def whole(self, camera: Camera) -> Camera:
        """Return ``camera`` of the crop as a camera of the photo."""
        u, v = (camera.principal_point / self.factor + self.corner).tolist()
        width, height = self.photo_size
        shift = (u - width / 2.0, v - height / 2.0)
        return replace(camera, focal=camera.focal / self.factor, size=self.photo_size, shift=shift)
