"""Writes pictures to files."""

import os
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from faceposer.errors import FacePoserError


def write_png(path: Path, picture: NDArray[np.uint8]) -> None:
    """Write ``picture``, shape (height, width, 3), as PNG, all or nothing.

    Raises:
        FacePoserError: If the file cannot be written.
    """
    temporary = path.with_name(f".{path.name}.{os.getpid()}.tmp")
    try:
        Image.fromarray(picture).save(temporary, format="PNG", optimize=True)
        temporary.replace(path)
    except OSError as error:
        temporary.unlink(missing_ok=True)
        raise FacePoserError(f"The picture '{path}' cannot be written: {error.strerror}.") from error
