"""Facial capture: ARKit weights over time, from Epic's app Live Link Face or Bannaflak's app Face Cap.

Both write comma-separated text. Live Link Face writes a header with the names of the channels, and one line per frame.
In Face Cap's text export the first word of a line is its type: ``info`` is a comment, ``bs`` lists the names of the
channels, and ``k`` is a frame: milliseconds, the head's position (3) and rotation (3), the left and right eye's
rotation (2 each), then a weight for each name.
"""

import csv
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from faceposer.errors import FacePoserError
from faceposer.files.reading import open_text
from faceposer.model.character import ARKIT_SHAPES
from faceposer.model.shape_names import canonical_shape, whole_shape_of

Array = NDArray[np.float64]

_Lines = Iterable[tuple[int, list[str]]]

_MAX_BYTES = 256 * 2**20
# Channels range from 0 to 1, and tracking exceeds this slightly; values beyond these are percentages or invalid.
_LOWEST, _HIGHEST = -1.0, 2.0
# Columns before the weights in a Face Cap frame: "k", the time, and the poses of the head and the eyes.
_FACE_CAP_WEIGHTS = 12
_FACE_CAP_LINES = ("info", "bs", "k")
#: Two-sided shapes that some apps split into sides; their mean is used.
_SPLIT = ("browInnerUp", "cheekPuff")


@dataclass(frozen=True, eq=False)
class Capture:
    """One take of a performer.

    Attributes:
        shape_names: ARKit's names of the S channels.
        weights: Shape (frames, S), from 0 for a relaxed muscle to 1 for a full contraction; apps may slightly exceed
            this range.
    """

    shape_names: tuple[str, ...]
    weights: Array

    @property
    def missing(self) -> tuple[str, ...]:
        """ARKit's shapes without a channel in the take."""
        return tuple(name for name in ARKIT_SHAPES if name not in self.shape_names)

    def with_shapes(self, shape_names: Sequence[str]) -> "Capture":
        """Return the take with the channels ``shape_names``, in this order; missing channels are 0."""
        weights = np.zeros((len(self.weights), len(shape_names)))
        for column, name in enumerate(shape_names):
            if name in self.shape_names:
                weights[:, column] = self.weights[:, self.shape_names.index(name)]
        return Capture(tuple(shape_names), weights)

    def without_jumps(self, threshold: float = 0.3) -> "Capture":
        """Return the take without the frames in which a channel jumps by more than ``threshold``.

        Blinks are exempt, since lids move that fast.
        """
        watched = [not name.startswith("eyeBlink") for name in self.shape_names]
        steps = np.abs(np.diff(self.weights[:, watched], axis=0)).max(axis=1, initial=0.0)
        steady = np.concatenate([[True], steps <= threshold])
        return replace(self, weights=self.weights[steady])

    def relative_to_rest(self, percentile: float = 5.0) -> "Capture":
        """Return the take with the performer's rest subtracted, clipped to 0 to 1.

        The app is not calibrated: a relaxed face has weights of 0.1 or 0.2. The rest of a channel is estimated by a low
        ``percentile`` of it.
        """
        rest = np.percentile(self.weights, percentile, axis=0)
        return replace(self, weights=np.clip(self.weights - rest, 0.0, 1.0))


def read_capture(path: Path) -> Capture:
    """Read the take in the file ``path``, written by Live Link Face or Face Cap, which the first line distinguishes.

    Channels are identified by their names, in any order, spelling and number; other columns are ignored. The take has
    the file's channels of ARKit's shapes, in ARKit's order. Frames without values, in which the app lost the face, are
    skipped.

    Raises:
        FacePoserError: If the file cannot be read or is too large, has no known channel, a duplicate channel or no
            frame with a face, or has a line with too few or too many cells or a value that is not a weight.
    """
    try:
        with open_text(path, "utf-8-sig", newline="", max_bytes=_MAX_BYTES) as file:
            return _parse(csv.reader(file), path)
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        reason = getattr(error, "strerror", None) or "it is not a table of text"
        raise FacePoserError(
            f"The capture '{path}' cannot be read: {reason}; use a CSV file of Live Link Face or a text export of "
            "Face Cap."
        ) from error


def _parse(lines: Iterator[list[str]], path: Path) -> Capture:
    header: list[str]
    rows: _Lines
    numbered = ((number, cells) for number, cells in enumerate(lines, start=1) if any(cell.strip() for cell in cells))
    number, first = next(numbered, (1, [""]))
    if first[0].strip().lower() in _FACE_CAP_LINES:
        header, rows = _face_cap(chain([(number, first)], numbered), path)
    else:
        header, rows = [name.strip() for name in first], numbered
    columns = _columns(header, path)
    frames = [frame for number, cells in rows if (frame := _frame(cells, header, columns, path, number))]
    if not frames:
        raise FacePoserError(f"The capture '{path}' has no frame with a face; record it again.")
    return Capture(tuple(columns), np.array(frames))


def _face_cap(lines: _Lines, path: Path) -> tuple[list[str], _Lines]:
    """Return the header and the frames of a Face Cap text as a table."""
    names: list[str] | None = None
    rows = []
    for number, cells in lines:
        kind = cells[0].strip().lower()
        if kind == "bs":
            if names is not None:
                raise FacePoserError(f"Line {number} of '{path}' names the shapes again; use one file per take.")
            names = [name.strip() for name in cells[1:]]
        elif kind == "k":
            if names is None:
                raise FacePoserError(
                    f"Line {number} of '{path}' is a frame before the line 'bs' that names the shapes."
                )
            rows.append((number, cells))
        elif kind != "info":
            raise FacePoserError(
                f"Line {number} of '{path}' begins with '{cells[0][:20]}' instead of 'info', 'bs' or 'k', which Face "
                "Cap writes; export the take again."
            )
    return ["k", "time", *(_FACE_CAP_WEIGHTS - 2) * [""], *(names or [])], rows


def _columns(header: list[str], path: Path) -> dict[str, list[int]]:
    """Return the columns of each shape, in ARKit's order: one, or two for a split shape."""
    found: defaultdict[str, list[int]] = defaultdict(list)
    for column, name in enumerate(header):
        shape = _channel(name)
        if shape is not None:
            found[shape].append(column)
    for shape, columns in found.items():
        names = {header[column].lower() for column in columns}
        if len(names) < len(columns) or len(columns) > (2 if shape in _SPLIT else 1):
            listed = ", ".join(header[column] for column in columns)
            raise FacePoserError(f"'{path}' has {len(columns)} columns for {shape} ({listed}); keep one.")
    if not found:
        raise FacePoserError(
            f"The header of '{path}' has no name of a shape such as JawOpen or eyeBlink_L; use a CSV file of Live Link "
            "Face or a text export of Face Cap."
        )
    return {shape: found[shape] for shape in ARKIT_SHAPES if shape in found}


def _frame(
    cells: list[str], header: list[str], columns: Mapping[str, list[int]], path: Path, number: int
) -> list[float] | None:
    """Return the weights of one line, or None if the face was lost."""
    used = [column for group in columns.values() for column in group]
    if all(column >= len(cells) or not cells[column].strip() for column in used):
        return None
    if len(cells) < len(header) or any(cell.strip() for cell in cells[len(header) :]):
        raise FacePoserError(
            f"Line {number} of '{path}' has {len(cells)} values instead of {len(header)}; fix or delete the line."
        )
    values = {column: _weight(cells[column], header[column], path, number) for column in used}
    return [sum(values[column] for column in group) / len(group) for group in columns.values()]


def _weight(cell: str, name: str, path: Path, number: int) -> float:
    try:
        value = float(cell)
    except ValueError:
        value = np.nan
    if not _LOWEST <= value <= _HIGHEST:
        raise FacePoserError(
            f"Line {number} of '{path}' has '{cell.strip()[:20]}' in column {name}, which is not a weight from 0 to 1; "
            "fix or delete the line."
        )
    return value


def _channel(name: str) -> str | None:
    """Return the ARKit shape of a column, or None."""
    shape = canonical_shape(name)
    return None if shape is None else whole_shape_of(shape)


def missing_shapes(captures: Iterable[Capture]) -> tuple[str, ...]:
    """Return ARKit's shapes without a channel in any of the ``captures``."""
    present = {name for capture in captures for name in capture.shape_names}
    return tuple(name for name in ARKIT_SHAPES if name not in present)
