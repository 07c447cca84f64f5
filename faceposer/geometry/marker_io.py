"""Motion of markers on a face, as motion capture systems record it, from C3D and CSV files."""

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
from faceposer.geometry.marker_csv import MAX_FRAMES, MAX_MARKERS, parse_marker_csv

Array = NDArray[np.float64]

_MAX_BYTES = 2**30
#: Centimetres per unit.
_UNITS = {
    **dict.fromkeys(("mm", "millimeter", "millimeters", "millimetre", "millimetres"), 0.1),
    **dict.fromkeys(("cm", "centimeter", "centimeters", "centimetre", "centimetres"), 1.0),
    **dict.fromkeys(("m", "meter", "meters", "metre", "metres"), 100.0),
    **dict.fromkeys(("in", "inch", "inches"), 2.54),
}
# What Vicon writes among the points of a C3D file, but is not a place.
_NO_POINTS = ("ANGLES", "FORCES", "MOMENTS", "POWERS", "SCALARS")


@dataclass(frozen=True, eq=False)
class MarkerMotion:
    """Where M markers were in F frames.

    Attributes:
        names: The markers' names.
        positions: In units of the file, NaN where a marker was not seen, shape (F, M, 3).
        rate: Frames per second, or None where the file does not tell.
        unit_scale: Centimetres per unit of the positions, or None where the file does not tell.
    """

    names: tuple[str, ...]
    positions: Array
    rate: float | None = None
    unit_scale: float | None = None

    def __post_init__(self) -> None:
        if self.positions.ndim != 3 or self.positions.shape[1:] != (len(self.names), 3):
            raise ValueError(f"positions of {len(self.names)} markers cannot be {self.positions.shape}")
        if len(set(self.names)) < len(self.names):
            raise ValueError("two markers have the same name")

    @property
    def seen(self) -> NDArray[np.bool_]:
        """Whether each marker was seen in each frame, shape (F, M)."""
        return np.asarray(np.isfinite(self.positions).all(axis=2))

    def subset(self, names: Sequence[str]) -> "MarkerMotion":
        """Return the motion of the markers ``names``, in this order."""
        columns = [self.names.index(name) for name in names]
        return replace(self, names=tuple(names), positions=self.positions[:, columns])


def read_markers(path: Path) -> MarkerMotion:
    """Return the motion in a C3D or CSV file, told apart by the name's ending; docs/training.md has the forms of CSV.

    Markers keep their names but for a character's name before a colon, where they are told apart without it. Unlabelled
    points are left out. A marker that is exactly at the origin was not seen: several programs write that.

    Raises:
        FacePoserError: If the file is of another kind, cannot be read, is damaged or too large, or has no marker; or if
            the package for C3D is not installed.
    """
    suffix = path.suffix.lower()
    try:
        if suffix not in (".c3d", ".csv"):
            raise FacePoserError(f"Markers cannot be read from '{path}'; give a file that ends in .c3d or .csv.")
        if path.stat().st_size > _MAX_BYTES:
            raise FacePoserError(f"'{path}' is too large for motion of a face; cut it into shorter takes.")
        if suffix == ".csv":
            table = parse_marker_csv(path)
            return _motion(table.names, table.positions, table.rate, table.unit, path)
        with path.open("rb") as file:
            return _read_c3d(file, path)
    except (OSError, UnicodeDecodeError) as error:
        reason = getattr(error, "strerror", None) or error
        raise FacePoserError(f"The markers in '{path}' cannot be read ({reason}); check the file.") from error


def fill_gaps(motion: MarkerMotion, longest: int = 12) -> tuple[MarkerMotion, int]:
    """Return the motion with short gaps filled, and how many positions were.

    Each marker by itself is interpolated in time by piecewise cubic Hermite polynomials that do not overshoot (Fritsch
    and Butland 1984, SciPy's PCHIP). Gaps of more than ``longest`` frames, and those at either end, stay.
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


def _read_c3d(file: BinaryIO, path: Path) -> MarkerMotion:
    try:
        library = importlib.import_module("c3d")
    except ImportError:
        raise FacePoserError(
            f"'{path}' needs a package for C3D files; install it with: pip install 'faceposer[markers]'."
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
            rate = float(reader.point_rate)
    except FacePoserError:
        raise
    except Exception as error:
        # The package raises whatever its parser stumbles over in a damaged file: struct.error, AssertionError, ...
        raise FacePoserError(
            f"The C3D file '{path}' is damaged or of an unknown kind ({str(error)[:80] or type(error).__name__}); "
            "export it again, or as CSV."
        ) from error
    if len(frames) < expected:
        raise FacePoserError(f"The C3D file '{path}' ends after frame {len(frames)} of {expected}; copy it again.")
    data = np.array(frames, dtype=np.float64)
    points, residuals = data[:, :, :3], data[:, :, 3]
    points[residuals < 0.0] = np.nan
    labels = [*labels, *(len(points[0]) - len(labels)) * [""]][: len(points[0])]
    real = [i for i, name in enumerate(labels) if name and not name.startswith("*") and name not in left_out]
    unit = units[0] if units else ""
    return _motion([labels[i] for i in real], points[:, real], rate if rate > 0.0 else None, unit, path)


def _labels(reader: Any) -> list[str]:
    """Return the names of the points; from the 256th on they are in parameters of their own."""
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


def _motion(names: Iterable[str], positions: Array, rate: float | None, unit: str, path: Path) -> MarkerMotion:
    full = list(names)
    if not full:
        raise FacePoserError(f"'{path}' has no marker with a name; label the markers and export it again.")
    plain = [re.sub(r"^.*:", "", name).strip() for name in full]
    names = plain if len(set(plain)) == len(plain) and all(plain) else full
    for name in names:
        if names.count(name) > 1:
            raise FacePoserError(f"'{path}' has two markers with the name {name}; rename one.")
    positions = np.where((positions == 0.0).all(axis=2, keepdims=True), np.nan, positions)
    if not np.isfinite(positions).any():
        raise FacePoserError(f"No marker is seen in any frame of '{path}'; export it again.")
    return MarkerMotion(tuple(names), positions, rate, _UNITS.get(unit.strip().lower()))
