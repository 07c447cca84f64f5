"""Tables of marker motion: a plain one with a header, and the exports of Vicon Nexus and OptiTrack Motive."""

import csv
import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from faceposer.errors import FacePoserError

#: More than these are no motion of a face.
MAX_MARKERS = 2_000
MAX_FRAMES = 1_000_000
_MAX_VALUES = 200_000_000

_AXES = "xyz"
_PLAIN_COLUMN = re.compile(r"^(.*?)[ ._:]([xyz])$", re.IGNORECASE)
_LONGEST_PREAMBLE = 12


@dataclass(frozen=True, eq=False)
class MarkerTable:
    """What a table tells.

    Attributes:
        names: The markers' names, M of them.
        positions: NaN where blank, shape (F, M, 3), or (F, M, 2) of a table of pixels.
        rate: Frames per second, or None.
        unit: The name of the unit, or "".
    """

    names: list[str]
    positions: NDArray[np.float64]
    rate: float | None
    unit: str


@dataclass(frozen=True, eq=False)
class _Layout:
    """Where the table has what: a column for each axis of each name, and how long its lines are."""

    columns: dict[str, list[int]]
    width: int
    header: list[str]
    rate: float | None = None
    unit: str = ""
    time: int | None = None


def parse_marker_csv(path: Path, pixels: bool = False) -> MarkerTable:
    """Return the table in the file ``path``.

    Args:
        path: The file.
        pixels: Whether it may be a plain table of pixels, with x and y alone.

    Raises:
        OSError: If the file cannot be opened.
        UnicodeDecodeError: If it is not text.
        FacePoserError: If it is no table of markers, or has a line too short, too long or with something else than a
            number in it.
    """
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            lines = enumerate(csv.reader(file), start=1)
            preamble: list[list[str]] = []
            for number, cells in lines:
                stripped = [cell.strip() for cell in cells]
                layout = _layout(stripped, preamble, path, number, pixels)
                if layout is not None:
                    return _table(layout, lines, path)
                preamble.append(stripped)
                if number > _LONGEST_PREAMBLE:
                    break
    except csv.Error as error:
        raise FacePoserError(f"The table '{path}' cannot be read ({error}); export it again.") from error
    raise FacePoserError(
        f"'{path}' has no header of markers in its first lines; name columns such as LipLeft.x, LipLeft.y, LipLeft.z."
    )


def _layout(cells: list[str], preamble: list[list[str]], path: Path, number: int, pixels: bool) -> _Layout | None:
    """Return how the table is laid out if ``cells`` are the last line of its header."""
    lower = [cell.lower() for cell in cells]
    if lower[:1] == ["frame"] and lower.count("x") > 0:
        return _motive(cells, preamble, path) if _row(preamble, "name") else _vicon(cells, preamble, path)
    if not lower or lower[0] in ("", "format version"):
        return None
    columns: dict[str, list[int]] = {}
    for column, cell in enumerate(cells):
        match = _PLAIN_COLUMN.match(cell)
        if match and match[1]:
            places = columns.setdefault(match[1].strip(), [-1, -1, -1])
            axis = _AXES.index(match[2].lower())
            if places[axis] >= 0:
                raise FacePoserError(f"Line {number} of '{path}' names the column {cell} twice; keep one.")
            places[axis] = column
    if pixels and all(places[2] < 0 for places in columns.values()):
        columns = {name: places[:2] for name, places in columns.items()}
    for name, places in columns.items():
        if -1 in places:
            lacking = _AXES[places.index(-1)]
            wanted = "x, y and z" if len(places) == 3 else "x and y"
            raise FacePoserError(f"Line {number} of '{path}' has no column {name}.{lacking}; a marker needs {wanted}.")
    if not columns:
        return None
    return _Layout(columns, len(cells), cells, time=lower.index("time") if "time" in lower else None)


def _vicon(cells: list[str], preamble: list[list[str]], path: Path) -> _Layout:
    """Vicon Nexus: the section's name, the rate, the names over their x, the axes, and the units below."""
    names = preamble[-1] if preamble else []
    rate = next((value for line in reversed(preamble[:-1]) if line and (value := _number(line[0])) is not None), None)
    return _Layout(_triples(cells, names, path), len(cells), cells, rate, unit="\0")


def _motive(cells: list[str], preamble: list[list[str]], path: Path) -> _Layout:
    """OptiTrack Motive: keys and values in the first line, then a line each for types, names and quantities."""
    facts = dict(zip(preamble[0][::2], preamble[0][1::2], strict=False))
    names = list(_row(preamble, "name"))
    types = _row(preamble, "type") or ["Marker"] * len(cells)
    quantities = preamble[-1]
    for column in range(len(names)):
        kind = types[column].lower() if column < len(types) else ""
        quantity = quantities[column].lower() if column < len(quantities) else ""
        if kind != "marker" or quantity != "position" or names[column].split(":")[-1].lower().startswith("unlabeled"):
            names[column] = ""
    rate = _number(facts.get("Export Frame Rate", "")) or _number(facts.get("Capture Frame Rate", ""))
    return _Layout(_triples(cells, names, path), len(cells), cells, rate, facts.get("Length Units", ""))


def _row(preamble: list[list[str]], kind: str) -> list[str]:
    """Return the line of Motive's header whose second cell is ``kind``; the first is empty."""
    for line in preamble:
        if len(line) > 2 and not line[0] and line[1].lower() == kind:
            return ["", "", *line[2:]]
    return []


def _triples(cells: list[str], names: Sequence[str], path: Path) -> dict[str, list[int]]:
    """Return the columns of each name that stands above an x, with y and z after it."""
    columns: dict[str, list[int]] = {}
    axes = [cell.lower() for cell in cells]
    for column, name in enumerate(names):
        if name and axes[column : column + 3] == list(_AXES):
            if name in columns:
                raise FacePoserError(f"'{path}' has two markers with the name {name}; rename one.")
            columns[name] = [column, column + 1, column + 2]
    return columns


def _table(layout: _Layout, lines: Iterator[tuple[int, list[str]]], path: Path) -> MarkerTable:
    names, unit = list(layout.columns), layout.unit
    wanted = [column for places in layout.columns.values() for column in places]
    if len(names) > MAX_MARKERS:
        raise FacePoserError(f"'{path}' has {len(names)} markers; at most {MAX_MARKERS} are read.")
    frames: list[NDArray[np.float64]] = []
    times: list[float] = []
    for number, cells in lines:
        if unit == "\0":
            unit = next((cell.strip() for cell in cells[2:] if cell.strip()), "")
            continue
        if not any(cell.strip() for cell in cells):
            if frames:
                # Other sections may follow, of forces or of joints.
                break
            continue
        if len(cells) < layout.width or any(cell.strip() for cell in cells[layout.width :]):
            raise FacePoserError(
                f"Line {number} of '{path}' has {len(cells)} values, {layout.width} are needed; mend or delete it."
            )
        frames.append(np.array([_coordinate(cells[c], layout.header[c], path, number) for c in wanted]))
        if layout.time is not None:
            times.append(_coordinate(cells[layout.time], layout.header[layout.time], path, number))
            if len(times) > 1 and times[-1] < times[-2]:
                raise FacePoserError(
                    f"Line {number} of '{path}' has the time {times[-1]:g} after {times[-2]:g}; times must rise from "
                    "line to line."
                )
        if len(frames) > MAX_FRAMES or len(frames) * len(wanted) > _MAX_VALUES:
            raise FacePoserError(f"'{path}' is too large for motion of a face; cut it into shorter takes.")
    if not frames:
        raise FacePoserError(f"The table '{path}' has no frame below its header; export it again.")
    steps = np.diff(np.array(times)[np.isfinite(times)])
    step = float(np.median(steps)) if len(steps) else 0.0
    # Times are rounded, so that one step tells less than all; a longer one has left out frames.
    rate = float(np.rint(steps / step).sum() / steps.sum()) if step > 0.0 and steps.min() > 0.0 else layout.rate
    n_axes = len(layout.columns[names[0]]) if names else len(_AXES)
    return MarkerTable(names, np.array(frames).reshape(len(frames), len(names), n_axes), rate, unit.strip("\0"))


def _coordinate(cell: str, name: str, path: Path, number: int) -> float:
    cell = cell.strip()
    if not cell or cell.lower() == "nan":
        return math.nan
    value = _number(cell)
    if value is None:
        raise FacePoserError(
            f"Line {number} of '{path}' has '{cell[:20]}' in column {name}, which is not a number; mend it, or leave "
            "the cell blank where the marker was not seen."
        )
    return value


def _number(text: str) -> float | None:
    try:
        value = float(text)
    except ValueError:
        return None
    return value if math.isfinite(value) else None
