"""Animation as CSV files of Epic's app Live Link Face."""

import csv
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from faceposer.errors import FacePoserError
from faceposer.files.atomic import atomic_file
from faceposer.files.writing import check_finite
from faceposer.model.character import ARKIT_SHAPES
from faceposer.model.face_model import FaceModel
from faceposer.model.performance import Performance
from faceposer.model.shape_names import weight_map

Array = NDArray[np.float64]

#: Frames per second of timecodes, independent of the rate of the take.
TIMECODE_BASE = 60
#: Rotation of an eye in radians at full weight of a shape, pitch downwards and yaw towards the character's right;
#: least squares over recordings of the app.
_UP, _DOWN, _IN, _OUT = 0.45, 0.61, 0.55, 0.65


def _app_order() -> tuple[str, ...]:
    """Return ARKit's shapes in the order of the app's columns, in which the right side is first in two places."""
    names = list(ARKIT_SHAPES)
    for left in ("jawLeft", "mouthLeft"):
        i = names.index(left)
        names[i : i + 2] = names[i + 1], left
    return tuple(names)


_CHANNELS = _app_order()
_TURNS = ("HeadYaw", "HeadPitch", "HeadRoll") + tuple(
    f"{side}Eye{turn}" for side in ("Left", "Right") for turn in ("Yaw", "Pitch", "Roll")
)
#: The columns of the app's files, in order.
HEADER: tuple[str, ...] = (
    *("Timecode", "BlendShapeCount"),
    *(name[0].upper() + name[1:] for name in _CHANNELS),
    *_TURNS,
)


def arkit_weights(model: FaceModel, coefficients: Array) -> Array:
    """Return the weights of the 52 ``ARKIT_SHAPES``, shape (F, 52), that best reproduce ``coefficients``, (F, r).

    Weights are within their limits. Shapes that the character lacks are 0; a shape that the character has in halves
    gets the mean of both.

    Raises:
        FacePoserError: If the character has none of ARKit's shapes.
    """
    # SciPy's optimisers are slow to import, and the window imports the table of formats at its start.
    from faceposer.solve.weight_fit import fit_weights_of_frames

    lift = weight_map(ARKIT_SHAPES, model.character.shape_names)
    if not lift.any():
        raise FacePoserError(
            f"{model.character.title} has none of ARKit's 52 shapes, which a Live Link Face CSV holds; write the "
            "weights as .json, or the shapes as .glb."
        )
    weights: Array = np.clip(fit_weights_of_frames(model, coefficients), 0.0, 1.0) @ lift.T
    return weights


def write_live_link(path: Path, model: FaceModel, performance: Performance) -> None:
    """Write the ARKit weights of ``performance`` in the format of Live Link Face, atomically.

    The rotation of the head is 0; that of the eyes follows from the weights of their gaze.

    Raises:
        FacePoserError: If the character has none of ARKit's shapes, or the file cannot be written.
    """
    check_finite(path, "capture", performance.coefficients)
    weights = arkit_weights(model, performance.coefficients)
    order = [ARKIT_SHAPES.index(name) for name in _CHANNELS]
    values = np.hstack([weights[:, order], np.zeros((len(weights), 3)), _eye_turns(weights)])
    check_finite(path, "capture", values)
    with (
        atomic_file(path, "capture") as temporary,
        temporary.open("w", newline="", encoding="utf-8") as file,
    ):
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(HEADER)
        for frame, row in enumerate(values.tolist()):
            time = timecode(frame / performance.rate)
            writer.writerow([time, len(row), *(f"{value:.10f}" for value in row)])


def _eye_turns(weights: Array) -> Array:
    """Return yaw, pitch and roll of the left and right eye in radians, (F, 6), from ARKit ``weights``, (F, 52)."""
    turns = np.zeros((len(weights), 6))
    for side, (name, inwards) in enumerate((("Left", 1.0), ("Right", -1.0))):
        up, down, towards, away = (
            weights[:, ARKIT_SHAPES.index(f"eyeLook{look}{name}")] for look in ("Up", "Down", "In", "Out")
        )
        turns[:, 3 * side] = inwards * (_IN * towards - _OUT * away)
        turns[:, 3 * side + 1] = _DOWN * down - _UP * up
    return turns


def timecode(seconds: float) -> str:
    """Format ``seconds`` since midnight as hours, minutes, seconds and frames with thousandths."""
    ticks = round(seconds * TIMECODE_BASE * 1000)
    whole, thousandths = divmod(ticks, 1000)
    total_seconds, frames = divmod(whole, TIMECODE_BASE)
    minutes, second = divmod(total_seconds, 60)
    return f"{minutes // 60 % 24:02}:{minutes % 60:02}:{second:02}:{frames:02}.{thousandths:03}"
