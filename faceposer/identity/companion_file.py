"""Files next to that of the morphable model: attributes and textures, as NumPy archives without pickled objects."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from faceposer.errors import FacePoserError
from faceposer.files.arrays import DamagedError, TooLargeError, read_arrays
from faceposer.files.atomic import atomic_file
from faceposer.files.json_documents import parse_json
from faceposer.files.writing import check_finite, json_text

VERSION = 1
_MAX_BYTES, _MAX_MEMBERS = 64 << 20, 200


def read_companion(path: Path, format_name: str, noun: str) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
    """Return metadata and arrays of the file ``path``.

    Args:
        path: The file.
        format_name: Its format, such as "faceposer.attributes".
        noun: What it contains, for messages.

    Raises:
        FacePoserError: If it cannot be read, is damaged, or has another format or version.
    """
    try:
        members = read_arrays(path, _MAX_BYTES, _MAX_MEMBERS)
        meta = parse_json(members.pop("meta").tobytes(), unique_keys=True)
    except TooLargeError:
        raise unusable(path, noun, "it is too large") from None
    except OSError as error:
        raise unusable(path, noun, f"it cannot be read ({error.strerror or error})") from error
    except (DamagedError, KeyError, FacePoserError) as error:
        raise unusable(path, noun, "it is damaged or has no metadata") from error
    if not isinstance(meta, dict) or meta.get("format") != format_name:
        raise unusable(path, noun, f"its format is not {format_name}")
    if meta.get("version") != VERSION:
        raise unusable(path, noun, f"it has version {meta.get('version')!r}, and this program reads version {VERSION}")
    for name, array in members.items():
        if array.dtype.kind not in "iuf" or not np.isfinite(array).all():
            raise unusable(path, noun, f"'{name}' is not numbers")
    return meta, members


def save_companion(
    path: Path, format_name: str, noun: str, meta: Mapping[str, Any], arrays: Mapping[str, NDArray[Any]]
) -> None:
    """Write metadata and arrays, atomically; arguments as in `read_companion`.

    Raises:
        FacePoserError: If the file cannot be written, or a number is not finite.
    """
    check_finite(path, noun, *arrays.values())
    text = json_text(path, {**meta, "format": format_name, "version": VERSION}, noun)
    members = {"meta": np.frombuffer(text.encode(), dtype=np.uint8), **arrays}
    with atomic_file(path, noun) as temporary, temporary.open("wb") as file:
        np.savez_compressed(file, allow_pickle=False, **members)


def unusable(path: Path, noun: str, reason: str) -> FacePoserError:
    """Return the error that the file ``path`` with ``noun`` cannot be used."""
    return FacePoserError(f"The {noun} '{path}' cannot be used: {reason}; install Face Poser again.")
