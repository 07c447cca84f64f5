"""Commands and the window on a system that refuses: permissions, full disks, special files, locales, no home folder.

    python scripts/torture/hostile_system.py [--short] [--json FILE]

A command must end with status 0 and a file that can be read, or with status 2 and one sentence; the old file stays
whole and nothing else is left. The window must report what it cannot do, and go on. Status 1 if anything is wrong.
"""

import argparse
import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
if str(ROOT) not in sys.path:
    sys.path.insert(0, str(ROOT))

from faceposer.cli import main
from scripts.torture import window_cases
from scripts.torture.forked import Condition, Ended, run
from scripts.torture.inputs import COMMANDS, Command, make_inputs, preload

_OLD = b"what was there before"
_SLOW = 60.0


@dataclass(frozen=True)
class Case:
    """A command under a condition.

    Attributes:
        name: Name for reports.
        command: The command.
        output: The path that it writes.
        condition: What the system refuses.
        fails: True if it has to fail, False if it must not, None if both are right.
        old: True if a file is at the output before.
    """

    name: str
    command: Command
    output: Path
    condition: Condition = field(default_factory=Condition)
    fails: bool | None = True
    old: bool = False


def _only_notes(lines: list[str]) -> bool:
    """Return True if all ``lines`` are notes on the input, which begin with its path."""
    return all(line.startswith("/") and ".csv: " in line for line in lines)


def problems_of(case: Case, ended: Ended, before: set[str]) -> list[str]:
    """Return what was wrong with the end of ``case``; ``before`` is what lay in the folder of its output."""
    wrong = []
    lines = [line for line in ended.err.splitlines() if line.strip()]
    if "Traceback" in ended.err or ended.status not in (0, 2):
        wrong.append(f"status {ended.status}: {ended.err.strip()[-300:]}")
    elif ended.status and (not lines or not all(line.endswith(".") for line in lines) or not _only_notes(lines[:-1])):
        wrong.append(f"not one sentence: {ended.err.strip()[-300:]}")
    if case.fails is not None and case.fails != (ended.status != 0):
        wrong.append(f"status {ended.status} instead of {'2' if case.fails else '0'}: {ended.err.strip()[-200:]}")
    if ended.seconds > _SLOW:
        wrong.append(f"{ended.seconds:.0f} s")
    if ended.status and case.old and case.output.read_bytes() != _OLD:
        wrong.append("the old file is not whole")
    if case.name.startswith("link") and not case.output.is_symlink():
        wrong.append("the link has been replaced")
    after = _names(case.output.parent)
    left = {name for name in after - before if ended.status != 0 or name.startswith(".")}
    if case.condition.output:
        # Only what is printed is lost.
        left = {name for name in left if name.startswith(".")}
    if left - {case.output.name} or (ended.status and left):
        wrong.append(f"left behind: {sorted(left)}")
    return wrong


def _names(folder: Path) -> set[str]:
    try:
        return {os.fsencode(path.name).decode("utf-8", "backslashreplace") for path in folder.iterdir()}
    except OSError:
        return set()


def command_cases(root: Path, commands: tuple[Command, ...], disk: Path | None) -> Iterator[Case]:
    """Yield the cases of ``commands`` with outputs in ``root``; ``disk`` is a folder on a small disk, if any."""
    for command in commands:
        place = root / command.name
        place.mkdir()
        end = command.suffix
        closed, locked, open_ = place / "read-only", place / "locked", place / "open"
        for folder in (closed, locked, open_):
            folder.mkdir()
        if end:
            (closed / f"old{end}").write_bytes(_OLD)
        closed.chmod(0o500)
        locked.chmod(0o000)
        (place / "file").write_bytes(_OLD)
        (open_ / f"folder{end}").mkdir()
        (open_ / f"folder{end}" / "mine").write_bytes(_OLD)
        (open_ / f"circle{end}").symlink_to(f"circle{end}")
        os.mkfifo(open_ / f"pipe{end}")
        (open_ / f"device{end}").symlink_to("/dev/full")
        links = {"nowhere": f"gone{end}", "to-folder": f"folder{end}", "to-closed": f"../read-only/old{end}"}
        for name, target in {**links, "to-file": f"../behind{end}"}.items():
            (open_ / f"{name}{end}").symlink_to(target)
        if end:
            (place / f"behind{end}").write_bytes(_OLD)
        else:
            (place / "behind").mkdir()
        yield Case("read-only folder", command, closed / f"new{end}")
        if end:
            yield Case("read-only folder, old file", command, closed / f"old{end}", old=True)
        yield Case("locked folder", command, locked / f"new{end}")
        yield Case("missing folder", command, place / "nowhere" / f"new{end}")
        yield Case("file as folder", command, place / "file" / f"new{end}")
        yield Case("too long", command, open_ / ("n" * 300 + end))
        yield Case("too long by little", command, open_ / ("ü" * 126 + end + "n" * (256 - 252)))
        yield Case("as long as possible", command, open_ / ("n" * (255 - len(end)) + end), fails=None)
        yield Case("path too long", command, open_ / "n" / Path(*["n" * 200] * 25) / f"new{end}")
        yield Case("a folder is there", command, open_ / f"folder{end}")
        yield Case("circle of links", command, open_ / f"circle{end}")
        yield Case("link to nothing", command, open_ / f"nowhere{end}")
        yield Case("link to a folder", command, open_ / f"to-folder{end}")
        if end:
            yield Case("link to a file in a read-only folder", command, open_ / f"to-closed{end}", old=True)
        yield Case("link to a file or an empty folder", command, open_ / f"to-file{end}", fails=False)
        yield Case("a pipe is there", command, open_ / f"pipe{end}")
        yield Case("a device is there", command, open_ / f"device{end}")
        for name in ("caf\udce9", "line\nbreak", "a##b%s%n", "😀 ü", "-dash", "'\"", "a\\b", "trailing "):
            yield Case(f"name {name!a}", command, open_ / f"{name}{end}", fails=None)
        for size in (0, 100, 4096, 65536):
            output = open_ / f"full{end}"
            yield Case(f"files of at most {size} bytes", command, output, Condition(largest_file=size), None, bool(end))
        if disk is not None:
            yield Case("full disk", command, disk / f"full{end}", fails=None, old=bool(end))
        for name, condition in _users(root):
            yield Case(name, command, open_ / f"ok{end}", condition, fails=False)
        gone = place / "gone"
        yield Case("no working directory", command, open_ / f"gone{end}", Condition(prepare=_leave(gone)), fails=None)
        yield Case("output to a full device", command, open_ / f"full2{end}", Condition(output="/dev/full"), fails=None)


def _leave(folder: Path) -> Callable[[], None]:
    """Return a function that changes to ``folder`` and removes it."""

    def leave() -> None:
        folder.mkdir()
        os.chdir(folder)
        folder.rmdir()

    return leave


def _users(root: Path) -> Iterator[tuple[str, Condition]]:
    """Yield conditions under which every command succeeds: homes, locales and encodings of the terminal."""
    file = root / "home-file"
    file.touch()
    nothing = dict.fromkeys(("XDG_CONFIG_HOME", "XDG_DATA_HOME", "XDG_STATE_HOME", "XDG_CACHE_HOME"))
    yield "home is a file", Condition(environment={**nothing, "HOME": str(file)})
    yield "home is missing", Condition(environment={**nothing, "HOME": "/no/such/home"})
    yield "no home", Condition(environment={**nothing, "HOME": None})
    yield "home is a device", Condition(environment={**nothing, "HOME": "/dev/null"})
    yield "home is relative", Condition(environment={**nothing, "HOME": "here"})
    for encoding in ("ascii", "cp1252", "latin-1", "cp437", "utf-16"):
        yield f"terminal in {encoding}", Condition(encoding=encoding)
    yield "no folder for temporary files", Condition(environment={"TMPDIR": "/no/such/folder"}, prepare=_forget_tmp)


def _forget_tmp() -> None:
    tempfile.tempdir = None


@contextmanager
def small_disk(root: Path, kilobytes: int) -> Iterator[Path | None]:
    """Yield a folder on a disk of ``kilobytes``, or None where none can be mounted."""
    folder = root / "disk"
    folder.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", f"size={kilobytes}k,mode=0700", "tmpfs", str(folder)]
    if os.geteuid() != 0 or subprocess.run(mount, check=False, capture_output=True).returncode:
        yield None
        return
    try:
        yield folder
    finally:
        subprocess.run(["umount", str(folder)], check=False)


def check_command(case: Case, inputs: Path) -> list[str]:
    """Run ``case`` and return what was wrong."""
    if case.old and not case.output.exists():
        case.output.write_bytes(_OLD)
    before = _names(case.output.parent)
    words = case.command.called(inputs, case.output)
    ended = run(lambda: main(words), case.condition)
    wrong = problems_of(case, ended, before)
    if case.output.parent.name in ("open", "disk"):
        for left in case.output.parent.iterdir():
            if left.name not in before or (left == case.output and case.old):
                shutil.rmtree(left) if left.is_dir() and not left.is_symlink() else left.unlink()
    return wrong


def torture(root: Path, short: bool) -> dict[str, object]:
    """Run all cases, or with ``short`` those of one command and most windows; return the figures."""
    begun = time.monotonic()
    inputs, places = root / "inputs", root / "places"
    make_inputs(inputs)
    places.mkdir()
    chosen = tuple(c for c in COMMANDS if not short or c.name == "json")
    preload(inputs, chosen)
    wrong: list[str] = []
    count = 0
    with small_disk(root, 48) as disk:
        for case in command_cases(places, chosen, disk):
            count += 1
            found = check_command(case, inputs)
            wrong += _told(f"{case.command.name}, {case.name}", found)
    windows = window_cases.cases(root / "windows", short)
    for name, work, condition in windows:
        count += 1
        ended = run(work, condition, patience=600.0)
        if ended.status:
            wrong += _told(f"window, {name}", [f"status {ended.status}: {ended.err.strip()[-1500:]}"])
    for folder in places.rglob("*"):
        if folder.is_dir() and not folder.is_symlink():
            folder.chmod(0o700)
    return {
        "commands": [command.name for command in chosen],
        "cases": count,
        "full_disk": disk is not None,
        "wrong": wrong,
        "seconds": round(time.monotonic() - begun, 1),
    }


def _told(name: str, problems: list[str]) -> list[str]:
    """Print and return ``problems`` of the case ``name``."""
    lines = [f"{name}: {problem}" for problem in problems]
    for line in lines:
        print(ascii(line)[1:-1], flush=True)
    return lines


def run_script() -> int:
    """Run the script and return its exit status."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--short", action="store_true", help="one command and most windows, as in the tests")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the figures")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        figures = torture(Path(folder), options.short)
    if options.json is not None:
        options.json.write_text(json.dumps(figures, indent=1, ensure_ascii=True) + "\n")
    wrong = figures["wrong"]
    assert isinstance(wrong, list)
    print(f"{figures['cases']} cases, {len(wrong)} wrong, {figures['seconds']} s")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(run_script())
