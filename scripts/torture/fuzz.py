"""Mutated files for every reader: what is wrong must be refused in one sentence, in bounded time and memory.

    python scripts/torture/fuzz.py [--count N] [--seed S] [--reader NAME ...] [--json FILE] [--keep FOLDER]

Mutations change the structure of a file (values, keys, cells, words, members, chunks) or its bytes, and are determined
by the seed. They are read in child processes with limits. Counted are exceptions other than ``FacePoserError``, inputs
that take over 5 s of processor time or 1 GB, numbers that are not finite, and messages that are not one printable
sentence or have the wording of a library. Status 1 if there is any; --keep writes these files.
"""

import argparse
import json
import os
import re
import resource
import select
import shutil
import signal
import sys
import tempfile
import time
import traceback
import warnings
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from random import Random
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
if str(ROOT) not in sys.path:
    sys.path.insert(0, str(ROOT))

from faceposer.errors import FacePoserError, is_shown
from scripts.torture import mutations
from scripts.torture.fuzz_readers import READERS, finite, prepare
from scripts.torture.fuzz_seeds import make_seeds

SLOW_SECONDS, LARGE_BYTES = 5.0, 1 << 30
_HANG_SECONDS, _LIMIT_BYTES = 60.0, 6 << 30
_BATCH = 250
_LONGEST_MESSAGE = 1000
#: Wording of libraries that must not reach a person.
_INTERNAL = re.compile(
    r"unpack|codec|reshape|could not convert|invalid literal|object of type|NoneType|Traceback|unsupported operand|"
    r"not subscriptable|has no attribute|buffer is smaller|set_int_max|out of bounds|broadcast|dtype|<class|errno|"
    r"list index|string index|argument must be|Expected `|takes \d+ positional|bytes-like|__\w+__"
)


@dataclass
class Figures:
    """What happened to the files of a reader.

    Attributes:
        count: Number of files.
        refused: Number of those that were refused in a sentence.
        problems: Number of files by kind of problem.
        slowest: Longest processor time of a file, in seconds.
        largest: Largest growth of memory during a file, in bytes.
    """

    count: int = 0
    refused: int = 0
    problems: Counter[str] = field(default_factory=Counter)
    slowest: float = 0.0
    largest: int = 0

    def to_json(self) -> dict[str, Any]:
        """Return the figures for a report."""
        return {
            "files": self.count,
            "refused": self.refused,
            "problems": dict(self.problems),
            "slowest_seconds": round(self.slowest, 2),
            "largest_mb": round(self.largest / 2**20),
        }


def mutated(seeds: Sequence[Path], name: str, seed: int, index: int) -> tuple[bytes, str]:
    """Return mutation ``index`` of the ``seeds`` of a reader, and the suffix of its file."""
    rng = Random(f"{seed}:{name}:{index}")
    chosen = rng.choice(seeds)
    data = chosen.read_bytes()
    structure = [
        mutation
        for mutation in READERS[name].structure
        if (mutation is mutations.json_structure) == (chosen.suffix == ".json") or len(READERS[name].structure) == 1
    ]
    by_bytes = not structure or rng.random() < 0.3
    return (mutations.bytewise if by_bytes else rng.choice(structure))(data, rng), chosen.suffix


def read_file(name: str, path: Path) -> str:
    """Read the file ``path`` and return "accepted", "refused", or the problem."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return "accepted" if finite(READERS[name].read(path)) else "not finite"
    except FacePoserError as error:
        said = str(error)
        if not all(map(is_shown, said)) or len(said) > _LONGEST_MESSAGE or not said.endswith((".", "?")):
            return "message that is not one printable sentence"
        found = _INTERNAL.search(said)
        return f"wording: {found[0]}" if found else "refused"
    except MemoryError:
        return "MemoryError"
    except Exception as error:
        frames = [frame for frame in traceback.extract_tb(error.__traceback__) if "faceposer" in frame.filename]
        where = f"{Path(frames[-1].filename).name}:{frames[-1].lineno}" if frames else "?"
        return f"{type(error).__name__} at {where}: {str(error)[:80]!r}"


def _peak(reset: bool = False) -> int:
    """Return the largest memory of this process in bytes, on Linux since the last reset."""
    try:
        if reset:
            Path("/proc/self/clear_refs").write_text("5")
        return 1024 * int(re.search(r"VmHWM:\s*(\d+)", Path("/proc/self/status").read_text())[1])  # type: ignore[index]
    except OSError:
        return 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


def _child(name: str, seeds: Sequence[Path], seed: int, indices: range, folder: Path, pipe: int) -> None:
    """Read the files of ``indices`` and write a line about each to ``pipe``: before it is read, and after."""
    resource.setrlimit(resource.RLIMIT_AS, (_LIMIT_BYTES, _LIMIT_BYTES))
    with os.fdopen(pipe, "w") as out, (folder / "err").open("w") as err:
        os.dup2(err.fileno(), 1)
        os.dup2(err.fileno(), 2)
        for index in indices:
            content, suffix = mutated(seeds, name, seed, index)
            own = folder / f"{index}"
            shutil.rmtree(own, ignore_errors=True)
            own.mkdir()
            (own / f"file{suffix}").write_bytes(content)
            print(json.dumps([index]), file=out, flush=True)
            before, began = _peak(reset=True), time.process_time()
            said = read_file(name, own / f"file{suffix}")
            took = time.process_time() - began
            print(json.dumps([index, said, took, max(_peak() - before, 0)]), file=out, flush=True)
            shutil.rmtree(own, ignore_errors=True)


class Run:
    """Reads mutations of the seeds and gathers the figures."""

    def __init__(self, folder: Path, seed: int, keep: Path | None = None) -> None:
        """Make the seeds in ``folder``; files with problems are written to ``keep``."""
        self.seeds = make_seeds(folder / "seeds")
        self.figures: dict[str, Figures] = {}
        self._folder, self._seed, self._keep = folder, seed, keep
        prepare()

    def read(self, name: str, count: int) -> Figures:
        """Read ``count`` mutations with the reader ``name``."""
        figures = self.figures.setdefault(name, Figures())
        at = 0
        while at < count:
            at = self._batch(name, range(at, min(at + _BATCH, count)), figures)
        return figures

    def _batch(self, name: str, indices: range, figures: Figures) -> int:
        """Read ``indices`` in a child and return the index after the last one that it reached."""
        reading, writing = os.pipe()
        seeds = self.seeds[name]
        child = os.fork()
        if child == 0:
            status = 1
            try:
                os.close(reading)
                _child(name, seeds, self._seed, indices, self._folder, writing)
                status = 0
            finally:
                os._exit(status)
        os.close(writing)
        begun: int | None = None
        reached = indices.start
        with os.fdopen(reading) as lines:
            while True:
                ready, _, _ = select.select([lines], [], [], _HANG_SECONDS)
                line = lines.readline() if ready else ""
                if not line:
                    if not ready:
                        os.kill(child, signal.SIGKILL)
                    break
                entry = json.loads(line)
                begun = entry[0] if len(entry) == 1 else None
                if len(entry) > 1:
                    self._take(name, figures, *entry)
                    reached = entry[0] + 1
        _, status = os.waitpid(child, 0)
        if begun is not None:
            self._take(name, figures, begun, f"ended: {'hang' if not ready else f'status {status}'}", 0.0, 0)
            return begun + 1
        if status and reached < indices.stop:
            raise RuntimeError(f"{name}: the child ended with {status}: {(self._folder / 'err').read_text()[-2000:]}")
        return reached

    def _take(self, name: str, figures: Figures, index: int, said: str, took: float, grown: int) -> None:
        figures.count += 1
        figures.slowest, figures.largest = max(figures.slowest, took), max(figures.largest, grown)
        problems = [] if said in ("accepted", "refused") else [said]
        problems += [f"over {SLOW_SECONDS:g} s"] if took > SLOW_SECONDS else []
        problems += [f"over {LARGE_BYTES >> 30} GB"] if grown > LARGE_BYTES else []
        figures.refused += said == "refused"
        figures.problems.update(problems)
        if problems and self._keep is not None and figures.problems[problems[0]] <= 3:
            content, suffix = mutated(self.seeds[name], name, self._seed, index)
            self._keep.mkdir(parents=True, exist_ok=True)
            (self._keep / f"{name.replace(' ', '-')}-{self._seed}-{index}{suffix}").write_bytes(content)


def main(arguments: Sequence[str] | None = None) -> int:
    """Read mutated files as the ``arguments`` ask for and return the exit status."""
    parser = argparse.ArgumentParser(description="Read mutated files with every reader.")
    parser.add_argument("--count", type=int, default=100_000, help="number of files in all")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--reader", nargs="+", choices=READERS, default=list(READERS), metavar="NAME")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the figures")
    parser.add_argument("--keep", type=Path, metavar="FOLDER", help="write the files that had problems")
    options = parser.parse_args(arguments)
    whole = sum(READERS[name].share for name in options.reader)
    with tempfile.TemporaryDirectory() as folder:
        run = Run(Path(folder), options.seed, options.keep)
        for name in options.reader:
            began = time.perf_counter()
            figures = run.read(name, max(round(options.count * READERS[name].share / whole), 1))
            print(f"{name}: {figures.to_json()} in {time.perf_counter() - began:.0f} s", flush=True)
    report = {"seed": options.seed, "readers": {name: figures.to_json() for name, figures in run.figures.items()}}
    if options.json is not None:
        options.json.write_text(json.dumps(report, indent=1) + "\n")
    wrong = sum(sum(figures.problems.values()) for figures in run.figures.values())
    print(f"{sum(figures.count for figures in run.figures.values())} files, {wrong} problems")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
