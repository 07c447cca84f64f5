"""A study: its settings, its trials, and the files in its folder."""

import contextlib
import hashlib
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
from faceposer.evaluation.running import run_plan
from faceposer.evaluation.setting import SIZE
from faceposer.evaluation.tables import error_tables, other_tables, time_table
from faceposer.evaluation.takes import Source
from faceposer.evaluation.trial_log import Scores, TrialLog
from faceposer.files.atomic import write_text
from faceposer.files.writing import write_json
from faceposer.model.character import Character
from faceposer.progress import Progress

#: File names of a study.
LOG, RESULTS, TABLE, TABLES = "trials.jsonl", "results.json", "results.csv", "tables.md"
#: Format and version of ``results.json``.
FORMAT, VERSION = "faceposer.evaluation", 1
# Packages and modules on which scores depend; reporting may change without new trials.
_CODE = ("geometry", "model", "solve", "training", "evaluation/methods")
_CODE_FILES = ("feature_lines", "measures", "setting", "takes", "trials")
_PACKAGES = ("numpy", "scipy", "scikit-learn", "matplotlib", "eos-py", "libigl")


@dataclass(frozen=True)
class Outcome:
    """Results of a study.

    Attributes:
        rows: Rows of the table.
        left_out: Methods that cannot be run on this machine, each with the reason as a sentence.
        scores: Scores of all trials.
    """

    rows: list[Row]
    left_out: dict[str, str]
    scores: Scores


@dataclass(frozen=True)
class Study:
    """Specification of a study.

    Attributes:
        source: Training and test data.
        plan: Methods and cells.
        folder: Folder of its files.
        command: Command line that repeats it.
    """

    source: Source
    plan: Plan
    folder: Path
    command: str

    def settings(self, character: Character) -> dict[str, Any]:
        """Return everything except the cell on which scores depend, for JSON; it identifies the study."""
        return {
            **self.source.identity(character),
            "picture": list(SIZE),
            "parameters": {name: dict(kind.parameters) for name, kind in METHODS.items()},
            "program_sha256": program_checksum(),
        }

    def run(self, character: Character, jobs: int, progress: Progress, restart: bool = False) -> Outcome:
        """Run the remaining trials and write the results.

        Args:
            character: The face.
            jobs: Number of processes.
            progress: Progress; a cancelled study keeps its finished trials.
            restart: Discard the trials in the folder.

        Raises:
            FacePoserError: If the folder has trials of another study, a file cannot be used, or a process was killed.
        """
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise FacePoserError(
                f"The folder '{self.folder}' cannot be created ({error.strerror}); choose another with --output."
            ) from error
        settings = self.settings(character)
        log = TrialLog(self.folder / LOG, settings, restart)
        skipped = run_plan(self.source, self.plan, log, jobs, progress)
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
        write_json(self.folder / RESULTS, about, "result", ascii_only=False)
        write_text(self.folder / TABLE, csv_of(rows), "table")
        write_text(self.folder / TABLES, self._tables(rows), "table")
        return Outcome(rows, skipped, log.scores)

    def _tables(self, rows: Sequence[Row]) -> str:
        head = f"# {self.source.character}\n\n    {self.command}\n\n"
        return head + "\n".join(text for text in (error_tables(rows), time_table(rows), other_tables(rows)) if text)


def program_checksum() -> str:
    """Return a checksum of the source files on which scores depend."""
    root = Path(faceposer.__file__).parent
    paths = [path for part in _CODE for path in sorted((root / part).rglob("*.py"))]
    paths += [root / "evaluation" / f"{name}.py" for name in _CODE_FILES]
    digest = hashlib.sha256()
    for path in paths:
        digest.update(path.relative_to(root).as_posix().encode() + b"\0")
        # Checkouts may differ in line endings.
        digest.update(path.read_bytes().replace(b"\r\n", b"\n") + b"\0")
    return digest.hexdigest()


def machine(jobs: int) -> dict[str, Any]:
    """Return the properties of the machine on which times depend, and the versions of all packages, for JSON."""
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
