"""Reading of motion capture markers on a face from C3D, CSV and TRC files."""

import importlib
import re
import warnings
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from faceposer.errors import FacePoserError
from faceposer.files.reading import open_file
from faceposer.geometry.marker_csv import MAX_BYTES, MAX_FRAMES, MAX_MARKERS, parse_marker_csv

Array = NDArray[np.float64]

#: Centimetres per unit.
_UNITS = {
    **dict.fromkeys(("mm", "millimeter", "millimeters", "millimetre", "millimetres"), 0.1),
    **dict.fromkeys(("cm", "centimeter", "centimeters", "centimetre", "centimetres"), 1.0),
    **dict.fromkeys(("m", "meter", "meters", "metre", "metres"), 100.0),
    **dict.fromkeys(("in", "inch", "inches"), 2.54),
}
_FASTEST = 100_000.0
_FULL_WORD = 65_535
_BLOCK = 512
# Vicon's quantities among the points of a C3D file that are not positions.
_NO_POINTS = ("ANGLES", "FORCES", "MOMENTS", "POWERS", "SCALARS")


@dataclass(frozen=True, eq=False)
class MarkerMotion:
    """Positions of M markers in F frames.

    Attributes:
        names: Names of the markers.
        positions: Positions in the unit of the file, shape (F, M, 3); NaN for missing markers.
        rate: Frames per second, or None if unknown.
        unit_scale: Centimetres per unit of the positions, or None if unknown.
        notes: What was assumed or is missing, one sentence each.
    """

    names: tuple[str, ...]
    positions: Array
    rate: float | None = None
    unit_scale: float | None = None
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if self.positions.ndim != 3 or self.positions.shape[1:] != (len(self.names), 3):
            raise ValueError(f"positions of {len(self.names)} markers cannot have shape {self.positions.shape}")
        if len(set(self.names)) < len(self.names):
            raise ValueError("two markers have the same name")

    @property
    def seen(self) -> NDArray[np.bool_]:
        """Mask of markers with a known position in each frame, shape (F, M)."""
        return np.asarray(np.isfinite(self.positions).all(axis=2))

    def subset(self, names: Sequence[str]) -> "MarkerMotion":
        """Return the motion of the markers ``names``, in this order."""
        columns = [self.names.index(name) for name in names]
        return replace(self, names=tuple(names), positions=self.positions[:, columns])


def read_markers(path: Path, rate: float | None = None) -> MarkerMotion:
    """Read the motion in a C3D, CSV or TRC file, by its suffix; docs/training.md describes the layouts of tables.

    A prefix of marker names that ends in a colon is removed if the names remain unique. Unlabelled points are left out.
    A marker exactly at the origin is missing, as several programs write that.

    Args:
        path: The file.
        rate: Frames per second in place of those of the file.

    Raises:
        FacePoserError: If the file is of another type, cannot be read, is damaged or too large, or has no markers; or
            if the package for C3D is not installed.
    """
    suffix = path.suffix.lower()
    try:
        if suffix not in (".c3d", ".csv", ".trc"):
            raise FacePoserError(f"Markers cannot be read from '{path}'; choose a .c3d, .csv or .trc file.")
        if suffix != ".c3d":
            table = parse_marker_csv(path, rate=rate)
            return _motion(table.names, table.positions, table.rate, table.unit, path, table.notes)
        with open_file(path, MAX_BYTES) as file:
            return _read_c3d(file, path, rate)
    except OSError as error:
        raise FacePoserError(f"The markers in '{path}' cannot be read: {error.strerror or error}.") from error


def fill_gaps(motion: MarkerMotion, longest: int = 12) -> tuple[MarkerMotion, int]:
    """Return the motion with short gaps filled, and the number of filled positions.

    Each marker is interpolated in time by monotone piecewise cubic Hermite polynomials (Fritsch and Butland 1984,
    SciPy's PCHIP). Gaps of more than ``longest`` frames, and gaps at either end, remain.
    """
    from scipy.interpolate import PchipInterpolator

    positions = motion.positions.copy()
    seen = motion.seen
    n_filled = 0
    for marker in range(len(motion.names)):
        frames = np.flatnonzero(seen[:, marker])
        if len(frames) < 2:
            continue
        lengths = np.diff(frames) - 1
        short = np.flatnonzero((lengths > 0) & (lengths <= longest))
        if not len(short):
            continue
        gaps = np.concatenate([np.arange(frames[gap] + 1, frames[gap + 1]) for gap in short])
        positions[gaps, marker] = PchipInterpolator(frames, positions[frames, marker])(gaps)
        n_filled += len(gaps)
    return replace(motion, positions=positions), n_filled


def _read_c3d(file: BinaryIO, path: Path, rate: float | None) -> MarkerMotion:
    try:
        library = importlib.import_module("c3d")
    except ImportError:
        raise FacePoserError(
            f"Reading '{path}' requires a package for C3D files; install it with: pip install 'faceposer[markers]'."
        ) from None
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            reader = library.Reader(file)
            expected = int(reader.frame_count)
            if not 0 < expected <= MAX_FRAMES or not 0 < reader.point_used <= MAX_MARKERS:
                raise FacePoserError(f"'{path}' has {reader.point_used} points in {expected} frames; export it again.")
            frames = [points[:, :4].copy() for _, points, _ in reader.read_frames(copy=False)]
            labels = _labels(reader)
            left_out = {name for kind in _NO_POINTS for name in _strings(reader, f"POINT:{kind}")}
            units = _strings(reader, "POINT:UNITS")
            stated = float(reader.point_rate)
            counts = _stated_counts(reader)
    except FacePoserError:
        raise
    except Exception as error:
        # The package's parser raises many exceptions for damaged files, with messages for programmers.
        raise FacePoserError(
            f"The C3D file '{path}' is damaged or not supported; export it again, or as CSV."
        ) from error
    # The header counts from its first frame, which may be 0; the rest of the last block of 512 bytes is no frame.
    most = max(counts, default=expected)
    count = max((count for count in counts or [expected] if count <= len(frames)), default=0)
    if count == 0 or (count < most and len(frames) - count > _BLOCK // (8 * len(frames[0]))):
        raise FacePoserError(f"The C3D file '{path}' ends after frame {len(frames)} of {most}; copy it again.")
    notes: tuple[str, ...] = ()
    if len(counts) > 1:
        listed = " and ".join(map(str, counts))
        notes = (f"Its header and its parameters state {listed} frames; {count} were read.",)
    data = np.array(frames[:count], dtype=np.float64)
    points, residuals = data[:, :, :3], data[:, :, 3]
    points[residuals < 0.0] = np.nan
    labels = [*labels, *(len(points[0]) - len(labels)) * [""]][: len(points[0])]
    real = [i for i, name in enumerate(labels) if name and not name.startswith("*") and name not in left_out]
    unit = units[0] if units else ""
    known = rate or (stated if 0.0 < stated <= _FASTEST else None)
    return _motion([labels[i] for i in real], points[:, real], known, unit, path, notes)


def _stated_counts(reader: Any) -> list[int]:
    """Return the different numbers of frames that the header and then the parameters of a C3D file state."""
    header = reader.header
    counts = [int(header.last_frame) - int(header.first_frame) + 1]
    start, end = reader.get("TRIAL:ACTUAL_START_FIELD"), reader.get("TRIAL:ACTUAL_END_FIELD")
    if start is not None and end is not None:
        first, last = (int(words[0]) + 65536 * int(words[1]) for words in (start.uint16_array, end.uint16_array))
        counts.append(last - first + 1)
    for name in ("POINT:LONG_FRAMES", "POINT:FRAMES"):
        found = reader.get(name)
        if found is not None:
            counts.append(int(found.float_value if found.bytes_per_element >= 4 else found.uint16_value))
    # Words of 16 bits end at 65,535, which longer takes have in place of their number.
    plausible = list(dict.fromkeys(count for count in counts if 0 < count <= MAX_FRAMES and count != _FULL_WORD))
    return plausible if max(plausible, default=0) <= _FULL_WORD else [max(plausible)]


def _labels(reader: Any) -> list[str]:
    """Return the names of the points; those after the 255th are in additional parameters."""
    labels = _strings(reader, "POINT:LABELS")
    for more in range(2, 2 + MAX_MARKERS // 255):
        further = _strings(reader, f"POINT:LABELS{more}")
        if not further:
            break
        labels += further
    return labels


def _strings(reader: Any, parameter: str) -> list[str]:
    found = reader.get(parameter)
    if found is None or not len(found.bytes):
        return []
    return [str(text).strip().strip("\0") for text in found.string_array]


def _motion(
    names: Iterable[str], positions: Array, rate: float | None, unit: str, path: Path, notes: tuple[str, ...]
) -> MarkerMotion:
    full = list(names)
    if not full:
        raise FacePoserError(f"'{path}' has no named markers; label the markers and export it again.")
    plain = [re.sub(r"^.*:", "", name).strip() for name in full]
    names = plain if len(set(plain)) == len(plain) and all(plain) else full
    for name in names:
        if names.count(name) > 1:
            raise FacePoserError(f"'{path}' has two markers named {name}; rename one of them.")
    positions = np.where((positions == 0.0).all(axis=2, keepdims=True), np.nan, positions)
    if not np.isfinite(positions).any():
        raise FacePoserError(f"'{path}' has no position of any marker; export it again.")
    return MarkerMotion(tuple(names), positions, rate, _UNITS.get(unit.strip().lower()), notes)
