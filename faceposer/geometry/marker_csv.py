"""CSV tables of marker motion: plain tables with a header, and exports of Vicon Nexus and OptiTrack Motive."""

import csv
import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from faceposer.errors import FacePoserError
from faceposer.files.reading import open_text

#: Limits of a plausible motion of a face.
MAX_MARKERS = 2_000
MAX_FRAMES = 1_000_000
_MAX_VALUES = 200_000_000

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
    """

    names: list[str]
    positions: NDArray[np.float64]
    rate: float | None
    unit: str


@dataclass(frozen=True, eq=False)
class _Layout:
    """Layout of a table: the column of each axis of each marker, and the width of its lines."""

    columns: dict[str, list[int]]
    width: int
    header: list[str]
    rate: float | None = None
    unit: str = ""
    time: int | None = None


def parse_marker_csv(path: Path, pixels: bool = False) -> MarkerTable:
    """Read the table in the file ``path``.

    Args:
        path: Path of the file.
        pixels: True to accept plain tables of pixels, with x and y only.

    Raises:
        OSError: If the file cannot be opened.
        UnicodeDecodeError: If it is not text.
        FacePoserError: If it is not a table of markers, or a line has the wrong number of values or a value that is not
            a number.
    """
    try:
        with open_text(path, "utf-8-sig", newline="") as file:
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
        f"'{path}' has no header of markers in its first lines; name the columns LipLeft.x, LipLeft.y, LipLeft.z, ..."
    )


def _layout(cells: list[str], preamble: list[list[str]], path: Path, number: int, pixels: bool) -> _Layout | None:
    """Return the layout of the table if ``cells`` are the last line of its header, else None."""
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
    return _Layout(columns, len(cells), cells, time=lower.index("time") if "time" in lower else None)


def _vicon(cells: list[str], preamble: list[list[str]], path: Path) -> _Layout:
    """Return the layout of Vicon Nexus: lines for section, rate, names above the x columns, axes and units."""
    names = preamble[-1] if preamble else []
    rate = next((value for line in reversed(preamble[:-1]) if line and (value := _number(line[0])) is not None), None)
    return _Layout(_triples(cells, names, path), len(cells), cells, rate, unit="\0")


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
    rate = _number(facts.get("Export Frame Rate", "")) or _number(facts.get("Capture Frame Rate", ""))
    return _Layout(_triples(cells, names, path), len(cells), cells, rate, facts.get("Length Units", ""))


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


def _table(layout: _Layout, lines: Iterator[tuple[int, list[str]]], path: Path) -> MarkerTable:
    names, unit = list(layout.columns), layout.unit
    used = [column for places in layout.columns.values() for column in places]
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
                # Other sections, such as forces or joints, may follow.
                break
            continue
        if len(cells) < layout.width or any(cell.strip() for cell in cells[layout.width :]):
            raise FacePoserError(
                f"Line {number} of '{path}' has {len(cells)} values instead of {layout.width}; correct or delete it."
            )
        frames.append(np.array([_coordinate(cells[c], layout.header[c], path, number) for c in used]))
        if layout.time is not None:
            times.append(_coordinate(cells[layout.time], layout.header[layout.time], path, number))
            if len(times) > 1 and times[-1] < times[-2]:
                raise FacePoserError(
                    f"Line {number} of '{path}' has the time {times[-1]:g} after {times[-2]:g}; times must not "
                    "decrease."
                )
        if len(frames) > MAX_FRAMES or len(frames) * len(used) > _MAX_VALUES:
            raise FacePoserError(f"'{path}' is too large for motion of a face; split it into shorter takes.")
    if not frames:
        raise FacePoserError(f"The table '{path}' has no frames below its header; export it again.")
    steps = np.diff(np.array(times)[np.isfinite(times)])
    step = float(np.median(steps)) if len(steps) else 0.0
    # Times are rounded, so that all steps are averaged; longer steps skip frames.
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
            f"Line {number} of '{path}' has '{cell[:20]}' in column {name}, which is not a number; correct it, or "
            "leave the cell blank for a missing marker."
        )
    return value


def _number(text: str) -> float | None:
    try:
        value = float(text)
    except ValueError:
        return None
    return value if math.isfinite(value) else None
