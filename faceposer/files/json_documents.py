"""JSON documents: reading with size limits, and conversion to declared types with messages that name the place."""

import json
import math
import re
import reprlib
from collections.abc import Callable
from pathlib import Path
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, TypeVar, Union, get_args, get_origin

import msgspec
import numpy as np

from faceposer.errors import FacePoserError, short_name
from faceposer.files.reading import RefusedError, read_bytes

T = TypeVar("T")

#: Maximum nesting depth of lists and objects.
MAX_DEPTH = 64
#: Approximate memory of the values of a file in Python, in bytes, by the characters that count them.
_MEMORY = {b",": 40, b"[": 64, b"{": 200, b'"': 30}
_MAX_MEMORY = 640 * 2**20
_MAX_DIGITS, _LONGEST_NUMBER = 308, 24
#: Anything that may be a number of ``_MAX_DIGITS`` digits, or beyond the range of floating point.
_LARGE_NUMBER = re.compile(rb"[0-9]{308}|[eE][+]?[0-9]{3}")
_BRACKETS = b"[]{}"
_ALL_ELSE = bytes(set(range(256)) - set(_BRACKETS + b'"'))
_PLURALS = {bool: "flags", int: "whole numbers", float: "numbers", str: "texts", list: "lists", tuple: "lists"}
# A text with a lone surrogate, which JSON can contain, cannot be compared with the names of keys and choices.
_UNFIT = (msgspec.ValidationError, UnicodeEncodeError)
# What the parser of Python calls the errors of texts.
_REASONS = {
    "Extra data": "more text follows the end",
    "Expecting value": "a value is missing",
    "Expecting ',' delimiter": "a comma is missing",
    "Expecting ':' delimiter": "a colon is missing",
    "Expecting property name": "a key in double quotes is missing",
    "Illegal trailing comma": "a comma is too many",
    "Unterminated string": "a text has no closing quote",
    "Invalid control character": "a text contains a line end or control character",
    "Invalid \\": "a text contains a wrong escape",
}
_SHORT = reprlib.Repr()
_SHORT.maxother = _SHORT.maxstring = 40


class JsonObject(msgspec.Struct, forbid_unknown_fields=True):
    """Base of the declared types of JSON objects: unknown keys are errors, and keys without a default are required.

    A subclass may validate its fields in ``__post_init__`` and raise ``JsonError``. ``msgspec.Meta`` may override the
    text derived from the type of a field with a ``description``, such as "a word", and with a ``title``, the plural for
    lists of it.
    """


class JsonDocument(JsonObject):
    """Base of the declared types of whole files; ``check_header`` validates the header."""

    format: Any
    version: Any


class JsonError(ValueError):
    """Inconsistent fields of an object; raised by ``__post_init__`` of a ``JsonObject``.

    Args:
        reason: Predicate of a sentence about the object or its ``key``, such as "must be shorter".
        key: The field concerned.
    """

    def __init__(self, reason: str, key: str = "") -> None:
        super().__init__(reason)
        self.key = key


class UnreadableError(FacePoserError):
    """A file could not be read; its content may be valid."""


def read_json(
    path: Path,
    kind: str,
    parse: Callable[[Any], T],
    max_bytes: int = 2**20,
    prepare: Callable[[bytes], bytes] = bytes,
) -> T:
    """Return the result of ``parse`` for the JSON in the file ``path``: UTF-8, with or without a byte order mark.

    Objects with duplicate keys are rejected, since all values but one would be lost.

    Args:
        path: A regular file.
        kind: Noun for messages, such as "session".
        parse: Converts the data; raises ``FacePoserError`` with a sentence about the content.
        max_bytes: Maximum size of the file.
        prepare: Converts the content of the file to such JSON.

    Raises:
        UnreadableError: If the file cannot be read.
        FacePoserError: If the content is invalid; the message names the file and the place in it.
    """
    try:
        data = parse_json(prepare(read_bytes(path, max_bytes)), unique_keys=True)
    except RefusedError as error:
        raise FacePoserError(f"The {kind} '{path}' cannot be read: {error.strerror}.") from error
    except OSError as error:
        raise UnreadableError(f"The {kind} '{path}' cannot be read: {error.strerror or error}.") from error
    except FacePoserError as error:
        raise FacePoserError(f"The {kind} '{path}' cannot be read: {error}.") from error
    try:
        return parse(data)
    except FacePoserError as error:
        raise FacePoserError(f"The {kind} '{path}' cannot be used: {error}") from error


def check_header(data: Any, name: str, version: int) -> None:
    """Raise ``FacePoserError`` unless ``data`` is an object with this "format" and "version"."""
    if not isinstance(data, dict) or data.get("format") != name:
        raise FacePoserError(f'the file has no "format": "{name}".')
    found = data.get("version")
    if isinstance(found, bool) or found != version:
        raise FacePoserError(f"version is {shown(found)}; this program reads version {version}.")


def convert(data: Any, form: type[T], where: str = "") -> T:
    """Return ``data``, as parsed from JSON, converted to the declared type ``form``.

    Args:
        data: Dictionaries, lists, strings, numbers, booleans and None.
        form: A ``JsonObject``, or another type that msgspec can convert to.
        where: Path of ``data`` in its file, such as "constraints[3]"; "" for the whole file.

    Raises:
        FacePoserError: If it does not match; the message starts with the path of the wrong value.
    """
    try:
        return msgspec.convert(data, form)
    except _UNFIT as error:
        raise FacePoserError(f"{_problem(data, form, where)}.") from error


def given(value: T | msgspec.UnsetType) -> T | None:
    """Return the ``value`` of an optional key, or None if it is missing in the file."""
    return None if isinstance(value, msgspec.UnsetType) else value


def shown(value: Any) -> str:
    """Return ``value`` abbreviated for a message, in JSON notation where possible."""
    text = json.dumps(value) if value is None or isinstance(value, bool) else _SHORT.repr(value)
    return text if len(text) <= 40 else text[:37] + "..."


def parse_json(content: bytes, unique_keys: bool = False) -> Any:
    """Return the data in JSON text: UTF-8, with or without a byte order mark. Its memory and depth are checked first.

    Numbers that are not finite become objects that no declared type accepts.

    Args:
        content: The text.
        unique_keys: True to reject objects with duplicate keys; else the last value counts.

    Raises:
        FacePoserError: If it is invalid; the message is a reason without full stop, such as "not valid JSON at line 1".
    """
    try:
        return _parse(content, unique_keys)
    except json.JSONDecodeError as error:
        place = f"line {error.lineno}, column {error.colno}"
        reason = next((text for begin, text in _REASONS.items() if error.msg.startswith(begin)), "")
        raise FacePoserError(f"not valid JSON at {place}{f' ({reason})' if reason else ''}") from error
    except UnicodeDecodeError as error:
        raise FacePoserError("it is not a text file in UTF-8") from error
    except RecursionError as error:
        raise FacePoserError("not valid JSON, nested too deeply") from error


def _parse(content: bytes, unique_keys: bool) -> Any:
    # The parser of Python, not of msgspec: it reports the line of an error and detects duplicate keys.
    memory = sum(size * content.count(mark) for mark, size in _MEMORY.items())
    if memory > _MAX_MEMORY:
        raise FacePoserError(f"its values would take {memory >> 20} MB, more than {_MAX_MEMORY >> 20} MB")
    text = content.decode("utf-8-sig")
    # Once escaped quotes are removed, every other part between quotes is outside of strings.
    plain = content.replace(b"\\\\", b"").replace(b'\\"', b"").translate(None, _ALL_ELSE)
    marks = np.frombuffer(plain, dtype=np.uint8)
    brackets = marks[(np.cumsum(marks == ord('"')) % 2 == 0) & (marks != ord('"'))]
    opening = (brackets == ord("[")) | (brackets == ord("{"))
    if np.cumsum(np.where(opening, 1, -1)).max(initial=0) > MAX_DEPTH:
        raise RecursionError
    large = _LARGE_NUMBER.search(content) is not None
    return json.loads(
        text,
        parse_constant=_Constant,
        object_pairs_hook=_unique_pairs if unique_keys else None,
        parse_int=_whole_number if large else None,
        parse_float=_finite_number if large else None,
    )


def _whole_number(digits: str) -> Any:
    return _Constant(digits) if len(digits) > _MAX_DIGITS else int(digits)


def _finite_number(text: str) -> Any:
    value = float(text)
    return value if math.isfinite(value) else _Constant(text)


class _Constant:
    """A number that is not finite or far too large; no declared type accepts it, so that its place is reported."""

    def __init__(self, name: str) -> None:
        self._name = name if len(name) <= _LONGEST_NUMBER else f"{name[:_LONGEST_NUMBER]}..."

    def __repr__(self) -> str:
        return self._name

    def __float__(self) -> float:
        return math.nan


def _unique_pairs(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    result = dict(pairs)
    if len(result) < len(pairs):
        seen: set[str] = set()
        twice = next(name for name, _ in pairs if name in seen or seen.add(name))  # type: ignore[func-returns-value]
        raise FacePoserError(f'the key "{short_name(twice)}" occurs twice')
    return result


# Messages


def _problem(data: Any, form: Any, where: str) -> str:
    """Return a description, without full stop, of the first value in ``data`` that does not match ``form``."""
    form = _alternative(form, data)
    bare, meta = _split(form)
    place = where or "the file"
    if isinstance(data, dict) and _is_object(bare):
        return _problem_of_object(data, bare, where)
    if isinstance(data, dict) and get_origin(bare) is dict:
        items = [(f"{where}.{short_name(key[:40])}", value, get_args(bare)[1]) for key, value in data.items()]
    elif isinstance(data, list) and get_origin(bare) in (list, tuple):
        kinds = get_args(bare)
        fixed = get_origin(bare) is tuple and kinds[-1] is not Ellipsis
        items = [
            (f"{where}[{i}]", value, kinds[i] if fixed else kinds[0])
            for i, value in enumerate(data[: len(kinds)] if fixed else data)
        ]
        least, most = _lengths(bare, meta)
        if not least <= len(data) <= (len(data) if most is None else most):
            return f"{place} must be {_phrase(form)}, not {len(data)}"
    else:
        items = []
    for path, value, kind in items:
        if not _fits(value, kind):
            return _problem(value, kind, path)
    if get_origin(bare) is Literal:
        return f"{place} is {shown(data)}; it must be {_phrase(form)}"
    return f"{place} must be {_phrase(form)}, not {shown(data)}"


def _problem_of_object(data: dict[str, Any], form: type[msgspec.Struct], where: str) -> str:
    place, start = where or "the file", f"{where}." if where else ""
    fields = {field.name: field for field in msgspec.structs.fields(form)}
    unknown = sorted(set(data) - set(fields))
    if unknown and form.__struct_config__.forbid_unknown_fields:
        return f"{place} has the unknown key {shown(unknown[0])}; the keys here are {_quoted(fields)}"
    missing = [name for name, field in fields.items() if field.required and name not in data]
    if missing:
        return f"{place} lacks the key '{missing[0]}'"
    for name, value in ((name, data[name]) for name in fields if name in data):
        if not _fits(value, fields[name].type):
            return _problem(value, fields[name].type, f"{start}{name}")
    try:
        msgspec.convert(data, form)
    except _UNFIT as error:
        if isinstance(error.__cause__, JsonError):
            return f"{start}{error.__cause__.key} {error}" if error.__cause__.key else f"{place} {error}"
        return f"{place}: {error}" if isinstance(error, msgspec.ValidationError) else f"{place} has an invalid text"
    raise AssertionError(f"{place} matches its type")  # the caller has checked that it does not


def _fits(data: Any, form: Any) -> bool:
    try:
        msgspec.convert(data, form)
    except _UNFIT:
        return False
    return True


def _alternative(form: Any, data: Any) -> Any:
    """Return the alternative of the union ``form`` with the same JSON type as ``data``, or ``form``."""
    bare, meta = _split(form)
    if get_origin(bare) not in (Union, UnionType):
        return form
    kinds = [kind for kind in get_args(bare) if kind not in (NoneType, msgspec.UnsetType)]
    if len(kinds) == 1:
        return kinds[0] if meta == msgspec.Meta() else Annotated[kinds[0], meta]
    for kind in kinds:
        part = _split(kind)[0]
        is_object = _is_object(part) or get_origin(part) is dict
        if is_object if isinstance(data, dict) else isinstance(data, list) and get_origin(part) in (list, tuple):
            return kind
    return form


def _split(form: Any) -> tuple[Any, msgspec.Meta]:
    """Return the bare type and its annotation."""
    if get_origin(form) is not Annotated:
        return form, msgspec.Meta()
    bare, *notes = get_args(form)
    return bare, next((note for note in notes if isinstance(note, msgspec.Meta)), msgspec.Meta())


def _is_object(form: Any) -> bool:
    return isinstance(form, type) and issubclass(form, msgspec.Struct)


def _lengths(form: Any, meta: msgspec.Meta) -> tuple[int, int | None]:
    if get_origin(form) is tuple and get_args(form)[-1] is not Ellipsis:
        return len(get_args(form)), len(get_args(form))
    return meta.min_length or 0, meta.max_length


def _phrase(form: Any) -> str:
    """Return a description of the values of the type ``form``, such as "a number from 0 to 1"."""
    form, meta = _split(form)
    kind = get_origin(form) or form
    if meta.description is not None:
        return meta.description
    if kind in (Union, UnionType):
        return " or ".join(_phrase(option) for option in get_args(form) if option is not msgspec.UnsetType)
    if kind is Literal:
        return f"one of {', '.join(map(repr, get_args(form)))}"
    if kind in (int, float):
        return ("a whole number" if kind is int else "a number") + _range(kind, meta)
    if kind in (list, tuple, dict):
        of = _plural(get_args(form)[kind is dict]) if get_args(form) else "entries"
        return f"{'an object' if kind is dict else 'a list'} of {_count(*_lengths(form, meta))}{of}"
    if kind is str:
        count = _count(*_lengths(form, meta))
        return f"a text of {count}characters" if count else "a text"
    if _is_object(form):
        return f"an object with the keys {_quoted(f.name for f in msgspec.structs.fields(form) if f.required)}"
    return {bool: "true or false", NoneType: "null"}.get(form, "something else")


def _range(kind: type, meta: msgspec.Meta) -> str:
    step = 1 if kind is int else 0
    least = meta.ge if meta.gt is None else meta.gt + step
    most = meta.le if meta.lt is None else meta.lt - step
    low, high = (None if x is None else f"{x}" if kind is int else f"{x:g}" for x in (least, most))
    if low and high:
        return f" from {low} to {high}"
    return f" of at least {low}" if low else f" of at most {high}" if high else ""


def _count(least: int, most: int | None) -> str:
    if most is None:
        return f"at least {least} " if least else ""
    if least == most:
        return f"{least} "
    return f"{least} to {most} " if least else f"at most {most} "


def _plural(form: Any) -> str:
    bare, meta = _split(form)
    return meta.title or _PLURALS.get(get_origin(bare) or bare, "objects" if _is_object(bare) else "entries")


def _quoted(names: Any) -> str:
    return ", ".join(f"'{name}'" for name in sorted(names))
