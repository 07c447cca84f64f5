"""Facial capture: ARKit weights over time, read from the CSV files of Epic's app Live Link Face."""

import csv
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from faceposer.errors import FacePoserError
from faceposer.model.subject import ARKIT_SHAPES

Array = NDArray[np.float64]

_MAX_BYTES = 256 * 2**20


@dataclass(frozen=True, eq=False)
class Capture:
    """One take of a performer.

    Attributes:
        shape_names: ARKit's names of the S channels.
        weights: Shape (frames, S); 0 is a relaxed muscle, 1 a full one, and the app may go a little beyond.
    """

    shape_names: tuple[str, ...]
    weights: Array

    def without_jumps(self, threshold: float = 0.3) -> "Capture":
        """Return the take without the frames that a channel reaches by a jump of more than ``threshold``.

        Lids close faster than any tracking error lasts; blinks stay.
        """
        watched = [not name.startswith("eyeBlink") for name in self.shape_names]
        steps = np.abs(np.diff(self.weights[:, watched], axis=0)).max(axis=1, initial=0.0)
        steady = np.concatenate([[True], steps <= threshold])
        return replace(self, weights=self.weights[steady])

    def from_rest(self, percentile: float = 5.0) -> "Capture":
        """Return the take with the performer's rest subtracted, within 0 to 1.

        The app is not calibrated: a relaxed face has weights of 0.1 or 0.2, which no face pose needs. The rest of a
        channel is a low ``percentile`` of it.
        """
        rest = np.percentile(self.weights, percentile, axis=0)
        return replace(self, weights=np.clip(self.weights - rest, 0.0, 1.0))


def read_live_link_face(path: Path) -> Capture:
    """Return the take in the CSV file ``path``, its 52 channels found by their names in the header.

    Frames in which the app had lost the face, and wrote no values, are left out.

    Raises:
        FacePoserError: If the file cannot be read, lacks channels or has a value that is not a number.
    """
    try:
        if path.stat().st_size > _MAX_BYTES:
            raise FacePoserError(f"'{path}' is too large for a take of a face; cut it into shorter ones.")
        with path.open(newline="", encoding="utf-8-sig") as file:
            return _parse(csv.reader(file), path)
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise FacePoserError(
            f"The capture '{path}' cannot be read ({error}); give a CSV file of Live Link Face."
        ) from error


def _parse(lines: Iterator[list[str]], path: Path) -> Capture:
    header = [name.strip().lower() for name in next(lines, [])]
    missing = [name for name in ARKIT_SHAPES if name.lower() not in header]
    if missing:
        raise FacePoserError(
            f"The header of '{path}' lacks {_listed(missing)}; give a CSV of Live Link Face with all 52 channels."
        )
    columns = [header.index(name.lower()) for name in ARKIT_SHAPES]
    frames = [
        _frame(cells, columns, path, number) for number, cells in enumerate(lines, start=2) if len(cells) > min(columns)
    ]
    if not frames:
        raise FacePoserError(f"The capture '{path}' has no frame with a face in it; record it anew.")
    return Capture(ARKIT_SHAPES, np.array(frames))


def _frame(cells: list[str], columns: list[int], path: Path, number: int) -> list[float]:
    try:
        values = [float(cells[column]) for column in columns]
    except (IndexError, ValueError):
        values = [np.nan]
    if not np.isfinite(values).all():
        raise FacePoserError(f"Line {number} of '{path}' does not have a number in each of the 52 channels; mend it.")
    return values


def _listed(names: Iterable[str], at_most: int = 3) -> str:
    names = list(names)
    rest = len(names) - at_most
    return ", ".join(names[:at_most]) + (f" and {rest} more" if rest > 0 else "")
