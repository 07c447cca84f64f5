"""Checks of arguments other than places: errors are raised before the session changes, so that it remains valid."""

import json
import math
import os
from collections.abc import Iterable, Sequence
from typing import TypeVar

import numpy as np

from faceposer.animation.keyframes import LONGEST
from faceposer.errors import FacePoserError
from faceposer.geometry.camera import Camera
from faceposer.model.face_model import FaceModel
from faceposer.model.performance import Performance
from faceposer.solve.constraints.registry import Constraint, constraint_from_json

T = TypeVar("T")
_LARGEST_SIDE = 16384


def _short_repr(value: object) -> str:
    """Return the beginning of ``repr(value)`` on one line, for messages."""
    return " ".join(repr(value).split())[:60]


def path_name(value: object, label: str) -> str:
    """Return ``value`` as text if it is a name or a path.

    Raises:
        FacePoserError: Otherwise; the message begins with ``label``.
    """
    found = os.fspath(value) if isinstance(value, (str, os.PathLike)) else None
    if not isinstance(found, str):
        raise FacePoserError(f"{label} must be a name or a path, not {_short_repr(value)}.")
    return found


def text(value: object, label: str) -> str:
    """Return ``value`` if it is text.

    Raises:
        FacePoserError: Otherwise; the message begins with ``label``.
    """
    if not isinstance(value, str):
        raise FacePoserError(f"{label} must be text, not {_short_repr(value)}.")
    return value


def one_of(value: T, choices: Sequence[T], label: str) -> T:
    """Return ``value`` if it is one of ``choices``.

    Raises:
        FacePoserError: Otherwise; the message begins with ``label``.
    """
    if value not in choices:
        raise FacePoserError(f"{label} must be one of {', '.join(map(repr, choices))}, not {_short_repr(value)}.")
    return value


def some_of(values: Iterable[T] | T, choices: Sequence[T], label: str) -> tuple[T, ...]:
    """Return ``values``, several or a single one, as a tuple if all are among ``choices``.

    Raises:
        FacePoserError: Otherwise; the message begins with ``label``.
    """
    several = (values,) if isinstance(values, str) or not isinstance(values, Iterable) else tuple(values)
    return tuple(one_of(value, choices, label) for value in several)


def real(value: float, label: str) -> float:
    """Return ``value`` as a float of any size.

    Raises:
        FacePoserError: If it is not a number; the message begins with ``label``.
    """
    try:
        return float(value)
    except (TypeError, ValueError, OverflowError) as error:
        raise FacePoserError(f"{label} must be a number, not {_short_repr(value)}.") from error


def number(value: float, least: float, most: float, label: str) -> float:
    """Return ``value`` as a float from ``least`` to ``most``.

    Raises:
        FacePoserError: If it is not such a number; the message begins with ``label``.
    """
    found = math.nan if isinstance(value, bool) else real(value, label)
    if not least <= found <= most:
        raise FacePoserError(f"{label} must be a number from {least:g} to {most:g}, not {_short_repr(value)}.")
    return found


def frame_number(frame: int) -> int:
    """Return ``frame`` if an animation can have a key at it.

    Raises:
        FacePoserError: If it is not a whole number, or out of range.
    """
    whole = isinstance(frame, (int, np.integer)) and not isinstance(frame, bool)
    if not whole or not 0 <= frame < LONGEST:
        raise FacePoserError(f"A frame must be a whole number from 0 to {LONGEST - 1}, not {_short_repr(frame)}.")
    return int(frame)


def frame_count(length: int) -> int:
    """Return ``length`` if an animation can have this number of frames.

    Raises:
        FacePoserError: If it is not a whole number, or out of range.
    """
    whole = isinstance(length, (int, np.integer)) and not isinstance(length, bool)
    if not whole or not 1 <= length <= LONGEST:
        raise FacePoserError(f"A length must be a whole number from 1 to {LONGEST}, not {_short_repr(length)}.")
    return int(length)


def image_size(size: tuple[int, int]) -> tuple[int, int]:
    """Return ``size`` if it is a valid size of an image.

    Raises:
        FacePoserError: If it is not two whole numbers, or they are too small or too large.
    """
    try:
        width, height = size
        good = all(float(side).is_integer() and 1 <= side <= _LARGEST_SIDE for side in (width, height))
    except (TypeError, ValueError):
        good = False
    if not good:
        raise FacePoserError(
            f"The size of an image must be (width, height) in whole pixels from 1 to {_LARGEST_SIDE}, not "
            f"{_short_repr(size)}."
        )
    return int(width), int(height)


def known_camera(camera: object) -> Camera:
    """Return ``camera`` if it is a camera.

    Raises:
        FacePoserError: Otherwise.
    """
    if not isinstance(camera, Camera):
        raise FacePoserError(f"A camera must be of the class that Face.camera() returns, not {_short_repr(camera)}.")
    return camera


def performance_of(performance: Performance, model: FaceModel) -> Performance:
    """Return ``performance`` if it is a performance of the face of ``model``.

    Raises:
        FacePoserError: Otherwise.
    """
    if not isinstance(performance, Performance):
        raise FacePoserError(f"A motion must be a Performance, not {_short_repr(performance)}.")
    expected, found = len(model.neutral()), performance.coefficients.shape[1]
    if found != expected:
        raise FacePoserError(
            f"The motion has {found} coefficients, but '{model.character.title}' has {expected}; use transfer_to to "
            "transfer the motion of another face."
        )
    if not np.isfinite(performance.coefficients).all():
        raise FacePoserError("The motion has coefficients that are not finite numbers.")
    return performance


def check_constraint(constraint: Constraint) -> None:
    """Check that a session file can hold ``constraint``.

    Raises:
        FacePoserError: If a value is invalid; the message names it.
    """
    text = json.dumps(constraint.to_json(), default=repr)
    constraint_from_json(json.loads(text), f"The {constraint.kind} constraint")
