"""Animation as CSV files of Epic's app Live Link Face, and the frame rate of such files."""

import csv
import re
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from faceposer.errors import FacePoserError
from faceposer.files.atomic import atomic_file
from faceposer.files.reading import open_text
from faceposer.model.character import ARKIT_SHAPES
from faceposer.model.face_model import FaceModel
from faceposer.model.performance import Performance
from faceposer.model.shape_names import weight_map

Array = NDArray[np.float64]

#: Frames per second of timecodes, independent of the rate of the take.
TIMECODE_BASE = 60
_DEFAULT_RATE = 30.0
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
    weights = arkit_weights(model, performance.coefficients)
    order = [ARKIT_SHAPES.index(name) for name in _CHANNELS]
    values = np.hstack([weights[:, order], np.zeros((len(weights), 3)), _eye_turns(weights)])
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


def rate_of_capture(path: Path) -> float:
    """Return the frame rate of a take of Live Link Face or Face Cap; 30 if it does not follow from its timestamps.

    Raises:
        OSError: If the file cannot be read.
    """
    with open_text(path, "utf-8-sig", "replace", "") as file:
        times = [time for cells in csv.reader(file) if (time := _seconds(cells)) is not None]
    steps = np.diff(times)
    steps = steps[steps > 0]
    if not len(steps):
        return _DEFAULT_RATE
    # Dropped frames make some steps longer; timestamps are rounded, so the mean of the regular steps is taken.
    regular = steps[np.abs(steps - np.median(steps)) <= 0.5 * np.median(steps)]
    rate = round(1.0 / float(regular.mean()), 2)
    return rate if 1.0 <= rate <= 1000.0 else _DEFAULT_RATE


def _seconds(cells: list[str]) -> float | None:
    """Return the time of the frame in a line of ``cells``, in seconds, or None if the line is not a frame."""
    if len(cells) < 2:
        return None
    if cells[0].strip().lower() == "k":
        return float(cells[1]) / 1000.0 if re.fullmatch(r"\s*\d{1,12}(\.\d*)?\s*", cells[1]) else None
    match = re.fullmatch(r"\s*(\d\d?):(\d\d?):(\d\d?):(\d{1,3}(?:\.\d*)?)\s*", cells[0])
    if match is None:
        return None
    hours, minutes, seconds, frames = (float(group) for group in match.groups())
    return 3600.0 * hours + 60.0 * minutes + seconds + frames / TIMECODE_BASE
