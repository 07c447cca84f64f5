"""The program as a person runs it: a window on a display, driven by another program's pointer and keys."""

import os
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from faceposer.geometry.mesh_io import read_mesh
from faceposer.gui.app import App
from faceposer.gui.settings import Settings
from faceposer.gui.testing.few_pixels import draw_few_pixels
from faceposer.gui.testing.scripted_user import Robot
from faceposer.session.opening import open_session

PATIENCE = 60.0

pytestmark = pytest.mark.skipif(
    not (shutil.which("Xvfb") and shutil.which("xdotool")), reason="needs Xvfb and xdotool, which scripts/test installs"
)


@pytest.fixture
def display(tmp_path: Path) -> Iterator[str]:
    """A virtual display of its own."""
    read, write = os.pipe()
    command = ["Xvfb", "-displayfd", str(write), "-screen", "0", "1400x900x24", "-nolisten", "tcp"]
    with (tmp_path / "xvfb.log").open("wb") as log:
        server = subprocess.Popen(command, pass_fds=[write], stdout=log, stderr=log)
    os.close(write)
    with os.fdopen(read) as answer:
        number = answer.readline().strip()
    try:
        assert number, (tmp_path / "xvfb.log").read_text()
        yield f":{number}"
    finally:
        server.terminate()
        server.wait()


class Person:
    """Moves the pointer and presses keys on a display."""

    def __init__(self, display: str) -> None:
        self.environment = os.environ | {"DISPLAY": display}

    def do(self, *words: object) -> str:
        command = ["xdotool", *map(str, words)]
        return subprocess.run(command, env=self.environment, check=True, capture_output=True, text=True).stdout

    def drag(self, begin: tuple[float, float], end: tuple[float, float], button: int = 1) -> None:
        self.do("mousemove", round(begin[0]), round(begin[1]))
        self.do("mousedown", button)
        for share in np.linspace(0.0, 1.0, 9)[1:]:
            x, y = (begin[i] + share * (end[i] - begin[i]) for i in range(2))
            self.do("mousemove", round(x), round(y), "sleep", 0.05)
        self.do("mouseup", button)


def until(condition: Callable[[], object], what: str) -> None:
    deadline = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < deadline, f"waited in vain for {what}"
        time.sleep(0.05)


def save(person: Person, key: str, path: Path) -> None:
    """Save by the dialog that ``key`` opens; on a slow machine it takes its time, and a person tries again."""
    for _ in range(4):
        person.do("key", key, "sleep", 4.0, "key", "ctrl+a", "sleep", 1.0, "type", "--delay", 50, str(path))
        person.do("sleep", 3.0, "key", "Return")
        deadline = time.monotonic() + PATIENCE / 5.0
        while time.monotonic() < deadline and not path.is_file():
            time.sleep(0.05)
        if path.is_file():
            person.do("sleep", 2.0)
            return
        person.do("key", "Escape", "sleep", 1.0, "key", "Escape", "sleep", 1.0)
    raise AssertionError(f"{path.name} was not saved")


@pytest.mark.slow
@pytest.mark.gl
def test_pose_and_save_by_pointer_and_keys(display: str, tmp_path: Path) -> None:
    app = App("man", hidden=True, threaded=False, settings=Settings())
    robot = Robot(draw_few_pixels(app))
    places = {name: robot.at(name) for name in ("8.3", "4.1")}
    app.close()
    person = Person(display)
    environment = person.environment | {"XDG_STATE_HOME": str(tmp_path), "FACEPOSER_OWN_DIALOGS": "1"}
    environment.pop("WAYLAND_DISPLAY", None)
    program = subprocess.Popen([sys.executable, "-m", "faceposer"], env=environment, cwd=tmp_path)
    try:
        window = person.do("search", "--sync", "--onlyvisible", "--class", "faceposer").split()[0]
        person.do("windowmove", "--sync", window, 0, 0, "windowfocus", "--sync", window, "sleep", 0.5)
        (x, y), (brow_x, brow_y) = places["8.3"], places["4.1"]
        person.drag((x, y), (x + 14, y - 16))
        person.drag((brow_x, brow_y), (brow_x + 1, brow_y - 10))
        person.drag((60, 600), (130, 610))
        person.do("key", "ctrl+z", "sleep", 0.2, "key", "ctrl+shift+z", "sleep", 0.2)
        saved = {"ctrl+e": tmp_path / "pose.obj", "ctrl+s": tmp_path / "pose.json"}
        for key, path in saved.items():
            save(person, key, path)
        until(lambda: person.do("key", "ctrl+q", "sleep", 0.5) or program.poll() is not None, "the program to end")
    finally:
        program.kill()
        program.wait()
    assert program.returncode == 0
    session = open_session(str(saved["ctrl+s"]))
    assert len(session.document.constraints) == 2
    solved = session.model.surface(session.coefficients)
    height = float(np.ptp(session.model.character.vertices[:, 1]))
    assert np.abs(read_mesh(saved["ctrl+e"]).vertices - solved).max() < 1e-5 * height
    names = session.model.character.shape_names
    weights = dict(zip(names, session.model.weights_of(session.coefficients), strict=True))
    assert weights["mouthSmileLeft"] > 0.2
    assert max(weights["browInnerUpLeft"], weights["browInnerUpRight"]) > 0.2
