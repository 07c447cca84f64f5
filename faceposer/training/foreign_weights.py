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
from faceposer.training.json_values import VALUE_KEYS, is_number, rate_of, shape_of
from faceposer.training.keyed_curves import Curve, curve_of, sampled, without_affixes
from faceposer.training.named_weights import NamedWeights
from faceposer.training.weight_range import in_range

_DEEPEST = 6
_MOST_FRAMES = 250_000
_MOST_FACES = 20
# Variation from row to row by which rows are rather shapes than frames, as a part of that within rows.
_SMOOTHER = 0.5


@dataclass(frozen=True, eq=False)
class _Frame:
    """Weights of the first face by the names of shapes as the file spells them, none where the face was lost.

    Attributes:
        weights: The weights.
        times: Values of times by their keys.
        faces: Number of faces in the frame.
    """

    weights: dict[str, float]
    times: dict[str, str]
    faces: int = 1


@dataclass(frozen=True, eq=False)
class _Found:
    """Frames or curves, the place where they were found, and the rate stated around them."""

    frames: list[_Frame]
    where: str
    rate: float | None
    curves: Mapping[str, Curve] = field(default_factory=dict)
    note: str = ""


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
    everything = found
    found = [one for one in found if len(one.frames) == longest or len(one.frames) > 1 or one.curves]
    if not found:
        return None
    if len(found) > 1:
        places = " and ".join(f"'{one.where[:60] or '(top)'}'" for one in found[:2])
        raise FacePoserError(f"weights are in several places, {places}; keep one of them.")
    weights = _placed(found[0], path, rate)
    others = [one for one in everything if one is not found[0]]
    notes = [spelling, found[0].note]
    if others:
        what = "A pose" if len(others) == 1 else f"{len(others)} poses"
        were = "was" if len(others) == 1 else "were"
        notes.append(f"{what} outside of its frames, at '{others[0].where[:60]}', {were} not read.")
    faces = max((frame.faces for frame in found[0].frames), default=1)
    if faces > 1:
        notes.append(f"It has up to {faces} faces in a frame; the first of each frame was read.")
    return replace(weights, notes=(*filter(None, notes), *weights.notes))


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
            said = (times.note if rate is None and not frames.assumed else "", times.lost)
            notes += tuple(filter(None, said))
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
    found = in_range(values)
    if found is None:
        most = float(np.abs(values).max())
        raise FacePoserError(f"its weights reach {most:.4g}, which is neither of 0 to 1 nor of 0 to 100.")
    return found[0], (found[1],) if found[1] else ()


def _search(data: Any, where: str, names: tuple[str, ...], rate: float | None, depth: int) -> list[_Found]:
    """Return the weights in ``data``; ``names`` and ``rate`` are those stated around it."""
    if depth > _DEEPEST or not isinstance(data, dict | list):
        return []
    if len(data) > _MOST_FRAMES:
        raise FacePoserError(f"it has a list of {len(data):,} values, more than {_MOST_FRAMES:,}.")
    if isinstance(data, dict):
        names = next((own for value in data.values() if (own := _names(value))), names)
        rate = next((found for key, value in data.items() if (found := rate_of(key, value)) is not None), rate)
        pairs = [(key, value) for key, value in data.items() if isinstance(key, str)]
        columns = _columns(pairs, data)
    else:
        pairs = [(name, element) for element in data if isinstance(element, dict) and (name := _name(element))]
        columns = _columns(list(_named(data)), {})
    curves = {name: curve for name, value in pairs if shape_of(name) and (curve := curve_of(value)) is not None}
    if curves:
        return [_Found([], where, rate, curves)]
    frames = columns or (_sequence(data, names) if isinstance(data, list) else None)
    if frames is not None:
        square = (
            not columns and len(data) == len(names) and all(_numbers(row) and len(row) == len(names) for row in data)
        )
        return [_turned(_Found(frames, where, rate), names) if square else _Found(frames, where, rate)]
    if isinstance(data, list):
        single = _frame(data, names, 0)
        if single is None and len(data) == 1:
            return _search(data[0], f"{where}[0]", names, rate, depth + 1)
        return [] if single is None else [_Found([single], where, rate)]
    single = _plain(data)
    if single is not None:
        return [_Found([single], where, rate)]
    inner = [(key, value) for key, value in data.items() if isinstance(value, dict | list)]
    return [
        one
        for key, value in inner
        for one in _search(value, f"{where}.{key}".lstrip(".")[-200:], names, rate, depth + 1)
    ]


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


def _turned(found: _Found, names: tuple[str, ...]) -> _Found:
    """Return a square list of weights as rows for frames, or for shapes if these are much smoother, and say which."""
    weights = np.array([[frame.weights.get(name, 0.0) for name in names] for frame in found.frames])
    by_frames, by_shapes = (float(np.abs(np.diff(weights, axis=axis)).sum()) for axis in (0, 1))
    turned = by_shapes < _SMOOTHER * by_frames and len(found.frames) == len(names)
    if turned:
        rows = [dict(zip(names, column, strict=True)) for column in weights.T.tolist()]
        found = replace(found, frames=[_Frame({k: v for k, v in row.items() if shape_of(k)}, {}) for row in rows])
    kind = "shape" if turned else "frame"
    note = f"Its {len(names)} lists of {len(names)} weights may be for frames or for shapes; each was read as a {kind}."
    return replace(found, note=note)


def _frame(value: Any, names: tuple[str, ...], depth: int) -> _Frame | None:
    """Return the frame in ``value``, or None."""
    if depth > 3:
        return None
    if isinstance(value, list):
        if names and len(value) == len(names) and _numbers(value):
            return _by_names(names, value)
        found = {name: float(number) for name, number in _named(value) if is_number(number) and shape_of(name)}
        if found:
            return _Frame(found, {})
        if len(value) == 1:
            return _frame(value[0], names, depth + 1)
        faces = [_frame(one, names, depth + 1) for one in value] if depth > 0 and len(value) <= _MOST_FACES else []
        first = faces[0] if faces else None
        return None if first is None or None in faces else replace(first, faces=len(faces))
    if not isinstance(value, dict):
        return None
    plain = _plain(value)
    if plain is not None:
        return plain
    inner = [frame for child in value.values() if (frame := _frame(child, names, depth + 1)) is not None]
    return replace(inner[0], times={**_times(value), **inner[0].times}) if len(inner) == 1 else None


def _plain(data: dict[Any, Any]) -> _Frame | None:
    """Return the frame of an object with a number for each name."""
    weights = {key: float(value) for key, value in data.items() if is_number(value) and shape_of(key)}
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
    columns = {name: value for name, value in pairs if _numbers(value) and shape_of(name)}
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
            value = next((by_key[key] for key in VALUE_KEYS if key in by_key), None)
            if name is not None and value is not None:
                yield name, value
        else:
            return


def _name(element: dict[Any, Any]) -> str | None:
    """Return the name of a shape among the values of ``element``, or None."""
    return next((text for text in element.values() if isinstance(text, str) and shape_of(text)), None)


def _names(value: Any) -> tuple[str, ...]:
    """Return the names in a list of texts of which most are ARKit's, else nothing."""
    if not isinstance(value, list) or not value or not all(isinstance(text, str) for text in value):
        return ()
    return tuple(value) if 2 * sum(shape_of(text) is not None for text in value) >= len(value) else ()


def _by_names(names: tuple[str, ...], values: Any) -> _Frame | None:
    weights = {name: float(value) for name, value in zip(names, values, strict=True) if shape_of(name)}
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


def _numbers(value: Any) -> bool:
    return isinstance(value, list) and all(is_number(one) for one in value)
