"""The pins file read by ``faceposer photo`` (docs/photo.md)."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from faceposer.errors import FacePoserError
from faceposer.files import paths
from faceposer.files.json_documents import JsonDocument, check_header, convert, read_json
from faceposer.photo.photo import Pin, PinsJson, check_places

FORMAT = "faceposer.pins"
VERSION = 1
_MAX_BYTES = 16 * 2**20
# Number of pins from which they cannot all be at one place, and its extent in pixels.
_MANY, _ONE_PLACE = 4, 2.0


class _PinsFile(JsonDocument):
    pins: PinsJson

    def __post_init__(self) -> None:
        check_places(self.pins, "pins")


def read_pins(path: Path) -> tuple[Pin, ...]:
    """Return the pins in the file ``path``.

    Raises:
        FacePoserError: If the file cannot be read or is not a pins file; the message names the place.
    """
    if not paths.exists(path):
        raise FacePoserError(f"There is no file of pins '{path}'; check the path.")
    return read_json(path, "pins", _pins_from_json, _MAX_BYTES)


def check_inside(path: Path, pins: Sequence[Pin], size: tuple[int, int]) -> None:
    """Check that ``pins``, read from ``path``, are inside a photo of ``size``, and not all at one place.

    Raises:
        FacePoserError: If they are not; the message names the pin.
    """
    for i, (u, v) in enumerate(pin.pixel for pin in pins):
        if not (0.0 <= u <= size[0] and 0.0 <= v <= size[1]):
            raise FacePoserError(
                f"In '{path}', pins[{i}] is at ({u:g}, {v:g}), outside the photo of {size[0]} x {size[1]} pixels; "
                "give its position in pixels from the top left."
            )
    if len(pins) >= _MANY:
        across, down = zip(*(pin.pixel for pin in pins), strict=True)
        if max(max(across) - min(across), max(down) - min(down)) < _ONE_PLACE:
            raise FacePoserError(f"In '{path}', all pins are at ({across[0]:g}, {down[0]:g}); give each its own place.")


def _pins_from_json(data: Any) -> tuple[Pin, ...]:
    check_header(data, FORMAT, VERSION)
    return tuple(pin.pin() for pin in convert(data, _PinsFile).pins)
