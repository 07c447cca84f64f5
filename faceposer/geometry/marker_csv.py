"""Text tables of marker motion: plain tables with a header, exports of Vicon Nexus and OptiTrack Motive, and TRC."""

import itertools
import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from faceposer.errors import FacePoserError, counted
from faceposer.files.sample_times import Frames, frames_at, frames_in_order, frames_numbered, placed
from faceposer.files.tables import Row, decimal_number, decimal_numbers, open_table
from faceposer.files.time_columns import is_frame_number, is_time, shown_heading, times_of

#: Limits of a plausible motion of a face.
MAX_MARKERS = 2_000
MAX_FRAMES = 1_000_000
MAX_BYTES = 256 * 2**20
_MAX_VALUES = 30_000_000

_AXES = "xyz"
_PLAIN_COLUMN = re.compile(r"^(.*?)[ ._:]([xyz])$", re.IGNORECASE)
_LONGEST_PREAMBLE = 12


@dataclass(frozen=True, eq=False)
class MarkerTable:
    """The content of a table of M markers in F frames.

    Attributes:
        names: Names of the markers.
        positions: Positions, shape (F, M, 3), or (F, M, 2) in a table of pixels; NaN for blank cells.
        rate: Frames per second, or None if unknown.
        unit: Name of the unit, or "" if unknown.
        notes: What was assumed or is missing, one sentence each.
    """

    names: list[str]
    positions: NDArray[np.float64]
    rate: float | None
    unit: str
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class _Layout:
    """Layout of a table.

    Attributes:
        columns: Columns of the axes of each marker.
        width: Number of cells in a row.
        header: Headings of the columns.
        rate: Frames per second that are stated, or None.
        unit: Unit that is stated; NUL if the first row has it.
        clock: Columns of the times and of the numbers of frames, or None.
        sections: True if other sections, such as forces or joints, may follow after an empty line.
    """

    columns: dict[str, list[int]]
    width: int
    header: list[str]
    rate: float | None = None
    unit: str = ""
    clock: tuple[int | None, int | None] = (None, None)
    sections: bool = True


def parse_marker_csv(path: Path, pixels: bool = False, rate: float | None = None) -> MarkerTable:
    """Read the table in the file ``path``; its rows are put on frames by their times or frame numbers.

    Args:
        path: Path of the file.
        pixels: True to accept plain tables of pixels, with x and y only.
        rate: Frames per second in place of those of the file.

    Raises:
        FacePoserError: If it cannot be read, is not a table of markers, or a line has the wrong number of values or a
            value that is not a number.
    """
    with open_table(path, "table", MAX_BYTES, blank=True) as lines:
        preamble: list[list[str]] = []
        for number, cells in lines:
            stripped = [cell.strip() for cell in cells] or [""]
            layout = _layout(stripped, preamble, path, number, pixels)
            if layout is not None:
                return _table(layout, lines, path, rate)
            preamble.append(stripped)
            if number > _LONGEST_PREAMBLE:
                break
    raise FacePoserError(
        f"'{path}' has no header of markers in its first lines; name the columns LipLeft.x, LipLeft.y, LipLeft.z, ..."
    )


def _layout(cells: list[str], preamble: list[list[str]], path: Path, number: int, pixels: bool) -> _Layout | None:
    """Return the layout of the table if ``cells`` are the last line of its header, else None."""
    lower = [cell.lower() for cell in cells]
    if lower[:1] == ["frame"] and lower.count("x") > 0:
        return _motive(cells, preamble, path) if _row(preamble, "name") else _vicon(cells, preamble, path)
    if preamble and preamble[-1][0].lower() == "frame#":
        return _trc(cells, preamble, path)
    if not lower or lower[0] in ("", "format version", "pathfiletype"):
        return None
    columns: dict[str, list[int]] = {}
    for column, cell in enumerate(cells):
        match = _PLAIN_COLUMN.match(cell)
        if match and match[1]:
            places = columns.setdefault(match[1].strip(), [-1, -1, -1])
            axis = _AXES.index(match[2].lower())
            if places[axis] >= 0:
                raise FacePoserError(f"Line {number} of '{path}' has two columns named {cell}; remove one of them.")
            places[axis] = column
    if pixels and all(places[2] < 0 for places in columns.values()):
        columns = {name: places[:2] for name, places in columns.items()}
    for name, places in columns.items():
        if -1 in places:
            lacking = _AXES[places.index(-1)]
            axes = "x, y and z" if len(places) == 3 else "x and y"
            raise FacePoserError(f"Line {number} of '{path}' has no column {name}.{lacking}; a marker needs {axes}.")
    if not columns:
        return None
    return _Layout(columns, len(cells), cells, clock=_clock(cells), sections=False)


def _clock(cells: list[str]) -> tuple[int | None, int | None]:
    """Return the columns of the times and of the numbers of frames."""
    time = next((i for i, cell in enumerate(cells) if is_time(cell)), None)
    return time, next((i for i, cell in enumerate(cells) if is_frame_number(cell)), None)


def _vicon(cells: list[str], preamble: list[list[str]], path: Path) -> _Layout:
    """Return the layout of Vicon Nexus: lines for section, rate, names above the x columns, axes and units."""
    names = preamble[-1] if preamble else []
    rate = next(
        (value for line in reversed(preamble[:-1]) if line and (value := decimal_number(line[0])) is not None), None
    )
    return _Layout(_triples(cells, names, path), len(cells), cells, rate, "\0", _clock(cells))


def _motive(cells: list[str], preamble: list[list[str]], path: Path) -> _Layout:
    """Return the layout of OptiTrack Motive: keys and values, then lines for types, names and quantities."""
    facts = dict(zip(preamble[0][::2], preamble[0][1::2], strict=False))
    names = list(_row(preamble, "name"))
    types = _row(preamble, "type") or ["Marker"] * len(cells)
    quantities = preamble[-1]
    for column in range(len(names)):
        kind = types[column].lower() if column < len(types) else ""
        quantity = quantities[column].lower() if column < len(quantities) else ""
        if kind != "marker" or quantity != "position" or names[column].split(":")[-1].lower().startswith("unlabeled"):
            names[column] = ""
    rate = decimal_number(facts.get("Export Frame Rate", "")) or decimal_number(facts.get("Capture Frame Rate", ""))
    unit = facts.get("Length Units", "")
    return _Layout(_triples(cells, names, path), len(cells), cells, rate, unit, _clock(cells))


def _trc(cells: list[str], preamble: list[list[str]], path: Path) -> _Layout:
    """Return the layout of TRC files: lines for the file, facts and their values, names above x columns, and axes."""
    names = preamble[-1]
    facts: dict[str, str] = {}
    for keys, values in itertools.pairwise(preamble):
        if "DataRate" in keys:
            facts = dict(zip(keys, values, strict=False))
    axes = [re.sub(r"\d+$", "", cell) for cell in cells]
    columns = _triples(axes, ["", "", *names[2:]], path)
    clock = (1 if [cell.lower() for cell in names[1:2]] == ["time"] else None, 0)
    header = ["Frame", "Time (s)", *cells[2:]]
    rate = decimal_number(facts.get("DataRate", ""))
    return _Layout(columns, len(cells), header, rate, facts.get("Units", ""), clock, sections=False)


def _row(preamble: list[list[str]], kind: str) -> list[str]:
    """Return the line of Motive's header with an empty first cell and ``kind`` as the second, or []."""
    for line in preamble:
        if len(line) > 2 and not line[0] and line[1].lower() == kind:
            return ["", "", *line[2:]]
    return []


def _triples(cells: list[str], names: Sequence[str], path: Path) -> dict[str, list[int]]:
    """Return the columns of each name above an x that is followed by y and z."""
    columns: dict[str, list[int]] = {}
    axes = [cell.lower() for cell in cells]
    for column, name in enumerate(names):
        if name and axes[column : column + 3] == list(_AXES):
            if name in columns:
                raise FacePoserError(f"'{path}' has two markers named {name}; rename one of them.")
            columns[name] = [column, column + 1, column + 2]
    return columns


def _table(layout: _Layout, lines: Iterator[Row], path: Path, rate: float | None) -> MarkerTable:
    names, unit = list(layout.columns), layout.unit
    used = [column for places in layout.columns.values() for column in places]
    if len(names) > MAX_MARKERS:
        raise FacePoserError(f"'{path}' has {counted(len(names), 'marker')}; at most {MAX_MARKERS} are read.")
    frames: list[NDArray[np.float64]] = []
    times: list[str] = []
    numbers: list[float] = []
    last, unseen = -math.inf, 0
    time_column, frame_column = layout.clock
    for number, cells in lines:
        if unit == "\0":
            unit = next((cell.strip() for cell in cells[2:] if cell.strip()), "")
            continue
        if not any(cell.strip() for cell in cells):
            if layout.sections and frames:
                break
            # A row of the full width is a frame in which no marker was seen, unless nothing follows.
            unseen += not layout.sections and layout.clock == (None, None) and len(cells) >= layout.width
            continue
        if len(cells) < layout.width or any(cell.strip() for cell in cells[layout.width :]):
            raise FacePoserError(
                f"Line {number} of '{path}' has {counted(len(cells), 'value')} instead of {layout.width}; "
                f"correct or delete it."
            )
        frames += unseen * [np.full(len(used), np.nan)]
        unseen = 0
        values = decimal_numbers([cells[column] for column in used])
        if values is None:
            values = [_coordinate(cells[column], layout.header[column], path, number) for column in used]
        frames.append(np.array(values))
        if time_column is not None:
            times.append(cells[time_column])
            last = _later(cells[time_column], last, path, number)
        elif frame_column is not None:
            found = decimal_number(cells[frame_column])
            numbers.append(math.nan if found is None else found)
        if len(frames) > MAX_FRAMES or len(frames) * len(used) > _MAX_VALUES:
            raise FacePoserError(f"'{path}' is too large for motion of a face; split it into shorter takes.")
    if not frames:
        raise FacePoserError(f"The table '{path}' has no frames below its header; export it again.")
    n_axes = len(layout.columns[names[0]]) if names else len(_AXES)
    positions = np.array(frames).reshape(len(frames), len(names), n_axes)
    clock, said = _frames(layout, times, numbers, len(frames), path, rate)
    if clock.length * len(used) > _MAX_VALUES:
        raise FacePoserError(f"'{path}' is too large for motion of a face; split it into shorter takes.")
    positions, gaps = placed(clock, positions)
    # That a rate is assumed is said where one is needed.
    notes = (*said, *(() if clock.assumed else clock.notes), *gaps)
    return MarkerTable(names, positions, None if clock.assumed else clock.rate, unit.strip("\0"), notes)


def _later(cell: str, last: float, path: Path, number: int) -> float:
    """Return the time in ``cell`` if it is a number, else ``last``, which it must not precede."""
    time = decimal_number(cell)
    if time is not None and time < last:
        raise FacePoserError(
            f"Line {number} of '{path}' has the time {time:g} after {last:g}; times must not go back: split "
            "the file there, or correct its times."
        )
    return last if time is None else time


def _frames(
    layout: _Layout, times: list[str], numbers: list[float], count: int, path: Path, rate: float | None
) -> tuple[Frames, tuple[str, ...]]:
    """Return the frames of the ``count`` rows of a table, and what was assumed of their times."""
    stated = rate or layout.rate
    if layout.clock[0] is not None and count > 1:
        heading = layout.header[layout.clock[0]]
        found = times_of(heading, times)
        clock = None if found is None else frames_at(found.seconds, str(path), rate)
        if clock is not None and found is not None and not clock.assumed:
            return clock, (found.note,) if found.note and rate is None else ()
        return frames_in_order(count, stated), (f"The times in its column '{shown_heading(heading)}' tell no rate.",)
    if numbers and np.isfinite(numbers).all():
        return frames_numbered(np.array(numbers), str(path), stated), ()
    return frames_in_order(count, stated), ()


def _coordinate(cell: str, name: str, path: Path, number: int) -> float:
    cell = cell.strip()
    if not cell or cell.lower() == "nan":
        return math.nan
    value = decimal_number(cell)
    if value is None:
        raise FacePoserError(
            f"Line {number} of '{path}' has '{cell[:20]}' in column {name}, which is not a number; correct it, or "
            "leave the cell blank for a missing marker."
        )
    return value
