"""Log of finished trials, from which a stopped study continues.

The first line identifies the study; every other line has the scores of some trials of one technique. Lines are only
appended, each in a single write, so that an interruption loses at most the line being written.
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
from faceposer.files.reading import read_bytes
from faceposer.files.writing import json_text, write_json

#: Scores by method, cell and seed, then by the number of the trial.
Scores = dict[tuple[str, Cell, int], dict[int, Score]]

_FORMAT, _VERSION = "faceposer.evaluation.trials", 1
# Significant digits of stored measures: more than any table shows, and few enough to keep the file small.
_DIGITS = 6


class TrialLog:
    """Finished trials of one study, in memory and on disk.

    Attributes:
        path: The file.
        scores: Scores in the file.
    """

    def __init__(self, path: Path, settings: Mapping[str, Any], restart: bool = False) -> None:
        """Open the log of a study, or create it.

        Args:
            path: The file, in an existing folder.
            settings: Everything on which the scores depend, for JSON.
            restart: Discard an existing log.

        Raises:
            FacePoserError: If the file belongs to another study, is not a log, or cannot be read or written.
        """
        self.path = path
        self.scores: Scores = {}
        header = {"format": _FORMAT, "version": _VERSION, "sha256": _hash(settings), "settings": settings}
        try:
            lines = [] if restart or not paths.exists(path) else self._complete_lines()
            if lines:
                self._check(lines[0], header)
                for number, line in enumerate(lines[1:], start=2):
                    self._add_record(line, number)
            else:
                self._create(header)
        except OSError as error:
            raise self._file_error(error) from error

    def _complete_lines(self) -> list[bytes]:
        """Return the complete lines, and truncate the file after them."""
        data = read_bytes(self.path)
        length = data.rfind(b"\n") + 1
        if length < len(data):
            os.truncate(self.path, length)
        return data[:length].splitlines()

    def _create(self, header: Mapping[str, Any]) -> None:
        write_json(self.path, header, "trial log", indent=None)

    def _check(self, line: bytes, header: Mapping[str, Any]) -> None:
        try:
            existing = json.loads(line)
            same_format = (existing["format"], existing["version"]) == (_FORMAT, _VERSION)
            checksum = existing["sha256"]
            settings = dict(existing["settings"])
        except (ValueError, KeyError, TypeError):
            same_format, checksum, settings = False, "", {}
        if not same_format:
            raise FacePoserError(
                f"'{self.path}' is not a trial log; choose another folder, or start again with --restart."
            )
        if checksum != header["sha256"]:
            expected = header["settings"]
            different = [name for name in expected if settings.get(name) != json.loads(json.dumps(expected[name]))]
            raise FacePoserError(
                f"The trials in '{self.path}' belong to a study with other settings "
                f"({', '.join(different) or 'unknown'}); choose another folder, or start again with --restart."
            )

    def _add_record(self, line: bytes, number: int) -> None:
        try:
            record = json.loads(line)
            cell = Cell(record["constraint"], record["count"], record["noise_px"], record["region"])
            key = (record["method"], cell, record["seed"])
            scores = dict(zip(record["trials"], _scores_of(record), strict=True))
        except (ValueError, KeyError, TypeError) as error:
            raise FacePoserError(
                f"Line {number} of '{self.path}' is damaged; delete the line, or start again with --restart."
            ) from error
        self.scores.setdefault(key, {}).update(scores)

    def add(self, method: str, cell: Cell, seed: int, scores: Mapping[int, Score]) -> None:
        """Append the ``scores`` of ``method``, keyed by the number of the trial.

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
        data = (json_text(self.path, record, "trial log", indent=None) + "\n").encode()
        try:
            with self.path.open("ab", buffering=0) as file:
                file.write(data)
        except OSError as error:
            raise self._file_error(error) from error
        # Parsed from the record, so that a continued study has the same numbers to the last digit.
        self._add_record(data, 0)

    def _file_error(self, error: OSError) -> FacePoserError:
        return FacePoserError(f"The trial log '{self.path}' cannot be used ({error.strerror}); choose another folder.")


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
            by_region={name: (pair[0][i], pair[1][i]) for name, pair in record["by_region"].items()},
            **dict(zip(_COLUMNS, row, strict=True)),
        )
        for i, row in enumerate(rows)
    ]


def _rounded(values: Iterable[float]) -> list[float]:
    return [float(f"{value:.{_DIGITS}g}") for value in values]


def _hash(settings: Mapping[str, Any]) -> str:
    return hashlib.sha256(json.dumps(settings, sort_keys=True).encode()).hexdigest()
