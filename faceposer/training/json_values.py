"""Values of weights in JSON of other tools: all must be numbers, and names must occur once."""

import codecs
import json
from functools import lru_cache
from typing import Any

from faceposer.errors import FacePoserError, short_name
from faceposer.files.json_documents import shown
from faceposer.files.tables import decimal_number
from faceposer.model.shape_names import canonical_shape

#: Keys of the value of a named weight.
VALUE_KEYS = ("score", "value", "weight", "values", "weights", "coefficient", "intensity", "keys", "frames")
_RATE_KEYS = ("rate", "fps", "framerate", "exportfps", "samplerate", "framespersecond", "samplingrate")
_NUMERATORS, _DENOMINATORS = ("num", "numerator"), ("den", "denominator")
_FASTEST = 1000.0
_DEEPEST = 12
_LONGEST_NAME = 128
_MARKS = (
    (codecs.BOM_UTF32_LE, "utf-32"),
    (codecs.BOM_UTF32_BE, "utf-32"),
    (codecs.BOM_UTF16_LE, "utf-16"),
    (codecs.BOM_UTF16_BE, "utf-16"),
)
# Bytes of the first line in which a document of lines has its first value.
_LONGEST_LINE = 2**20


def is_number(value: Any) -> bool:
    """Return True for a number, which true and false are not."""
    return isinstance(value, int | float) and not isinstance(value, bool)


def is_shape(name: Any) -> bool:
    """Return True for a name of one of ARKit's shapes in any spelling."""
    return shape_of(name) is not None


def shape_of(name: Any) -> str | None:
    """Return the one of ARKit's shapes that ``name`` spells, or None if it is another value."""
    if not isinstance(name, str):
        return None
    return _known_shape(name) if len(name) <= _LONGEST_NAME else canonical_shape(name)


# Frames repeat the names of their weights.
_known_shape = lru_cache(maxsize=4096)(canonical_shape)


def as_document(content: bytes) -> bytes:
    """Return JSON text in UTF-8 as one document: from UTF-16 or UTF-32, and a list for a value on each line."""
    for mark, name in _MARKS:
        if content.startswith(mark):
            content = content.decode(name, "replace").encode("utf-8")
            break
    else:
        if b"\0" in content[:2]:
            # The first character of JSON is a Latin one.
            content = content.decode("utf-16-be" if content[:1] == b"\0" else "utf-16-le", "replace").encode("utf-8")
    first, _, rest = content.removeprefix(codecs.BOM_UTF8).strip().partition(b"\n")
    if len(first) > _LONGEST_LINE or first[:1] not in (b"{", b"[") or rest.lstrip()[:1] not in (b"{", b"["):
        return content
    try:
        json.loads(first)
    except (ValueError, RecursionError):
        return content
    lines = [line for line in (first + b"\n" + rest).splitlines() if line.strip()]
    return b"[" + b",\n".join(lines) + b"]"


def check_values(data: Any, names: int = 0, where: str = "", depth: int = 0) -> None:
    """Check that weights of shapes in ``data`` are numbers.

    Args:
        data: Dictionaries, lists, strings, numbers, booleans and None.
        names: Length of the list of names around ``data``, or 0.
        where: Path of ``data`` in its file.
        depth: Nesting of ``data``.

    Raises:
        FacePoserError: If a value is none; the message names its place. An object or list without any number is a
            frame without a face.
    """
    if depth > _DEEPEST:
        return
    start = f"{where}." if where else ""
    if isinstance(data, dict):
        names = next((len(own) for own in data.values() if _are_names(own)), names)
        _check_all({f"{start}{_key(key)}": value for key, value in data.items() if is_shape(key)})
        for key, value in data.items():
            if isinstance(value, list) and is_shape(key):
                _check_row(value, f"{start}{_key(key)}")
            if isinstance(value, dict | list):
                check_values(value, names, f"{start}{_key(key)}"[-200:], depth + 1)
    elif isinstance(data, list):
        if names and len(data) == names and sum(map(is_number, data)) * 2 >= names:
            _check_row(data, where)
        named: dict[str, Any] = {}
        for i, element in enumerate(data):
            if isinstance(element, dict) and any(is_shape(value) for value in element.values()):
                named |= {f"{where}[{i}].{_key(k)}": v for k, v in element.items() if str(k).lower() in VALUE_KEYS}
            elif isinstance(element, list) and len(element) == 2 and is_shape(element[0]):
                named[f"{where}[{i}][1]"] = element[1]
        _check_all(named)
        for i, element in enumerate(data):
            if isinstance(element, dict | list):
                check_values(element, names, f"{where}[{i}]"[-200:], depth + 1)


def _check_all(values: dict[str, Any]) -> None:
    """Check that ``values`` by place are numbers, or contain further values, unless all are missing."""
    if all(value is None for value in values.values()):
        return
    for place, value in values.items():
        if not is_number(value) and not isinstance(value, dict | list):
            raise _no_number(place, value)


def _check_row(row: list[Any], where: str) -> None:
    wrong = next((i for i, value in enumerate(row) if not is_number(value)), None)
    if wrong is not None and any(map(is_number, row)) and not isinstance(row[wrong], dict | list):
        raise _no_number(f"{where}[{wrong}]", row[wrong])


def _no_number(place: str, value: Any) -> FacePoserError:
    return FacePoserError(f"{place} must be a number, not {shown(value)}; correct it, or remove its frame.")


def _are_names(value: Any) -> bool:
    return isinstance(value, list) and len(value) > 1 and all(is_shape(text) for text in value[:2])


def _key(key: Any) -> str:
    return short_name(str(key)[:40])


def rate_of(key: Any, value: Any) -> float | None:
    """Return the frames per second that ``value`` states if its ``key`` is that of a rate, or None.

    Rates are numbers, texts of numbers, and fractions: "30000/1001", or an object with numerator and denominator.
    """
    letters = "".join(letter for letter in str(key).lower() if letter.isalpha())
    if letters not in _RATE_KEYS:
        return None
    if isinstance(value, dict):
        parts = [next((value[key] for key in keys if key in value), None) for keys in (_NUMERATORS, _DENOMINATORS)]
    elif isinstance(value, str):
        text, _, below = value[:40].partition("/")
        parts = [decimal_number(text), decimal_number(below) if below else 1.0]
    else:
        parts = [value, 1.0]
    number, divisor = parts
    if number is None or not is_number(number) or divisor is None or not is_number(divisor) or not divisor:
        return None
    rate = float(number) / float(divisor)
    return rate if 0.0 < rate <= _FASTEST else None
