"""Curves in JSON of other tools, each with the times of its own keys, and names with affixes."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from faceposer.files.sample_rates import USUAL_RATE
from faceposer.files.sample_times import assumed_rate
from faceposer.files.time_columns import is_frame_number, is_time, times_of
from faceposer.model.name_matching import match_with_ties
from faceposer.model.shape_names import canonical_shape, names_shape
from faceposer.training.json_values import is_number
from faceposer.training.key_times import Sampling, sampling

Array = NDArray[np.float64]

_KEY_LISTS = ("keys", "keyframes", "points", "samples", "values", "frames", "data", "curve")
_VALUES = ("value", "values", "weight", "weights", "score", "v", "y", "output")
# Steps of times without a unit from which they are taken for milliseconds.
_MILLISECONDS = 5.0
_MOST_VALUES = 200_000
_LONGEST_NAME = 256


@dataclass(frozen=True, eq=False)
class Curve:
    """The weights of a shape at keys.

    Attributes:
        heading: Name of the times, which tells their unit.
        times: Shape (K,), rising.
        weights: Shape (K,).
    """

    heading: str
    times: Array
    weights: Array


def curve_of(value: Any, depth: int = 0) -> Curve | None:
    """Return the curve in ``value``: a list of objects with a time and a weight, or lists of times and weights."""
    if isinstance(value, dict):
        listed = next((key for key, own in value.items() if _is_clock(key) and _numbers(own)), None)
        name = next((key for key in _VALUES if _numbers(value.get(key))), None)
        if listed is not None and name is not None:
            return _curve(listed, value[listed], value[name])
        inner = [value[key] for key in _KEY_LISTS if isinstance(value.get(key), list | dict)]
        return curve_of(inner[0], depth + 1) if len(inner) == 1 and depth < 3 else None
    if not isinstance(value, list) or not value or not all(isinstance(key, dict) for key in value):
        return None
    heading = next((key for key, own in value[0].items() if _is_clock(key) and is_number(own)), None)
    name = next((key for key in _VALUES if is_number(value[0].get(key))), None)
    if heading is None or name is None:
        return None
    times, weights = [key.get(heading) for key in value], [key.get(name) for key in value]
    return _curve(heading, times, weights) if _numbers(times) and _numbers(weights) else None


def _curve(heading: str, times: list[float], weights: list[float]) -> Curve | None:
    if len(times) != len(weights):
        return None
    order = np.argsort(np.array(times, dtype=np.float64), kind="stable")
    return Curve(heading, np.array(times, dtype=np.float64)[order], np.array(weights, dtype=np.float64)[order])


def sampled(curves: Mapping[str, Curve], rate: float | None, most: int) -> tuple[Array, float, tuple[str, ...]] | None:
    """Return ``curves`` by shape at even times, shape (F, S), the rate, and notes; None if F is above ``most``.

    Weights are linear between keys and constant before the first and after the last one. Keys at times keep them;
    those at frames are put at ``rate``, or at an assumed rate.
    """
    heading = next(iter(curves.values())).heading
    times = np.unique(np.concatenate([curve.times for curve in curves.values()]))
    notes: tuple[str, ...] = ()
    if is_frame_number(heading):
        if np.ptp(times) >= most:
            return None
        frames = times[0] + np.arange(np.ceil(np.ptp(times)) + 1.0)
        notes = () if rate else (assumed_rate("Its keys are at frames, and it does not state a rate"),)
        return _at(frames, curves), rate or USUAL_RATE, notes
    seconds = times
    read = times_of(heading, [repr(time) for time in times.tolist()])
    steps = np.diff(times)
    if read is not None and len(steps) and float(np.median(steps)) >= _MILLISECONDS:
        seconds, notes = read.seconds, (read.note,) if read.note else ()
    own = [np.interp(curve.times, times, seconds) for curve in curves.values()]
    even = sampling(own, most, rate)
    if not isinstance(even, Sampling):
        return None
    at = np.interp(even.seconds, seconds, times)
    return _at(at, curves), even.rate, (*notes, even.note) if even.note else notes


def _at(times: Array, curves: Mapping[str, Curve]) -> Array:
    return np.stack([np.interp(times, curve.times, curve.weights) for curve in curves.values()], axis=1)


def without_affixes(data: Any) -> tuple[Any, str]:
    """Return ``data`` with ARKit's names in place of those with a prefix or suffix that many share, and a note."""
    match = match_with_ties(dict.fromkeys(_names(data)))
    tied = {name for names in match.ties.values() for name in names}
    renamed = {
        name: shape for name, shape in match.shapes.items() if name not in tied and canonical_shape(name) is None
    }
    return (_renamed(data, renamed), match.note) if renamed else (data, "")


def _names(data: Any) -> Iterator[str]:
    """Yield texts in ``data`` that may be names of shapes, breadth first, from a limited number of values."""
    waiting: list[Any] = [data]
    seen: set[str] = set()
    left = _MOST_VALUES
    for value in waiting:
        children: Sequence[Any] = ()
        if isinstance(value, dict):
            children = [*value.keys(), *value.values()]
        elif isinstance(value, list):
            children = value
        for child in children[: max(left, 0)]:
            left -= 1
            if isinstance(child, dict | list):
                waiting.append(child)
            elif isinstance(child, str) and child not in seen and len(child) <= _LONGEST_NAME:
                seen.add(child)
                if names_shape(child):
                    yield child


def _renamed(data: Any, names: Mapping[str, str]) -> Any:
    if isinstance(data, dict):
        return {names.get(key, key): _renamed(value, names) for key, value in data.items()}
    if isinstance(data, list):
        return [_renamed(value, names) if isinstance(value, str | list | dict) else value for value in data]
    return names.get(data, data) if isinstance(data, str) else data


def _is_clock(key: Any) -> bool:
    return isinstance(key, str) and (is_time(key) or is_frame_number(key))


def _numbers(value: Any) -> bool:
    return isinstance(value, list) and bool(value) and all(map(is_number, value))
