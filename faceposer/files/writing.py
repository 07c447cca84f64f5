"""Content of files to write: nothing that is not finite reaches a file."""

import json
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from faceposer.errors import FacePoserError
from faceposer.files.atomic import write_text

_LARGEST = float(np.finfo(np.float32).max)


def not_finite(path: Path, kind: str) -> FacePoserError:
    """Return the error of a file ``path`` with a number that is not finite; ``kind`` is a noun such as "session"."""
    return FacePoserError(f"The {kind} '{path}' cannot be written: a number in it is not finite.")


def check_finite(path: Path, kind: str, *values: ArrayLike) -> None:
    """Check that all ``values`` to be written to ``path`` are finite, in single precision, too.

    Raises:
        FacePoserError: If one is not; ``kind`` is a noun for the message, such as "mesh".
    """
    # Comparisons with NaN are False.
    if not all((np.abs(np.asarray(value, dtype=np.float64)) <= _LARGEST).all() for value in values):
        raise not_finite(path, kind)


def json_text(path: Path, data: Any, kind: str, indent: int | None = 1, ascii_only: bool = True) -> str:
    """Return ``data`` as the text of the JSON file ``path``, without a line end.

    Args:
        path: The file, for the message.
        data: The content.
        kind: Noun for the message, such as "report".
        indent: Spaces of a level; None for one line.
        ascii_only: Escape all other characters.

    Raises:
        FacePoserError: If a number is not finite.
    """
    try:
        return json.dumps(data, indent=indent, ensure_ascii=ascii_only, allow_nan=False)
    except ValueError as error:
        raise not_finite(path, kind) from error


def write_json(
    path: Path, data: Any, kind: str, indent: int | None = 1, ascii_only: bool = True, durable: bool = True
) -> None:
    """Write ``data`` as JSON to ``path``, atomically; see ``json_text`` and ``atomic_file`` for the arguments.

    Raises:
        FacePoserError: If a number is not finite, or the file cannot be written.
    """
    write_text(path, json_text(path, data, kind, indent, ascii_only) + "\n", kind, durable)


def with_null(data: Any) -> Any:
    """Return the JSON ``data`` with null in place of each number that is not finite."""
    return json.loads(json.dumps(data), parse_constant=lambda _: None)
