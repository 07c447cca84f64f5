"""The 468 points on the built-in man, to which other faces are compared.

They are members of ``assets/landmarks.npz``: ``reference``, positions in centimetres in the man's frame, found as on
any mesh and made symmetric; ``normals``, the directions of his skin there; and ``mirror``, the number of each point's
partner on the other side.
"""

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from faceposer.errors import FacePoserError
from faceposer.files.arrays import DamagedError, TooLargeError, read_arrays
from faceposer.landmarks.points import N_POINTS
from faceposer.resources import asset_path

Array = NDArray[np.float64]

_MAX_BYTES, _MAX_MEMBERS = 8 << 20, 1000


@dataclass(frozen=True, eq=False)
class Reference:
    """The points on the built-in man.

    Attributes:
        places: Positions in centimetres, shape (468, 3).
        normals: Unit normals of the skin there, shape (468, 3).
        mirror: Number of each point's partner on the other side, shape (468,).
    """

    places: Array
    normals: Array
    mirror: NDArray[np.int64]


@lru_cache(maxsize=1)
def reference() -> Reference:
    """Return the points on the built-in man.

    Raises:
        FacePoserError: If their file is missing or damaged.
    """
    return load_reference(asset_path("landmarks.npz"))


def load_reference(path: Path) -> Reference:
    """Read the points on the built-in man from ``path``.

    Raises:
        FacePoserError: If the file is missing or damaged.
    """
    try:
        members = read_arrays(path, _MAX_BYTES, _MAX_MEMBERS, {"reference", "normals", "mirror"})
        places, normals = (members[name].astype(np.float64) for name in ("reference", "normals"))
        mirror = members["mirror"].astype(np.int64)
        if places.shape != (N_POINTS, 3) or normals.shape != (N_POINTS, 3) or mirror.shape != (N_POINTS,):
            raise ValueError("wrong shapes")
        if not (np.isfinite(places).all() and np.isfinite(normals).all()):
            raise ValueError("not finite")
        if not np.array_equal(mirror[mirror], np.arange(N_POINTS)):
            raise ValueError("partners do not match")
        return Reference(places, normals, mirror)
    except (DamagedError, LookupError, OSError, TooLargeError, ValueError) as error:
        raise FacePoserError(
            f"The landmarks of the man in '{path}' cannot be read; install Face Poser again."
        ) from error
