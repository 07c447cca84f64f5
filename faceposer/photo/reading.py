"""Reading of photos in bounded memory, with the orientation and the focal length from their EXIF data."""

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
from faceposer.files.images import foreign_format, open_image
from faceposer.files.reading import open_file
from faceposer.geometry.texture_images import DECODER_ERRORS

if TYPE_CHECKING:
    from PIL.Image import Image

#: Suffixes of images that Pillow reads, for dialogs and for files dropped onto the window.
PHOTO_SUFFIXES = (".jpg", ".jpeg", ".png", ".webp", ".tif", ".tiff", ".bmp", ".avif")
_JPEG = ("JPEG", "MPO")
MAX_PIXELS = 120_000_000
_MAX_BYTES = 512 * 2**20
_ORIENTATION, _EXIF, _FOCAL_35MM = 0x0112, 0x8769, 0xA405
# Diagonal of the 35 mm frame, 36 by 24 mm, to which equivalent focal lengths refer.
_FILM_DIAGONAL_MM = math.hypot(36.0, 24.0)
#: Likely focal length of a portrait, in mm on 35 mm film, and the standard deviation of its logarithm.
LIKELY_FOCAL_MM = 80.0
FOCAL_SPREAD = 0.3


@dataclass(frozen=True)
class PhotoFile:
    """Properties of an image file.

    Attributes:
        size: Width and height in pixels, with the orientation of the EXIF data applied.
        focal: Focal length in pixels from the EXIF data, or None if unknown.
    """

    size: tuple[int, int]
    focal: float | None


def focal_in_pixels(equivalent_mm: float, size: tuple[int, int]) -> float:
    """Return the focal length in pixels of an image of ``size`` from its equivalent on 35 mm film."""
    return equivalent_mm * math.hypot(*size) / _FILM_DIAGONAL_MM


def focal_in_mm(focal: float, size: tuple[int, int]) -> float:
    """Return the equivalent on 35 mm film, in mm, of a focal length of ``focal`` pixels."""
    return focal * _FILM_DIAGONAL_MM / math.hypot(*size)


def inspect_photo(path: Path) -> PhotoFile:
    """Return the properties of the image ``path``.

    Raises:
        FacePoserError: If it cannot be read, is not an image, or is too large.
    """
    with _opened(path) as image:
        value = image.getexif().get_ifd(_EXIF).get(_FOCAL_35MM)
        width, height = _upright_size(image)
        try:
            focal = float(value)
        except (TypeError, ValueError, ZeroDivisionError):
            focal = 0.0
        # Cameras write 0 for an unknown focal length.
        known = math.isfinite(focal) and 4.0 <= focal <= 5000.0
        return PhotoFile((width, height), focal_in_pixels(focal, (width, height)) if known else None)


def read_photo(path: Path, largest: int | None = None) -> NDArray[np.uint8]:
    """Return the pixels of the image ``path``, upright, top row first, shape (height, width, 3).

    Args:
        path: Image file.
        largest: Maximum length of the longer side, to which larger images are reduced.

    Raises:
        FacePoserError: If it cannot be read, is not an image, or is too large.
    """
    from PIL import Image, ImageOps

    with _opened(path) as image:
        if largest is not None:
            # JPEG can be decoded at a fraction of its size.
            image.draft("RGB", (largest, largest))
        # Pillow needs four bytes for a pixel: large photos are not copied.
        ImageOps.exif_transpose(image, in_place=True)
        upright: Image.Image = image
        if upright.mode in ("RGBA", "LA", "PA") or "transparency" in upright.info:
            layer = upright.convert("RGBA")
            upright = Image.alpha_composite(Image.new("RGBA", layer.size, (40, 42, 46, 255)), layer)
        reduced = _eight_bits(upright)
        if reduced.mode != "RGB":
            reduced = reduced.convert("RGB")
        if largest is not None and max(reduced.size) > largest:
            reduced.thumbnail((largest, largest), Image.Resampling.LANCZOS)
        return np.ascontiguousarray(np.asarray(reduced, dtype=np.uint8))


def _upright_size(image: Any) -> tuple[int, int]:
    """Return the width and height of the pixels that ``read_photo`` returns."""
    from PIL import ImageOps

    if image.format in _JPEG:
        width, height = image.size
        return (height, width) if image.getexif().get(_ORIENTATION) in (5, 6, 7, 8) else (width, height)
    # Some of Pillow's plug-ins turn the image themselves, when it is opened or when its pixels are read.
    width, height = ImageOps.exif_transpose(image).size
    return width, height


def _eight_bits(image: "Image") -> "Image":
    """Return a single-channel image of more than 8 bits scaled to 8 bits, which Pillow would clip instead."""
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
    """Open the image ``path``; errors during its use are reported as ``FacePoserError``."""
    from PIL import Image, UnidentifiedImageError

    try:
        with open_file(path) as file:
            foreign = foreign_format(file.read(64), path)
        if foreign:
            raise FacePoserError(f"The photo '{path}' is {foreign}, which cannot be read; save it as JPEG or PNG.")
        with open_file(path, _MAX_BYTES) as file, warnings.catch_warnings():
            # Pillow's warning has a lower limit than MAX_PIXELS.
            warnings.simplefilter("ignore", Image.DecompressionBombWarning)
            warnings.filterwarnings("ignore", category=UserWarning, module="PIL")
            with open_image(file) as image:
                if image.width * image.height > MAX_PIXELS:
                    raise FacePoserError(
                        f"The photo '{path}' has {image.width} x {image.height} pixels, more than "
                        f"{MAX_PIXELS // 10**6} million; reduce its size."
                    )
                yield image
    except FileNotFoundError as error:
        raise FacePoserError(f"There is no photo '{path}'; check the path.") from error
    except UnidentifiedImageError as error:
        raise FacePoserError(f"'{path}' is not an image in a supported format; use JPEG or PNG.") from error
    except Image.DecompressionBombError as error:
        raise FacePoserError(f"The photo '{path}' has too many pixels; reduce its size.") from error
    except OSError as error:
        # Pillow raises it as well, for truncated files, with wording of its own and without an error number.
        if error.strerror is None:
            raise FacePoserError(f"The photo '{path}' is damaged and cannot be read; copy it again.") from error
        raise FacePoserError(f"The photo '{path}' cannot be read: {error.strerror}.") from error
    except DECODER_ERRORS as error:
        raise FacePoserError(f"The photo '{path}' is damaged and cannot be read.") from error
