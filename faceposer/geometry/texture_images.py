"""Encoded images for textures: checked, and converted to PNG where a character file cannot store their format."""

import io
import re
import struct
import warnings
from contextlib import suppress
from pathlib import Path

from faceposer.files import paths
from faceposer.files.images import foreign_format, open_image

_MOST_NOTES = 6
_KEPT = ("PNG", "JPEG")
_MAX_BYTES = 256 << 20
_MAX_PIXELS = 16384 * 8192

#: Raised by Pillow's decoders for damaged files, besides OSError.
DECODER_ERRORS = (
    *(SyntaxError, ValueError, RuntimeError, EOFError),
    *(LookupError, TypeError, MemoryError, struct.error),
)


class UnusableImageError(Exception):
    """Raised for an image that cannot be a texture; the message is the reason, a clause."""


def texture_image(data: bytes, name: str = "") -> bytes:
    """Return the encoded image ``data`` as PNG or JPEG; ``name`` is that of its file, if it is known.

    Raises:
        UnusableImageError: If it is damaged, too large, or in a format that cannot be read.
    """
    from PIL import Image, UnidentifiedImageError

    foreign = foreign_format(data[:64], name)
    if foreign:
        raise UnusableImageError(f"it is {foreign}, which cannot be read; save it as JPEG or PNG")
    if len(data) > _MAX_BYTES:
        raise UnusableImageError(f"it is larger than {_MAX_BYTES >> 20} MB")
    try:
        with warnings.catch_warnings():
            # Pillow's warning has a lower limit than this module.
            warnings.simplefilter("ignore")
            with open_image(io.BytesIO(data)) as image:
                if image.width * image.height > _MAX_PIXELS:
                    raise UnusableImageError(f"it has {image.width} x {image.height} pixels")
                kept = image.format in _KEPT
                image.load()
                if kept:
                    return data
                encoded = io.BytesIO()
                image.convert("RGBA" if image.has_transparency_data else "RGB").save(encoded, format="PNG")
                return encoded.getvalue()
    except UnidentifiedImageError as error:
        raise UnusableImageError("it is not an image in a supported format") from error
    except Image.DecompressionBombError as error:
        raise UnusableImageError("it has too many pixels") from error
    except (OSError, *DECODER_ERRORS) as error:
        raise UnusableImageError("it is damaged") from error


class TextureReader:
    """Reads the textures of materials, and collects notes on those that cannot be used."""

    def __init__(self) -> None:
        self.textures: dict[str, bytes] = {}
        self._problems: list[str] = []

    def read(self, material: str, name: str, data: bytes) -> None:
        """Add the encoded image ``data``, called ``name``, as the texture of ``material`` if it can be used."""
        try:
            self.textures[material] = texture_image(data, name)
        except UnusableImageError as error:
            self.problem(material, name, str(error))

    def problem(self, material: str, name: str, reason: str) -> None:
        """Note why the image ``name`` of ``material`` cannot be used."""
        self._problems.append(f"The texture '{name[-80:]}' of the material '{material[:60]}' is not used: {reason}.")

    @property
    def notes(self) -> tuple[str, ...]:
        """Notes for the user, one sentence each."""
        rest = len(self._problems) - _MOST_NOTES
        more = (f"{rest} further textures are not used.",) if rest > 0 else ()
        return (*self._problems[:_MOST_NOTES], *more)


def file_in(folder: Path, name: str) -> Path:
    """Return the file ``name`` of another computer in ``folder``: below it, or else by its last part.

    Raises:
        UnusableImageError: If there is no such file, or it lies outside of the folder.
    """
    if re.match(r"[A-Za-z][A-Za-z0-9+.-]+://", name):
        raise UnusableImageError("it is a URL, and nothing is downloaded; save it next to the file")
    parts = [part for part in name.replace("\\", "/").split("/") if part not in ("", ".")]
    outside = False
    for tail in (parts, parts[-1:]):
        path = folder.joinpath(*tail) if tail else folder
        with suppress(OSError, ValueError):
            found = path if paths.is_file(path) else _ignoring_case(path)
            if found is not None:
                if found.resolve().is_relative_to(folder.resolve()):
                    return found
                outside = True
    if outside:
        raise UnusableImageError(f"it lies outside of the folder '{folder}'; copy it there")
    raise UnusableImageError(f"there is no such file in the folder '{folder}'; copy it there")


def _ignoring_case(path: Path) -> Path | None:
    """Return the only file beside ``path`` with its name in another case, as files from Windows have."""
    if not paths.is_dir(path.parent):
        return None
    found = [
        other for other in path.parent.iterdir() if other.name.lower() == path.name.lower() and paths.is_file(other)
    ]
    return found[0] if len(found) == 1 else None
