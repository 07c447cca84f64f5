"""The pins file read by ``faceposer photo`` (docs/photo.md)."""

from pathlib import Path
from typing import Any

from faceposer.files.json_documents import JsonDocument, check_header, convert, read_json
from faceposer.photo.photo import Pin, PinsJson, check_places

FORMAT = "faceposer.pins"
VERSION = 1
_MAX_BYTES = 16 * 2**20


class _PinsFile(JsonDocument):
    pins: PinsJson

    def __post_init__(self) -> None:
        check_places(self.pins, "pins")


def read_pins(path: Path) -> tuple[Pin, ...]:
    """Return the pins in the file ``path``.

    Raises:
        FacePoserError: If the file cannot be read or is not a pins file; the message names the place.
    """
    return read_json(path, "pins", _pins_from_json, _MAX_BYTES)


def _pins_from_json(data: Any) -> tuple[Pin, ...]:
    check_header(data, FORMAT, VERSION)
    return tuple(pin.pin() for pin in convert(data, _PinsFile).pins)
