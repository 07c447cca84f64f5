"""The file of pins that ``faceposer photo`` reads (docs/photo.md)."""

import json
from pathlib import Path

from faceposer.errors import FacePoserError
from faceposer.photo.photo import Pin, pins_from_json
from faceposer.solve.constraints import codec

FORMAT = "faceposer.pins"
VERSION = 1
_MAX_BYTES = 16 * 2**20


def read_pins(path: Path) -> tuple[Pin, ...]:
    """Return the pins in the file ``path``.

    Raises:
        FacePoserError: If the file cannot be read or is not such a file, naming the place.
    """
    try:
        if path.stat().st_size > _MAX_BYTES:
            raise FacePoserError(f"The pins '{path}' are larger than {_MAX_BYTES // 2**20} MB; they cannot be pins.")
        data = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise FacePoserError(f"The pins '{path}' cannot be read ({error.strerror}); check the path.") from error
    except json.JSONDecodeError as error:
        raise FacePoserError(
            f"The pins '{path}' are not valid JSON at line {error.lineno}, column {error.colno}: {error.msg}."
        ) from error
    except (ValueError, RecursionError) as error:
        raise FacePoserError(f"The pins '{path}' are not valid JSON; write them as plain UTF-8.") from error
    if not isinstance(data, dict) or data.get("format") != FORMAT or data.get("version") != VERSION:
        raise FacePoserError(
            f"'{path}' is no file of pins: it lacks '\"format\": \"{FORMAT}\"' or '\"version\": {VERSION}'."
        )
    try:
        codec.check_keys(data, {"format", "version", "pins"}, set(), "the file")
        return pins_from_json(data["pins"], "pins")
    except FacePoserError as error:
        raise FacePoserError(f"The pins '{path}': {error}") from error
