"""JSON of other tools with weights of ARKit's shapes: lists of named weights, objects by name, arrays with names.

MediaPipe's face landmarker, NVIDIA's Audio2Face, Unity's and three.js' ARKit samples write such files, each in its own
form. What is understood is described by its content, not by the names of its keys (docs/interchange.md).
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from faceposer.errors import FacePoserError
from faceposer.files.sample_times import frames_at, frames_in_order, frames_numbered, interpolated
from faceposer.files.time_columns import is_frame_number, is_time, numbers_of, times_of
from faceposer.interchange.keyed_curves import Curve, curve_of, sampled, without_affixes
from faceposer.interchange.named_weights import NamedWeights
from faceposer.model.shape_names import canonical_shape

_DEEPEST = 6
_MOST_FRAMES = 250_000
_RATE_KEYS = ("rate", "fps", "framerate", "exportfps", "samplerate", "framespersecond", "samplingrate")
_VALUE_KEYS = ("score", "value", "weight", "values", "weights", "coefficient", "intensity", "keys", "frames")
_FASTEST = 1000.0
# Tracking goes a little beyond 1; percentages go to 100.
_MOST, _PERCENT = 2.0, 110.0
_PERCENT_SHARE = 0.2


@dataclass(frozen=True, eq=False)
class _Frame:
    """Weights by the names of shapes as the file spells them, none where the face was lost; and the values of times."""

    weights: dict[str, float]
    times: dict[str, str]


@dataclass(frozen=True, eq=False)
class _Found:
    """Frames or curves, the place where they were found, and the rate stated around them."""

    frames: list[_Frame]
    where: str
    rate: float | None
    curves: Mapping[str, Curve] = field(default_factory=dict)


def foreign_weights(data: Any, path: Path, rate: float | None = None) -> NamedWeights | None:
    """Return the weights in ``data``, parsed from the JSON file ``path``, at even times; None if it has none.

    Args:
        data: Dictionaries, lists, strings, numbers, booleans and None.
        path: For messages.
        rate: Frames per second in place of those of the file.

    Raises:
        FacePoserError: If there are weights in several places, or they are not plausible.
    """
    data, spelling = without_affixes(data)
    found = _search(data, "", (), None, 0)
    # A pose among the facts of an animation, such as its neutral, is not the animation.
    longest = max((len(one.frames) for one in found), default=0)
    found = [one for one in found if len(one.frames) == longest or len(one.frames) > 1 or one.curves]
    if not found:
        return None
    if len(found) > 1:
        places = " and ".join(f"'{one.where[:60] or '(top)'}'" for one in found[:2])
        raise FacePoserError(f"weights are in several places, {places}; keep one of them.")
    weights = _placed(found[0], path, rate)
    return replace(weights, notes=(spelling, *weights.notes)) if spelling else weights


def _placed(found: _Found, path: Path, rate: float | None) -> NamedWeights:
    if found.curves:
        return _sampled(found, rate)
    if len(found.frames) > _MOST_FRAMES:
        raise FacePoserError(f"it has {len(found.frames):,} frames, more than {_MOST_FRAMES:,}.")
    names = tuple(dict.fromkeys(name for frame in found.frames for name in frame.weights))
    seen = np.array([bool(frame.weights) for frame in found.frames])
    values = np.array([[frame.weights.get(name, 0.0) for name in names] for frame in found.frames if frame.weights])
    values, notes = _in_range(values)
    count, stated = len(found.frames), rate or found.rate
    keys = dict.fromkeys(key for frame in found.frames for key in frame.times)
    frames = frames_in_order(count, stated, "It does not state a rate or times")
    for key in sorted(keys, key=is_frame_number):
        cells = [frame.times.get(key, "") for frame in found.frames]
        if count < 2:
            break
        if is_frame_number(key):
            numbers = numbers_of(cells)
            frames = frames if numbers is None else frames_numbered(numbers, str(path), stated)
            break
        times = times_of(key, cells)
        if times is not None:
            # Times of frames are more exact than a rate around them.
            frames = frames_at(times.seconds, str(path), rate)
            notes += (times.note,) if times.note and rate is None and not frames.assumed else ()
            break
    weights, gaps = interpolated(frames, seen, values)
    known = frames.rate if count > 1 or stated else None
    return NamedWeights(names, weights, known, (*notes, *frames.notes, *gaps))


def _sampled(found: _Found, rate: float | None) -> NamedWeights:
    """Return the weights of curves at even times."""
    if len({is_frame_number(curve.heading) for curve in found.curves.values()}) > 1:
        raise FacePoserError("some of its curves have keys at times and some at frames; use one of both.")
    read = sampled(found.curves, rate or found.rate, _MOST_FRAMES)
    if read is None:
        raise FacePoserError(f"its keys span more than {_MOST_FRAMES:,} frames.")
    values, notes = _in_range(read[0])
    return NamedWeights(tuple(found.curves), values, read[1] if len(values) > 1 else None, (*notes, *read[2]))


def _in_range(values: np.ndarray) -> tuple[np.ndarray, tuple[str, ...]]:
    """Return weights from 0 to 1, and the sentence about percentages."""
    most = float(np.abs(values).max(initial=0.0))
    if most <= _MOST:
        return values, ()
    moved = np.abs(values[values != 0.0])
    if most <= _PERCENT and (moved > _MOST).mean() >= _PERCENT_SHARE:
        return values / 100.0, (f"Its weights reach {most:.4g} and were read as percentages.",)
    raise FacePoserError(f"its weights reach {most:.4g}, which is neither of 0 to 1 nor of 0 to 100.")


def _search(data: Any, where: str, names: tuple[str, ...], rate: float | None, depth: int) -> list[_Found]:
    """Return the weights in ``data``; ``names`` and ``rate`` are those stated around it."""
    if depth > _DEEPEST or not isinstance(data, dict | list):
        return []
    if len(data) > _MOST_FRAMES:
        raise FacePoserError(f"it has a list of {len(data):,} values, more than {_MOST_FRAMES:,}.")
    if isinstance(data, dict):
        names = next((own for value in data.values() if (own := _names(value))), names)
        rate = next((value for key, value in data.items() if _is_rate(key, value)), rate)
        pairs = [(key, value) for key, value in data.items() if isinstance(key, str)]
        columns = _columns(pairs, data)
    else:
        pairs = [(name, element) for element in data if isinstance(element, dict) and (name := _name(element))]
        columns = _columns(list(_named(data)), {})
    curves = {name: curve for name, value in pairs if _shape(name) and (curve := curve_of(value)) is not None}
    if curves:
        return [_Found([], where, rate, curves)]
    frames = columns or (_sequence(data, names) if isinstance(data, list) else None)
    if frames is not None:
        return [_Found(frames, where, rate)]
    if isinstance(data, list):
        single = _frame(data, names, 0)
        if single is None and len(data) == 1:
            return _search(data[0], f"{where}[0]", names, rate, depth + 1)
        return [] if single is None else [_Found([single], where, rate)]
    single = _plain(data)
    if single is not None:
        return [_Found([single], where, rate)]
    inner = [(key, value) for key, value in data.items() if isinstance(value, dict | list)]
    return [one for key, value in inner for one in _search(value, f"{where}.{key}"[-200:], names, rate, depth + 1)]


def _sequence(data: list[Any], names: tuple[str, ...]) -> list[_Frame] | None:
    """Return the frames in ``data`` if each element is one, or one without a face."""
    if not data:
        return None
    turned = _transposed(data, names)
    if turned is not None:
        return turned
    frames = []
    for element in data:
        frame = _frame(element, names, 0)
        if frame is None:
            frame = _lost(element)
        if frame is None:
            return None
        frames.append(frame)
    return frames if any(frame.weights for frame in frames) else None


def _transposed(data: list[Any], names: tuple[str, ...]) -> list[_Frame] | None:
    """Return the frames of a list of weights for each of the ``names``, if it cannot be a list for each frame."""
    if len(data) != len(names) or not all(_numbers(row) for row in data):
        return None
    lengths = {len(row) for row in data}
    if len(lengths) != 1 or lengths == {len(names)}:
        return None
    return [frame for row in zip(*data, strict=True) if (frame := _by_names(names, row)) is not None]


def _frame(value: Any, names: tuple[str, ...], depth: int) -> _Frame | None:
    """Return the frame in ``value``, or None."""
    if depth > 3:
        return None
    if isinstance(value, list):
        if names and len(value) == len(names) and _numbers(value):
            return _by_names(names, value)
        found = {name: float(number) for name, number in _named(value) if _number(number) and _shape(name)}
        if found:
            return _Frame(found, {})
        return _frame(value[0], names, depth + 1) if len(value) == 1 else None
    if not isinstance(value, dict):
        return None
    plain = _plain(value)
    if plain is not None:
        return plain
    inner = [frame for child in value.values() if (frame := _frame(child, names, depth + 1)) is not None]
    return _Frame(inner[0].weights, {**_times(value), **inner[0].times}) if len(inner) == 1 else None


def _plain(data: dict[Any, Any]) -> _Frame | None:
    """Return the frame of an object with a number for each name."""
    weights = {key: float(value) for key, value in data.items() if _number(value) and _shape(key)}
    return _Frame(weights, _times(data)) if weights else None


def _lost(value: Any) -> _Frame | None:
    """Return the frame without a face in ``value``: nothing, or nothing but times and empty lists; else None."""
    if value is None or value in ([], {}):
        return _Frame({}, {})
    if isinstance(value, list) and len(value) == 1:
        return _lost(value[0])
    if not isinstance(value, dict):
        return None
    rest = [child for child in value.values() if isinstance(child, dict | list)]
    return _Frame({}, _times(value)) if all(_lost(child) is not None for child in rest) else None


def _columns(pairs: list[tuple[str, Any]], around: dict[Any, Any]) -> list[_Frame] | None:
    """Return the frames of ``pairs`` of a name and its weights over time; ``around`` may have the times."""
    columns = {name: value for name, value in pairs if _numbers(value) and _shape(name)}
    lengths = {len(column) for column in columns.values()}
    if len(lengths) != 1 or lengths == {0}:
        return None
    count = lengths.pop()
    times = {
        key: value
        for key, value in around.items()
        if isinstance(value, list) and len(value) == count and (is_time(str(key)) or is_frame_number(str(key)))
    }
    return [
        _Frame(
            {name: float(column[i]) for name, column in columns.items()},
            {str(key): _text(value[i]) for key, value in times.items()},
        )
        for i in range(count)
    ]


def _named(data: list[Any]) -> Iterator[tuple[str, Any]]:
    """Give the name and the value of each element of a list of named weights; elements of another form end it."""
    for element in data:
        if isinstance(element, list) and len(element) == 2 and isinstance(element[0], str):
            yield element[0], element[1]
        elif isinstance(element, dict):
            name = _name(element)
            by_key = {str(key).lower(): value for key, value in element.items()}
            value = next((by_key[key] for key in _VALUE_KEYS if key in by_key), None)
            if name is not None and value is not None:
                yield name, value
        else:
            return


def _name(element: dict[Any, Any]) -> str | None:
    """Return the name of a shape among the values of ``element``, or None."""
    return next((text for text in element.values() if isinstance(text, str) and _shape(text)), None)


def _names(value: Any) -> tuple[str, ...]:
    """Return the names in a list of texts of which most are ARKit's, else nothing."""
    if not isinstance(value, list) or not value or not all(isinstance(text, str) for text in value):
        return ()
    return tuple(value) if 2 * sum(_shape(text) is not None for text in value) >= len(value) else ()


def _by_names(names: tuple[str, ...], values: Any) -> _Frame | None:
    weights = {name: float(value) for name, value in zip(names, values, strict=True) if _shape(name)}
    return _Frame(weights, {}) if weights else None


def _times(data: dict[Any, Any]) -> dict[str, str]:
    """Return the values of the keys of ``data`` that state a time or the number of a frame."""
    return {
        str(key): _text(value)
        for key, value in data.items()
        if isinstance(value, str | int | float) and (is_time(str(key)) or is_frame_number(str(key)))
    }


def _text(value: Any) -> str:
    return value if isinstance(value, str) else repr(value)


def _shape(name: Any) -> str | None:
    return canonical_shape(name) if isinstance(name, str) else None


def _number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _numbers(value: Any) -> bool:
    return isinstance(value, list) and all(_number(one) for one in value)


def _is_rate(key: Any, value: Any) -> bool:
    letters = "".join(letter for letter in str(key).lower() if letter.isalpha())
    return letters in _RATE_KEYS and _number(value) and 0.0 < value <= _FASTEST
