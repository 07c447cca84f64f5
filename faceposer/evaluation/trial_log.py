"""The file of finished trials, which a study that was stopped goes on from.

Its first line says which study it is; every other line has the scores of some trials of one technique. Lines are only
ever added, each in one write, so that whatever stops the program costs the line being written at most.
"""

import hashlib
import json
import os
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from faceposer.errors import FacePoserError
from faceposer.evaluation.measures import Score
from faceposer.evaluation.trials import Cell
from faceposer.files import paths
from faceposer.files.atomic import write_text
from faceposer.files.reading import read_bytes

#: Scores by method, cell and seed, then by number of the trial.
Scores = dict[tuple[str, Cell, int], dict[int, Score]]

_FORMAT, _VERSION = "faceposer.evaluation.trials", 1
# Digits that are kept of a measure: more than any table shows, and few enough for a file of megabytes.
_DIGITS = 6


class TrialLog:
    """The finished trials of one study, in memory and on the disk.

    Attributes:
        path: The file.
        scores: What is in it.
    """

    def __init__(self, path: Path, settings: Mapping[str, Any], restart: bool = False) -> None:
        """Open the file ``path`` of the study with these ``settings``, or begin it.

        Args:
            path: The file; its folder exists.
            settings: All that the scores depend on, for JSON.
            restart: Whether to begin anew, whatever there is.

        Raises:
            FacePoserError: If the file is of another study, is no such file, or cannot be read or written.
        """
        self.path = path
        self.scores: Scores = {}
        header = {"format": _FORMAT, "version": _VERSION, "sha256": _hash(settings), "settings": settings}
        try:
            lines = [] if restart or not paths.exists(path) else self._whole_lines()
            if lines:
                self._check(lines[0], header)
                for number, line in enumerate(lines[1:], start=2):
                    self._take(line, number)
            else:
                self._begin(header)
        except OSError as error:
            raise self._unusable(error) from error

    def _whole_lines(self) -> list[bytes]:
        """Return the lines that were written to their end, and cut off what comes after them."""
        data = read_bytes(self.path)
        whole = data.rfind(b"\n") + 1
        if whole < len(data):
            os.truncate(self.path, whole)
        return data[:whole].splitlines()

    def _begin(self, header: Mapping[str, Any]) -> None:
        write_text(self.path, json.dumps(header) + "\n", "file of trials")

    def _check(self, line: bytes, header: Mapping[str, Any]) -> None:
        try:
            found = json.loads(line)
            same_format = (found["format"], found["version"]) == (_FORMAT, _VERSION)
            checksum = found["sha256"]
            settings = dict(found["settings"])
        except (ValueError, KeyError, TypeError):
            same_format, checksum, settings = False, "", {}
        if not same_format:
            raise FacePoserError(
                f"'{self.path}' is no file of trials; choose another folder, or begin anew with --restart."
            )
        if checksum != header["sha256"]:
            wanted = header["settings"]
            other = [name for name in wanted if settings.get(name) != json.loads(json.dumps(wanted[name]))]
            raise FacePoserError(
                f"The trials in '{self.path}' are of a study with other settings ({', '.join(other) or 'unknown'}); "
                "choose another folder, or begin anew with --restart."
            )

    def _take(self, line: bytes, number: int) -> None:
        try:
            record = json.loads(line)
            cell = Cell(record["constraint"], record["count"], record["noise_px"], record["region"])
            key = (record["method"], cell, record["seed"])
            scores = dict(zip(record["trials"], _scores_of(record), strict=True))
        except (ValueError, KeyError, TypeError) as error:
            raise FacePoserError(
                f"Line {number} of '{self.path}' is damaged; delete the line, or begin anew with --restart."
            ) from error
        self.scores.setdefault(key, {}).update(scores)

    def add(self, method: str, cell: Cell, seed: int, scores: Mapping[int, Score]) -> None:
        """Note the ``scores`` of trials, by their numbers, that ``method`` has done.

        Raises:
            FacePoserError: If the file cannot be written.
        """
        if not scores:
            return
        record = {
            "method": method,
            "constraint": cell.constraint,
            "count": cell.count,
            "noise_px": cell.noise_px,
            "region": cell.region,
            "seed": seed,
            "trials": list(scores),
            **_columns_of(list(scores.values())),
        }
        data = (json.dumps(record, separators=(",", ":")) + "\n").encode()
        try:
            with self.path.open("ab", buffering=0) as file:
                file.write(data)
        except OSError as error:
            raise self._unusable(error) from error
        # From the record, so that a study that goes on has the same numbers to the last digit.
        self._take(data, 0)

    def _unusable(self, error: OSError) -> FacePoserError:
        return FacePoserError(
            f"The file of trials '{self.path}' cannot be used ({error.strerror}); choose another folder."
        )


_COLUMNS = ("error", "neutral_error", "error_2d_px", "to_real", "log_likelihood", "ms")


def _columns_of(scores: Sequence[Score]) -> dict[str, Any]:
    columns: dict[str, Any] = {name: _rounded(getattr(score, name) for score in scores) for name in _COLUMNS}
    columns["by_region"] = {
        region: [_rounded(score.by_region[region][i] for score in scores) for i in (0, 1)]
        for region in (scores[0].by_region if scores else ())
    }
    return columns


def _scores_of(record: Mapping[str, Any]) -> list[Score]:
    rows = zip(*(record[name] for name in _COLUMNS), strict=True)
    return [
        Score(
            by_region={name: (both[0][i], both[1][i]) for name, both in record["by_region"].items()},
            **dict(zip(_COLUMNS, row, strict=True)),
        )
        for i, row in enumerate(rows)
    ]


def _rounded(values: Iterable[float]) -> list[float]:
    return [float(f"{value:.{_DIGITS}g}") for value in values]


def _hash(settings: Mapping[str, Any]) -> str:
    return hashlib.sha256(json.dumps(settings, sort_keys=True).encode()).hexdigest()
