"""Where the 468 landmarks are on the skin of all heads, and how the networks err about them.

The places were learned from drawings of heads of the morphable model. Landmarks of the face's oval slide over the skin
when a head turns, so that they say little. The errors of the networks about one face belong together: a nose found too
long is too long at all its points. They are modelled in the picture, upright and in centimetres of the face, as
r = m + U z + e with z ~ N(0, I) and e ~ N(0, s_i²) (factor analysis).
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from faceposer.geometry.picking import SurfacePoints
from faceposer.identity.companion_file import read_companion, save_companion, unusable
from faceposer.landmarks.points import N_POINTS
from faceposer.resources import asset_path

Array = NDArray[np.float64]

FORMAT, NOUN = "faceposer.face-places", "file of face places"
#: The points of the face's oval, numbered as in MediaPipe's Face Mesh.
# fmt: off
OVAL: tuple[int, ...] = (
    10, 338, 297, 332, 284, 251, 389, 356, 454, 323, 361, 288, 397, 365, 379, 378, 400, 377, 152, 148, 176, 149, 150,
    136, 172, 58, 132, 93, 234, 127, 162, 21, 54, 103, 67, 109,
)
#: The inner edge of the lips.
INNER_LIPS: tuple[int, ...] = (
    78, 191, 80, 81, 82, 13, 312, 311, 310, 415, 308, 95, 88, 178, 87, 14, 317, 402, 318, 324,
)
#: The edges of the lids, of the right eye and of the left.
LIDS: tuple[int, ...] = (
    33, 7, 163, 144, 145, 153, 154, 155, 133, 173, 157, 158, 159, 160, 161, 246,
    263, 249, 390, 373, 374, 380, 381, 382, 362, 398, 384, 385, 386, 387, 388, 466,
)
# fmt: on
_MOST_MODES = 200


@dataclass(frozen=True, eq=False)
class LandmarkErrors:
    """Errors of landmarks in pictures, in centimetres of an upright face: x to the right, y down.

    Attributes:
        mean: m, shape (468, 2).
        modes: U, one row per mode, shape (q, 468, 2).
        deviations: s_i, the standard deviation of each coordinate apart from the modes, shape (468,).
    """

    mean: Array
    modes: Array
    deviations: Array

    @classmethod
    def plain(cls, deviation: float = 0.7) -> "LandmarkErrors":
        """Return independent errors with one ``deviation``, and three times that on the oval."""
        deviations = np.full(N_POINTS, deviation)
        deviations[list(OVAL)] *= 3.0
        return cls(np.zeros((N_POINTS, 2)), np.zeros((0, N_POINTS, 2)), deviations)


@dataclass(frozen=True, eq=False)
class FacePlaces:
    """The landmarks on the skin of the built-in heads.

    Attributes:
        points: Their places, on triangles of the built-in characters, of length 468.
        errors: Errors of the networks.
        credits: How they were learned.
    """

    points: SurfacePoints
    errors: LandmarkErrors
    credits: str = ""

    def save(self, path: Path) -> None:
        """Write the file ``path``, atomically.

        Raises:
            FacePoserError: If it cannot be written.
        """
        arrays: Mapping[str, NDArray[Any]] = {
            "faces": self.points.faces.astype(np.int32),
            "barycentric": self.points.barycentric.astype(np.float32),
            "errors.mean": self.errors.mean.astype(np.float32),
            "errors.modes": self.errors.modes.astype(np.float16),
            "errors.deviations": self.errors.deviations.astype(np.float32),
        }
        save_companion(path, FORMAT, NOUN, {"credits": self.credits}, arrays)


def read_face_places(path: Path) -> FacePlaces:
    """Return the places in the file ``path``.

    Raises:
        FacePoserError: If it cannot be read or is damaged.
    """
    meta, members = read_companion(path, FORMAT, NOUN)
    try:
        shares = members["barycentric"].astype(np.float64)
        errors = LandmarkErrors(
            *(members[f"errors.{name}"].astype(np.float64) for name in ("mean", "modes", "deviations"))
        )
        shapes = (members["faces"].shape, shares.shape, errors.mean.shape, errors.deviations.shape)
        if shapes != ((N_POINTS,), (N_POINTS, 3), (N_POINTS, 2), (N_POINTS,)):
            raise ValueError("shapes")
        if errors.modes.shape[1:] != (N_POINTS, 2) or len(errors.modes) > _MOST_MODES:
            raise ValueError("modes")
        if not (errors.deviations > 0.0).all() or members["faces"].min() < 0:
            raise ValueError("signs")
        points = SurfacePoints(members["faces"], shares / shares.sum(axis=1, keepdims=True))
        return FacePlaces(points, errors, str(meta.get("credits", "")))
    except (KeyError, TypeError, ValueError, IndexError) as error:
        raise unusable(path, NOUN, "its arrays do not belong together") from error


@lru_cache(maxsize=1)
def load_face_places() -> FacePlaces:
    """Return the shipped places.

    Raises:
        FacePoserError: If their file is missing or damaged.
    """
    return read_face_places(asset_path("identity-landmarks.npz"))
