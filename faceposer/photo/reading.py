"""Reads photos: upright as their EXIF data says, with the focal length that it tells, in bounded memory."""

import math
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from faceposer.errors import FacePoserError

if TYPE_CHECKING:
    from PIL.Image import Image

#: Endings of pictures that Pillow reads, for dialogs and for what is dropped onto the window.
PHOTO_SUFFIXES = (".jpg", ".jpeg", ".png", ".webp", ".tif", ".tiff", ".bmp", ".avif")
#: Endings of pictures that people have and Pillow does not read, said in a sentence of their own.
FOREIGN_SUFFIXES = (".heic", ".heif", ".dng", ".cr2", ".cr3", ".nef", ".arw", ".raf", ".psd")
MAX_PIXELS = 120_000_000
_MAX_BYTES = 512 * 2**20
_ORIENTATION, _EXIF, _FOCAL_35MM = 0x0112, 0x8769, 0xA405
# Diagonal of the 35 mm film's frame, 36 by 24 mm, which equivalent focal lengths speak of.
_FILM_DIAGONAL_MM = math.hypot(36.0, 24.0)
#: Focal length that a portrait is likely to have, in mm on 35 mm film, and the usual spread of its logarithm.
LIKELY_FOCAL_MM = 80.0
FOCAL_SPREAD = 0.3


@dataclass(frozen=True)
class PhotoFile:
    """What a picture's file tells without its pixels.

    Attributes:
        size: Width and height in pixels, upright.
        focal: Focal length in pixels by its EXIF data, or None where they say nothing.
    """

    size: tuple[int, int]
    focal: float | None


def focal_in_pixels(equivalent_mm: float, size: tuple[int, int]) -> float:
    """Return the focal length in pixels of a picture of ``size`` that is ``equivalent_mm`` on 35 mm film."""
    return equivalent_mm * math.hypot(*size) / _FILM_DIAGONAL_MM


def focal_in_mm(focal: float, size: tuple[int, int]) -> float:
    """Return the focal length of ``focal`` pixels as mm on 35 mm film."""
    return focal * _FILM_DIAGONAL_MM / math.hypot(*size)


def inspect_photo(path: Path) -> PhotoFile:
    """Return what the picture ``path`` tells, without reading its pixels.

    Raises:
        FacePoserError: If it cannot be read, is no picture, or is too large.
    """
    with _opened(path) as image:
        exif = image.getexif()
        width, height = image.size
        if exif.get(_ORIENTATION) in (5, 6, 7, 8):
            width, height = height, width
        value = exif.get_ifd(_EXIF).get(_FOCAL_35MM)
        try:
            focal = float(value)
        except (TypeError, ValueError, ZeroDivisionError):
            focal = 0.0
        # A camera that does not know writes 0.
        known = math.isfinite(focal) and 4.0 <= focal <= 5000.0
        return PhotoFile((width, height), focal_in_pixels(focal, (width, height)) if known else None)


def read_photo(path: Path, largest: int | None = None) -> NDArray[np.uint8]:
    """Return the pixels of the picture ``path``, upright, top row first, shape (height, width, 3).

    Args:
        path: Of the file.
        largest: The longer side that it is brought down to, if it is longer.

    Raises:
        FacePoserError: If it cannot be read, is no picture, or is too large.
    """
    from PIL import Image, ImageOps

    with _opened(path) as image:
        if largest is not None:
            # JPEG can be decoded at a fraction of its size.
            image.draft("RGB", (largest, largest))
        upright = ImageOps.exif_transpose(image)
        if upright.mode in ("RGBA", "LA", "PA") or "transparency" in upright.info:
            layer = upright.convert("RGBA")
            upright = Image.alpha_composite(Image.new("RGBA", layer.size, (40, 42, 46, 255)), layer)
        picture = _eight_bits(upright).convert("RGB")
        if largest is not None and max(picture.size) > largest:
            picture.thumbnail((largest, largest), Image.Resampling.LANCZOS)
        return np.ascontiguousarray(np.asarray(picture, dtype=np.uint8))


def _eight_bits(image: "Image") -> "Image":
    """Return a picture of one channel with more than 8 bits as one with 8, which Pillow would cut off instead."""
    from PIL import Image

    if not image.mode.startswith(("I", "F")):
        return image
    values = np.asarray(image, dtype=np.float64)
    most = float(np.nanmax(values, initial=0.0))
    white = next((white for white in (1.0, 255.0, 65535.0) if most <= white), most)
    if image.mode.startswith("I;16"):
        white = 65535.0
    return Image.fromarray(np.nan_to_num(255.0 * values / white).clip(0.0, 255.0).round().astype(np.uint8))


@contextmanager
def _opened(path: Path) -> Iterator[Any]:
    """Give the picture ``path``; whatever goes wrong while it is used becomes one sentence."""
    from PIL import Image, UnidentifiedImageError

    if path.suffix.lower() in FOREIGN_SUFFIXES:
        raise FacePoserError(f"The photo '{path}' is in a format that cannot be read here; save it as JPEG or PNG.")
    try:
        if path.stat().st_size > _MAX_BYTES:
            raise FacePoserError(f"The photo '{path}' is larger than {_MAX_BYTES // 2**20} MB; save it smaller.")
        with warnings.catch_warnings():
            # The limit is our own; Pillow's warning comes at another.
            warnings.simplefilter("ignore", Image.DecompressionBombWarning)
            warnings.filterwarnings("ignore", category=UserWarning, module="PIL")
            with Image.open(path) as image:
                if image.width * image.height > MAX_PIXELS:
                    raise FacePoserError(
                        f"The photo '{path}' has {image.width} x {image.height} pixels, more than "
                        f"{MAX_PIXELS // 10**6} million; save it smaller."
                    )
                yield image
    except FileNotFoundError as error:
        raise FacePoserError(f"There is no photo '{path}'; check the path.") from error
    except UnidentifiedImageError as error:
        raise FacePoserError(f"'{path}' is no picture that can be read here; give a JPEG or a PNG.") from error
    except Image.DecompressionBombError as error:
        raise FacePoserError(f"The photo '{path}' has too many pixels; save it smaller.") from error
    except OSError as error:
        reason = error.strerror or str(error)
        raise FacePoserError(f"The photo '{path}' cannot be read: {reason.rstrip('.')}.") from error
    except (SyntaxError, ValueError, EOFError, IndexError, KeyError, TypeError, MemoryError) as error:
        # What Pillow's decoders raise on damaged files.
        raise FacePoserError(f"The photo '{path}' is damaged and cannot be read.") from error
