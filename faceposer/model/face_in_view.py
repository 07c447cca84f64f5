"""The face in the image of a camera: its middle and its height, and whether a drawing in that image can show it."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from faceposer.geometry.camera import Camera
from faceposer.model.character import Character
from faceposer.model.feature_curves import FEATURES
from faceposer.model.framing import face_frame

Array = NDArray[np.float64]

# Least depth of the features before a camera that sees the face, and greatest distance of a drawing from the middle of
# the face, both in heights of the face.
_NEAREST, _FARTHEST = 0.1, 5.0


@dataclass(frozen=True, eq=False)
class FaceInView:
    """The neutral face in an image.

    Attributes:
        middle: Pixel of the middle of its features, shape (2,).
        height: Its height in pixels.
    """

    middle: Array
    height: float

    @classmethod
    def of(cls, character: Character, camera: Camera) -> "FaceInView":
        """Project the face of ``character``.

        Raises:
            ValueError: If a part of it lies behind the camera or too near to it.
        """
        places, size = _face_of(character)
        depths = camera.to_camera(places)[:, 2]
        if not depths.min() >= _NEAREST * size:
            raise ValueError(
                "its camera does not have the whole face in front of it; correct the camera's rotation and translation"
            )
        middle = 0.5 * (places.min(axis=0) + places.max(axis=0))
        depth = float(camera.to_camera(middle[None])[0, 2])
        return cls(camera.project(middle[None])[0], camera.focal * size / depth)

    def check_near(self, pixels: ArrayLike) -> None:
        """Raise a ValueError if one of ``pixels``, shape (n, 2), is more than five heights of the face away from it."""
        offsets = np.asarray(pixels, dtype=np.float64) - self.middle
        distance = float(np.hypot(*offsets.T).max()) / max(self.height, 1e-12)
        if not distance <= _FARTHEST:
            raise ValueError(
                f"its stroke is {min(distance, 1e12):.3g} heights of the face away from the face in its camera; "
                f"draw it within {_FARTHEST:g}"
            )


@lru_cache(maxsize=2)
def _face_of(character: Character) -> tuple[Array, float]:
    """Return the feature points of the drawable features, (n, 3), and the height of the face."""
    known = character.feature_points
    names = sorted({name for feature in FEATURES.values() for name in feature.points if name in known})
    vertices = character.vertices.astype(np.float64)
    places = vertices[[known[name] for name in names]] if names else vertices
    return places, face_height(character, places)


def face_height(character: Character, places: Array) -> float:
    """Return the height of the face from its frame, else from ``places`` of its features, shape (n, 3)."""
    frame = face_frame(character)
    if frame is not None:
        return float(np.linalg.norm(frame.hairline - frame.chin))
    size = 1.5 * float(np.ptp(places[:, 1])) if len(places) else 0.0
    return size if size > 1e-3 * character.height else float(character.height)
