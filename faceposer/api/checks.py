"""What a caller may give besides places: refused at once and in one sentence, so that nothing wrong is ever saved."""

import json
import math
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


def _shown(value: object) -> str:
    """Return the beginning of how Python writes ``value``, in one line."""
    return " ".join(repr(value).split())[:60]


def one_of(value: T, choices: Sequence[T], what: str) -> T:
    """Return ``value`` if it is one of ``choices``.

    Raises:
        FacePoserError: Naming ``what`` it is for.
    """
    if value not in choices:
        raise FacePoserError(f"{what} is one of {', '.join(map(repr, choices))}, not {_shown(value)}.")
    return value


def some_of(values: Iterable[T] | T, choices: Sequence[T], what: str) -> tuple[T, ...]:
    """Return ``values``, or the only one, as a tuple, if all are among ``choices``.

    Raises:
        FacePoserError: Naming ``what`` they are for.
    """
    several = (values,) if isinstance(values, str) or not isinstance(values, Iterable) else tuple(values)
    return tuple(one_of(value, choices, what) for value in several)


def real(value: float, what: str) -> float:
    """Return ``value`` as a number, whatever its size.

    Raises:
        FacePoserError: If it is none, naming ``what`` it is.
    """
    try:
        return float(value)
    except (TypeError, ValueError, OverflowError) as error:
        raise FacePoserError(f"{what} is a number, not {_shown(value)}.") from error


def number(value: float, least: float, most: float, what: str) -> float:
    """Return ``value`` as a number from ``least`` to ``most``.

    Raises:
        FacePoserError: If it is none, naming ``what`` it is.
    """
    found = math.nan if isinstance(value, bool) else real(value, what)
    if not least <= found <= most:
        raise FacePoserError(f"{what} is a number from {least:g} to {most:g}, not {_shown(value)}.")
    return found


def frame_number(frame: int) -> int:
    """Return ``frame`` if an animation can have a key there.

    Raises:
        FacePoserError: If not.
    """
    whole = isinstance(frame, (int, np.integer)) and not isinstance(frame, bool)
    if not whole or not 0 <= frame < LONGEST:
        raise FacePoserError(f"A frame is a whole number from 0 to {LONGEST - 1}, not {_shown(frame)}.")
    return int(frame)


def picture_size(size: tuple[int, int]) -> tuple[int, int]:
    """Return ``size`` if a picture can have it.

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
            f"The size of a picture is (width, height) in whole pixels from 1 to {_LARGEST_SIDE}, not {_shown(size)}."
        )
    return int(width), int(height)


def known_camera(camera: object) -> Camera:
    """Return ``camera`` if it is one.

    Raises:
        FacePoserError: If not.
    """
    if not isinstance(camera, Camera):
        raise FacePoserError(f"A camera is what Face.camera() returns, not {_shown(camera)}.")
    return camera


def performance_of(performance: Performance, model: FaceModel) -> Performance:
    """Return ``performance`` if it is one of the face of ``model``.

    Raises:
        FacePoserError: If not.
    """
    if not isinstance(performance, Performance):
        raise FacePoserError(f"A motion is a Performance, not {_shown(performance)}.")
    wanted, found = len(model.neutral()), performance.coefficients.shape[1]
    if found != wanted:
        raise FacePoserError(
            f"The motion has {found} coefficients and '{model.character.title}' has {wanted}: it is of another face, "
            "which transfer_to takes it from."
        )
    if not np.isfinite(performance.coefficients).all():
        raise FacePoserError("The motion has coefficients that are no numbers.")
    return performance


def check_constraint(constraint: Constraint) -> None:
    """Refuse a constraint that a session's file could not hold.

    Raises:
        FacePoserError: Naming what is wrong with it.
    """
    text = json.dumps(constraint.to_json(), default=repr)
    constraint_from_json(json.loads(text), f"The {constraint.kind} constraint")
