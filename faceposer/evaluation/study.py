"""A whole study: its settings, its trials, and the files that it leaves in its folder."""

import contextlib
import hashlib
import json
import os
import platform
import re
from collections.abc import Sequence
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path
from typing import Any

import faceposer
from faceposer.errors import FacePoserError
from faceposer.evaluation.methods.registry import METHODS
from faceposer.evaluation.plan import Plan
from faceposer.evaluation.rows import Row, csv_of, rows_of
from faceposer.evaluation.running import Show, run_plan
from faceposer.evaluation.setting import SIZE
from faceposer.evaluation.tables import error_tables, other_tables, time_table
from faceposer.evaluation.takes import Source
from faceposer.evaluation.trial_log import Scores, TrialLog
from faceposer.files.atomic import write_text
from faceposer.model.character import Character

#: Files of a study.
LOG, RESULTS, TABLE, TABLES = "trials.jsonl", "results.json", "results.csv", "tables.md"
#: What ``results.json`` says that it is.
FORMAT, VERSION = "faceposer.evaluation", 1
# What scores depend on of the program itself; how they are shown may change without new trials.
_CODE = ("geometry", "model", "solve", "training", "evaluation/methods")
_CODE_FILES = ("feature_lines", "measures", "setting", "takes", "trials")
_PACKAGES = ("numpy", "scipy", "scikit-learn", "matplotlib", "eos-py", "libigl")


@dataclass(frozen=True)
class Outcome:
    """What came of a study.

    Attributes:
        rows: Of the table.
        left_out: Methods that cannot be run here, each with a sentence that says why.
        scores: Of all trials.
    """

    rows: list[Row]
    left_out: dict[str, str]
    scores: Scores


@dataclass(frozen=True)
class Study:
    """What is done, and where.

    Attributes:
        source: What is learned from and tested on.
        plan: The cells.
        folder: Where its files are.
        command: The words that repeat it.
    """

    source: Source
    plan: Plan
    folder: Path
    command: str

    def settings(self, character: Character) -> dict[str, Any]:
        """Return all that scores depend on but the cell, for JSON: with other settings they are another study's."""
        return {
            **self.source.identity(character),
            "picture": list(SIZE),
            "parameters": {name: dict(kind.parameters) for name, kind in METHODS.items()},
            "program_sha256": program_checksum(),
        }

    def run(self, character: Character, jobs: int, show: Show, restart: bool = False) -> Outcome:
        """Do what is left to do, and write what came of it.

        Raises:
            FacePoserError: If the folder has another study's trials, a file cannot be used, or a process was ended.
        """
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise FacePoserError(
                f"The folder '{self.folder}' cannot be made ({error.strerror}); choose another with --output."
            ) from error
        settings = self.settings(character)
        log = TrialLog(self.folder / LOG, settings, restart)
        skipped = run_plan(self.source, self.plan, log, jobs, show)
        rows = rows_of(log.scores, self.plan)
        about = {
            "format": FORMAT,
            "version": VERSION,
            "command": self.command,
            "machine": machine(jobs),
            "settings": settings,
            "left_out": skipped,
            "rows": rows,
        }
        write_text(self.folder / RESULTS, json.dumps(about, indent=1, ensure_ascii=False) + "\n", "result")
        write_text(self.folder / TABLE, csv_of(rows), "table")
        write_text(self.folder / TABLES, self._tables(rows), "table")
        return Outcome(rows, skipped, log.scores)

    def _tables(self, rows: Sequence[Row]) -> str:
        head = f"# {self.source.character}\n\n    {self.command}\n\n"
        return head + "\n".join(text for text in (error_tables(rows), time_table(rows), other_tables(rows)) if text)


def program_checksum() -> str:
    """Return a checksum of the sources that scores depend on."""
    root = Path(faceposer.__file__).parent
    paths = [path for part in _CODE for path in sorted((root / part).rglob("*.py"))]
    paths += [root / "evaluation" / f"{name}.py" for name in _CODE_FILES]
    digest = hashlib.sha256()
    for path in paths:
        digest.update(path.relative_to(root).as_posix().encode() + b"\0")
        # Checkouts may differ in how lines end.
        digest.update(path.read_bytes().replace(b"\r\n", b"\n") + b"\0")
    return digest.hexdigest()


def machine(jobs: int) -> dict[str, Any]:
    """Return what times depend on, and the versions of all that takes part, for JSON."""
    model = ""
    with contextlib.suppress(OSError):
        found = re.search(r"model name\s*:\s*(.+)", Path("/proc/cpuinfo").read_text(encoding="utf-8"))
        model = found.group(1) if found else ""
    versions = {"python": platform.python_version()}
    for name in ("faceposer", *_PACKAGES):
        with contextlib.suppress(metadata.PackageNotFoundError):
            versions[name] = metadata.version(name)
    return {
        "processor": model or platform.processor(),
        "cores": os.cpu_count(),
        "processes": jobs,
        "threads_each": int(os.environ.get("OPENBLAS_NUM_THREADS", "0")) or None,
        "system": platform.system(),
        "versions": versions,
    }
