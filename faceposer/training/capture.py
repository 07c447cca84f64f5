"""Facial capture: ARKit weights over time, from Epic's app Live Link Face or Bannaflak's app Face Cap.

Both write text tables. Live Link Face writes a header with the names of the channels, and one line per frame; so do
other programs, with other separators, decimal signs and spellings (``faceposer.files.tables``). In Face Cap's text
export the first word of a line is its type: ``info`` is a comment, ``bs`` lists the names of the channels, and ``k`` is
a frame: milliseconds, the head's position (3) and rotation (3), the left and right eye's rotation (2 each), then a
weight for each name.
"""

import itertools
import re
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from faceposer.errors import FacePoserError
from faceposer.files.sample_times import Frames, frames_at, frames_in_order, frames_numbered
from faceposer.files.tables import Row, decimal_number, decimal_numbers, open_table
from faceposer.files.time_columns import is_frame_number, is_time, is_timecode, numbers_of, shown_heading, times_of
from faceposer.model.character import ARKIT_SHAPES
from faceposer.model.name_matching import match_with_ties
from faceposer.model.shape_names import canonical_shape, whole_shape_of
from faceposer.training.take_rows import face_column, is_comment, kept_rows, unread_note
from faceposer.training.weight_range import HIGHEST, LOWEST, in_range

Array = NDArray[np.float64]

_Lines = Iterable[Row]

_MAX_BYTES = 256 * 2**20
_MOST_ROWS = 250_000
# Columns before the weights in a Face Cap frame: "k", the time, and the poses of the head and the eyes.
_FACE_CAP_WEIGHTS = 12
_FACE_CAP_KIND = "k"
_FACE_CAP_LINES = ("info", "bs", _FACE_CAP_KIND)
_FACE_CAP_TIME = "time (ms)"
# Lines above a header: comments, or facts about the take.
_LONGEST_PREAMBLE = 12
# Rows from which the column of times is determined.
_FIRST_ROWS = 3
_RATE = re.compile(r"\W*(?:fps|(?:frame|sample)?[ _-]?rate|frames[ _-]?per[ _-]?second)\W*(?:hz)?\W*", re.IGNORECASE)
_FASTEST = 1000.0
# Cells of a line in which the face was lost.
_NO_VALUE = ("", "nan", "null", "none", "-")
#: Two-sided shapes that some apps split into sides; their mean is used.
_SPLIT = ("browInnerUp", "cheekPuff")


@dataclass(frozen=True, eq=False)
class Clock:
    """Times of a take as its file has them.

    Attributes:
        seen: Which of the N rows of the file have values, shape (N,).
        heading: Heading of the column of times or frame numbers, "" if there is none.
        cells: Its N cells, or none.
        rate: Frames per second stated above the header, or None.
    """

    seen: NDArray[np.bool_]
    heading: str = ""
    cells: tuple[str, ...] = ()
    rate: float | None = None

    def frames(self, path: Path, rate: float | None = None) -> Frames:
        """Return the frames of the rows of the file ``path``, at ``rate`` frames per second if it is given.

        Raises:
            FacePoserError: If most of the time is empty.
        """
        count = len(self.seen)
        stated, shown = rate or self.rate, shown_heading(self.heading)
        if not self.cells:
            return frames_in_order(count, stated)
        is_numbered = is_frame_number(self.heading)
        times = None if is_numbered else times_of(self.heading, self.cells)
        if times is not None:
            placed = frames_at(times.seconds, str(path), rate)
            said = (times.note if rate is None and count > 1 and not placed.assumed else "", times.lost)
            return replace(placed, notes=(*filter(None, said), *placed.notes))
        numbers = numbers_of(self.cells)
        if is_numbered:
            if numbers is None:
                return frames_in_order(count, stated, f"Numbers of frames in its column '{shown}' cannot be read")
            return frames_numbered(numbers, str(path), stated)
        if numbers is None or not (np.diff(numbers) >= 1.0).all():
            return frames_in_order(count, stated, f"The times in its column '{shown}' are not understood")
        found = frames_numbered(numbers, str(path), stated)
        if count < 2 or rate is not None:
            return found
        why = (
            f"The times in its column '{shown}' have no unit and rise like numbers of frames; they were read as these."
        )
        return replace(found, notes=(why, *found.notes))


@dataclass(frozen=True, eq=False)
class Capture:
    """One take of a performer.

    Attributes:
        shape_names: ARKit's names of the S channels.
        weights: Shape (frames, S), from 0 for a relaxed muscle to 1 for a full contraction; apps may slightly exceed
            this range.
        clock: Times of a take as it was read, None after frames were left out.
        notes: What was assumed of the weights, one sentence each.
    """

    shape_names: tuple[str, ...]
    weights: Array
    clock: Clock | None = None
    notes: tuple[str, ...] = ()

    @property
    def lost(self) -> int:
        """Number of frames in which the app had lost the face."""
        return 0 if self.clock is None else int((~self.clock.seen).sum())

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
        return Capture(self.shape_names, self.weights[steady])

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
    skipped; ``Capture.clock`` has the times of all.

    Raises:
        FacePoserError: If the file cannot be read or is too large, has no known channel, a duplicate channel or no
            frame with a face, or has a line with too few or too many cells or a value that is not a weight.
    """
    with open_table(path, "capture", _MAX_BYTES) as rows:
        return _parse(rows, path)


def _parse(lines: Iterator[Row], path: Path) -> Capture:
    header: list[str]
    rows: _Lines
    rate: float | None = None
    number, first = next(lines, (1, [""]))
    if first[0].strip().lower() in _FACE_CAP_LINES:
        header, rows = _face_cap(itertools.chain([(number, first)], lines), path)
    else:
        header, rate = _header(first, lines, path)
        rows = lines
    columns, spelling = _columns(header, path)
    reader = _FrameReader(header, columns, path)
    frames: list[NDArray[np.float64] | None] = []
    times: list[str] = []
    faces: list[str] = []
    first_rows: list[list[str]] = []
    clock: int | None = None
    face = face_column(header)
    for number, cells in rows:
        if is_comment(cells):
            continue
        if len(frames) == _MOST_ROWS:
            raise FacePoserError(f"'{path}' has more than {_MOST_ROWS:,} frames; split it into shorter takes.")
        if clock is None and len(first_rows) < _FIRST_ROWS:
            # A row of units may precede the frames.
            first_rows.append(cells)
            clock = _time_column(header, cells)
            rate = rate or _rate_column(header, cells)
            if clock is not None:
                times = [row[clock] if clock < len(row) else "" for row in first_rows[:-1]]
        frames.append(reader.frame(cells, number))
        if clock is not None:
            times.append(cells[clock] if clock < len(cells) else "")
        if face is not None:
            faces.append(cells[face] if face < len(cells) else "")
    heading = "" if clock is None else header[clock]
    kept, left_out = kept_rows(heading, times, faces, frames)
    rows_kept = np.flatnonzero(kept).tolist()
    seen = np.array([frames[i] is not None for i in rows_kept], dtype=bool)
    if not seen.any():
        raise FacePoserError(f"The capture '{path}' has no frame with a face; record it again.")
    weights, percent = reader.in_range(np.array([frames[i] for i in rows_kept if frames[i] is not None]))
    notes = (*spelling, unread_note(_unread(header, columns)), *percent, left_out)
    found = Clock(seen, heading, tuple(times[i] for i in rows_kept if times), rate)
    return Capture(tuple(columns), weights, found, tuple(note for note in notes if note))


def _unread(header: list[str], columns: Mapping[str, list[int]]) -> list[str]:
    read = {column for group in columns.values() for column in group}
    unread = [name for column, name in enumerate(header) if name and column not in read]
    return [name for name in unread if name != _FACE_CAP_KIND and canonical_shape(name) is None]


def _header(first: list[str], lines: Iterator[Row], path: Path) -> tuple[list[str], float | None]:
    """Return the header, which comments and facts may precede, and the rate among these."""
    rate: float | None = None
    cells = first
    for _ in range(_LONGEST_PREAMBLE):
        header = [cell.strip() for cell in cells]
        if any(canonical_shape(name) for name in header) or match_with_ties(header).shapes:
            return header, rate
        rate = rate or _stated_rate(header)
        following = next(lines, None)
        if following is None:
            break
        cells = following[1]
    raise FacePoserError(
        f"The header of '{path}' has no name of a shape such as JawOpen or eyeBlink_L; use a CSV file of Live Link "
        "Face or a text export of Face Cap."
    )


def _stated_rate(cells: list[str]) -> float | None:
    """Return the frames per second in a line such as "fps: 25", or None."""
    words = [word for cell in cells for word in re.split(r"[:=]", cell[:80]) if word.strip()]
    for name, value in itertools.pairwise(words):
        number = decimal_number(value)
        if _RATE.fullmatch(name) and number is not None and 0.0 < number <= _FASTEST:
            return number
    return None


def _rate_column(header: list[str], cells: list[str]) -> float | None:
    """Return the frames per second in a column of its own, by the ``header`` and the ``cells`` of the first row."""
    named = [cell for name, cell in zip(header, cells, strict=False) if _RATE.fullmatch(name[:80])]
    rate = decimal_number(named[0]) if named else None
    return rate if rate is not None and 0.0 < rate <= _FASTEST else None


def _time_column(header: list[str], cells: list[str]) -> int | None:
    """Return the column of times, else of frame numbers, by the ``header`` and the ``cells`` of the first row."""
    filled = [i for i in range(min(len(header), len(cells))) if cells[i].strip()]
    named = [i for i in filled if is_time(header[i]) and times_of(header[i], [cells[i]]) is not None]
    # Of several columns, timecodes of the take are preferred to the time of the day as a number.
    by_cells = [i for i in named or filled if is_timecode(cells[i])]
    numbered = [i for i in filled if is_frame_number(header[i])]
    return next(iter([*by_cells, *named, *numbered]), None)


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
    return [_FACE_CAP_KIND, _FACE_CAP_TIME, *(_FACE_CAP_WEIGHTS - 2) * [""], *(names or [])], rows


def _columns(header: list[str], path: Path) -> tuple[dict[str, list[int]], tuple[str, ...]]:
    """Return the columns of each shape, in ARKit's order: one, or two for a split shape; and notes on their names."""
    match = match_with_ties(header)
    shapes = match.with_ties
    found: defaultdict[str, list[int]] = defaultdict(list)
    for column, name in enumerate(header):
        if name in shapes:
            found[whole_shape_of(shapes[name])].append(column)
    notes = [match.note] if match.note else []
    for shape in _SPLIT:
        columns = found.get(shape, [])
        whole = [column for column in columns if shapes[header[column]] == shape]
        if whole and len(whole) < len(columns):
            notes.append(f"The halves of {shape} are not used, since the whole is in column '{header[whole[0]][:60]}'.")
            found[shape] = whole
    for shape, columns in found.items():
        names = {header[column].lower() for column in columns}
        if len(names) < len(columns) or len(columns) > (2 if shape in _SPLIT else 1):
            listed = ", ".join(header[column][:60] for column in columns[:4])
            raise FacePoserError(f"'{path}' has {len(columns)} columns for {shape} ({listed}); keep one.")
    if not found:
        raise FacePoserError(
            f"'{path}' names no shape such as jawOpen or eyeBlink_L; export it with the names of its shapes."
        )
    ordered = {shape: found[shape] for shape in ARKIT_SHAPES if shape in found}
    return ordered, tuple(notes)


class _FrameReader:
    """Reads the weights of lines."""

    def __init__(self, header: list[str], columns: Mapping[str, list[int]], path: Path) -> None:
        self._header = header
        self._path = path
        self._used = [column for group in columns.values() for column in group]
        self._starts = np.cumsum([0, *map(len, columns.values())][:-1])
        self._sizes = np.array([len(group) for group in columns.values()], dtype=np.float64)
        self._beyond: FacePoserError | None = None

    def frame(self, cells: list[str], number: int) -> Array | None:
        """Return the weights of the line ``number``, shape (S,), or None if the face was lost."""
        header, path = self._header, self._path
        lost = _NO_VALUE if len(self._used) > 1 else ("",)
        if all(column >= len(cells) or cells[column].strip().lower() in lost for column in self._used):
            return None
        if len(cells) < len(header) or any(cell.strip() for cell in cells[len(header) :]):
            commas = " (decimal commas need another separator)" if len(cells) > len(header) else ""
            raise FacePoserError(
                f"Line {number} of '{path}' has {len(cells)} values instead of {len(header)}; fix or delete "
                f"the line{commas}."
            )
        values = decimal_numbers([cells[column] for column in self._used])
        if values is None:
            values = [_weight(cells[column], header[column], path, number) for column in self._used]
        if self._beyond is None and (min(values) < LOWEST or max(values) > HIGHEST):
            i = next(i for i, value in enumerate(values) if not LOWEST <= value <= HIGHEST)
            column = self._used[i]
            self._beyond = _no_weight(cells[column], header[column], path, number)
        weights = np.array(values)
        if len(self._sizes) < len(values):
            weights = np.add.reduceat(weights, self._starts) / self._sizes
        return weights

    def in_range(self, weights: Array) -> tuple[Array, tuple[str, ...]]:
        """Return the ``weights`` of all lines, shape (F, S), from 0 to 1, and a sentence about percentages.

        Raises:
            FacePoserError: If a weight is neither from 0 to 1 nor a percentage.
        """
        if self._beyond is None:
            return weights, ()
        found = in_range(weights)
        if found is None:
            raise self._beyond
        return found[0], (found[1],) if found[1] else ()


def _weight(cell: str, name: str, path: Path, number: int) -> float:
    value = decimal_number(cell)
    if value is None:
        raise _no_weight(cell, name, path, number)
    return value


def _no_weight(cell: str, name: str, path: Path, number: int) -> FacePoserError:
    return FacePoserError(
        f"Line {number} of '{path}' has '{cell.strip()[:20]}' in column {name}, which is not a weight from 0 to 1; "
        "fix or delete the line."
    )


def missing_shapes(captures: Iterable[Capture]) -> tuple[str, ...]:
    """Return ARKit's shapes without a channel in any of the ``captures``."""
    present = {name for capture in captures for name in capture.shape_names}
    return tuple(name for name in ARKIT_SHAPES if name not in present)
