"""Commands and the window, killed at random moments: what is on the disk, and what the next run finds.

    python scripts/torture/kill.py [--commands N] [--windows N] [--seed S] [--json FILE]

After each kill, an output must be the old file or the new one, whole, and the next run must clear what was left beside
it. Of a killed window, the next run must recover all gestures but the last one. Status 1 if anything is wrong.
"""

import argparse
import hashlib
import json
import os
import re
import signal
import sys
import tempfile
import time
from collections.abc import Callable
from mmap import mmap
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
if str(ROOT) not in sys.path:
    sys.path.insert(0, str(ROOT))

import numpy as np

from faceposer.cli import main
from faceposer.files.temporary import is_temporary, remove_left
from faceposer.gui.app import App
from faceposer.gui.settings import Settings, load_settings, save_settings
from faceposer.gui.testing.scripted_user import Robot
from faceposer.session.autosave import autosave_dir, find_orphans
from faceposer.session.document import read_document, write_document
from faceposer.session.on_disk import OpenFile, open_files_folder
from scripts.torture.forked import run, start, wait
from scripts.torture.inputs import COMMANDS, Command, make_inputs, preload, session_document

_OUTPUT, _OLD = "output", b"what was there before"
# The time that a solve took, in its report.
_SECONDS = re.compile(rb'"seconds": [0-9.e-]+')
_SAVED_EVERY = 3
_GESTURES = 40


class Killed:
    """Figures of the kills, and what was wrong.

    Attributes:
        wrong: A sentence for each problem.
        old: Number of killed commands whose output was the one before, or none.
        new: Number of those whose output was new.
        left: Number of temporary files that were left, and cleared by the next run.
        lost: Largest number of gestures that a killed window lost.
    """

    def __init__(self) -> None:
        self.wrong: list[str] = []
        self.old = self.new = self.left = self.lost = 0


def kill_command(
    command: Command, inputs: Path, folder: Path, delay: float, whole: dict[str, str], result: Killed
) -> None:
    """Kill ``command`` after ``delay`` seconds, and check its output, which is ``whole`` at the end of a run."""
    output = folder / f"{_OUTPUT}{command.suffix}"
    words = command.called(inputs, output)
    if command.suffix:
        output.write_bytes(_OLD)
    before = _content(output)
    child = start(lambda: main(words))
    time.sleep(delay)
    os.kill(child, signal.SIGKILL)
    wait(child, 10.0)
    after = _content(output)
    result.old += after == before
    result.new += after != before
    if after not in (before, whole):
        result.wrong.append(f"{command.name}: the output, {after}, is neither the old one nor {whole}")
    left = [path for path in folder.iterdir() if is_temporary(path.name)]
    result.left += len(left)
    if [path for path in folder.iterdir() if path.name.startswith(".") and path not in left]:
        result.wrong.append(f"{command.name}: hidden files of another name are left")
    if command.suffix == "" and output.is_dir():
        for file in output.iterdir():
            file.unlink()
        output.rmdir()


def _content(path: Path) -> dict[str, str]:
    """Return digests of the file ``path``, or of the files in the folder ``path``, without times of solves."""
    files = sorted(path.iterdir()) if path.is_dir() else [path] if path.exists() else []
    return {file.name: hashlib.sha256(_SECONDS.sub(b"", file.read_bytes())).hexdigest()[:16] for file in files}


def kill_window(folder: Path, moment: float, result: Killed) -> None:
    """Kill a window that is posed and saved, after ``moment`` seconds of work, and recover its work."""
    path = folder / "session.json"
    journals = autosave_dir()
    shared = mmap(-1, 4096)
    child = start(lambda: _pose(path, shared))
    begun = time.monotonic()
    while shared[0] == 0 and time.monotonic() - begun < 60.0:
        time.sleep(0.005)
    time.sleep(moment)
    done = shared[1]
    os.kill(child, signal.SIGKILL)
    wait(child, 10.0)
    found = find_orphans(journals)
    if found.damaged:
        result.wrong.append(f"damaged journals: {found.damaged}")
    counts = [len(orphan.document.constraints) for orphan in found.orphans]
    for orphan in found.orphans:
        orphan.remove()
    try:
        counts.append(len(read_document(path).constraints))
        load_settings()
        json.loads((journals.parent / "window.json").read_text())
    except Exception as error:  # any error is a finding
        result.wrong.append(f"window: {type(error).__name__}: {error}")
    lost = done - (max(counts) - 1)
    result.lost = max(result.lost, lost)
    if lost > 1:
        result.wrong.append(f"window: {done} gestures were made and {max(counts) - 1} recovered")
    # The next window clears the locks, the next journal and the next save what was half written.
    OpenFile(open_files_folder()).release()
    for place in (folder, journals, journals.parent):
        remove_left(place)
    left = [p.name for place in (folder, journals, open_files_folder()) if place.is_dir() for p in place.iterdir()]
    if left != [path.name]:
        result.wrong.append(f"window: left behind: {left}")


def _pose(path: Path, shared: mmap) -> None:
    """Pose the face in a hidden window, counting the finished gestures in ``shared``."""
    app = App(str(path), hidden=True, threaded=False, settings=None, journal=True)
    app.dialogs.waiting.clear()
    app.face_image = lambda _: app.scene.draw(app.viewport.view.camera((32, 32)), "clay", False, 0)  # type: ignore[method-assign]
    robot = Robot(app)
    rng = np.random.default_rng(7)
    left, top, right, bottom = app.widget_rects["view"]
    shared[0] = 1
    for i in range(_GESTURES):
        before = len(app.session.document.constraints)
        while len(app.session.document.constraints) == before:
            x, y = rng.uniform((left, top), (right, bottom)).tolist()
            # A gesture takes a third of a second, as a quick hand does.
            robot.drag((x, y), (x + 6.0, y + 5.0), steps=18)
        shared[1] = i + 1
        if i % _SAVED_EVERY == 0:
            robot.key("Ctrl+S")
    time.sleep(60.0)


def torture(root: Path, commands: int, windows: int, seed: int) -> dict[str, object]:
    """Kill ``commands`` commands and ``windows`` windows in ``root``; return the figures."""
    begun = time.monotonic()
    rng = np.random.default_rng(seed)
    inputs, result = root / "inputs", Killed()
    model = make_inputs(inputs)
    chosen = COMMANDS if commands >= len(COMMANDS) else COMMANDS[:: len(COMMANDS) // max(commands, 1)][:commands]
    preload(inputs, chosen if commands else ())
    for command in chosen if commands else ():
        folder = root / command.name
        folder.mkdir()
        # Of the same name as the output of the killed commands, since characters are named by their files.
        # In folders of the same depth, since sessions refer to photos from their own.
        references = [root / f"{command.name}-{name}" / f"{_OUTPUT}{command.suffix}" for name in ("first", "again")]
        for reference in references:
            reference.parent.mkdir()
        seconds = min(run(_called(command.called(inputs, reference))).seconds for reference in references)
        whole = _content(references[0])
        if not whole or whole != _content(references[1]):
            result.wrong.append(f"{command.name}: two runs wrote {whole} and {_content(references[1])}")
        for _ in range(-(-commands // len(chosen))):
            kill_command(command, inputs, folder, float(rng.uniform(0.0, 1.2)) * seconds, whole, result)
        ended = run(_called(command.called(inputs, folder / f"final{command.suffix}")))
        left = [path.name for path in folder.iterdir() if path.name.startswith(".")]
        if ended.status or left:
            result.wrong.append(f"{command.name}: the next run ended with {ended.status} and left {left}")
    for i in range(windows):
        folder = root / f"window{i}"
        folder.mkdir()
        os.environ["XDG_STATE_HOME"] = str(folder / "state")
        work = folder / "work"
        work.mkdir()
        save_settings(Settings(window_size=(640, 480), folder=str(work)))
        write_document(work / "session.json", session_document(model).with_version_data(model))
        kill_window(work, float(rng.uniform(0.0, 4.0)), result)
    killed = (-(-commands // len(chosen)) * len(chosen) if commands else 0) + windows
    return {
        "kills": killed,
        "windows": windows,
        "seed": seed,
        "old": result.old,
        "new": result.new,
        "temporary_files_cleared": result.left,
        "most_gestures_lost": result.lost,
        "wrong": result.wrong,
        "seconds": round(time.monotonic() - begun, 1),
    }


def _called(words: list[str]) -> Callable[[], None]:
    return lambda: main(words)


def run_script() -> int:
    """Run the script and return its exit status."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--commands", type=int, default=416, help="number of killed commands (default: %(default)s)")
    parser.add_argument("--windows", type=int, default=100, help="number of killed windows (default: %(default)s)")
    parser.add_argument("--seed", type=int, default=0, help="seed of the moments (default: %(default)s)")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the figures")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        figures = torture(Path(folder), options.commands, options.windows, options.seed)
    if options.json is not None:
        options.json.write_text(json.dumps(figures, indent=1) + "\n")
    wrong = figures["wrong"]
    assert isinstance(wrong, list)
    print("\n".join(wrong[:40]))
    print(json.dumps({**figures, "wrong": len(wrong)}))
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(run_script())
