"""Work survives a kill, and nothing is dropped without asking: through the real window, which nobody sees."""

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from faceposer.session.autosave import autosave_dir
from faceposer.viewer.app import App
from faceposer.viewer.robot import Robot
from faceposer.viewer.settings import Settings

KILLED = """
import os, signal, sys
from faceposer.viewer.app import App
from faceposer.viewer.robot import Robot
from faceposer.viewer.settings import Settings

app = App("man", hidden=True, threaded=False, settings=Settings(window_size=(700, 520)), journal=True)
robot = Robot(app)
for feature, dx, dy in (("8.3", 10, -12), ("4.3", 0, -8)):
    x, y = robot.at(feature)
    robot.drag((x, y), (x + dx, y + dy))
robot.frames(20)
# A gesture is under way when the end comes.
robot.move(robot.at("2.1"))
robot.press()
robot.move((robot.position[0], robot.position[1] + 10), 4)
print(*app.session.model.instance(app.session._history.head.coefficients)[::500].ravel().tolist(), flush=True)
os.kill(os.getpid(), signal.SIGKILL)
"""


@pytest.fixture(autouse=True)
def state_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    return tmp_path


def start(tmp_path: Path) -> Robot:
    settings = Settings(window_size=(900, 680), folder=str(tmp_path))
    return Robot(App("man", hidden=True, threaded=False, settings=settings, journal=True))


@pytest.fixture
def robots(tmp_path: Path) -> Iterator[list[Robot]]:
    started: list[Robot] = []
    yield started
    for robot in started:
        robot.app.close()


def kill_one(tmp_path: Path) -> np.ndarray:
    environment = os.environ | {"XDG_STATE_HOME": str(tmp_path / "state")}
    done = subprocess.run(
        [sys.executable, "-c", KILLED], env=environment, capture_output=True, text=True, timeout=120, check=False
    )
    assert done.returncode == -signal.SIGKILL, done.stderr
    return np.array(done.stdout.split(), dtype=float)


@pytest.mark.skipif(sys.platform == "win32", reason="needs SIGKILL")
def test_what_was_done_before_a_kill_is_offered_and_comes_back(tmp_path: Path, robots: list[Robot]) -> None:
    posed = kill_one(tmp_path)
    robots.append(start(tmp_path))
    robot = robots[0]
    app = robot.app
    robot.frames(2)
    assert "Recover the unsaved pose of 'man'?" in app.dialogs.waiting[0].title
    robot.click_widget("choice:2")
    assert app.session.document.constraints == ()
    app.close()
    robots.clear()

    robots.append(start(tmp_path))
    robot = robots[0]
    app = robot.app
    robot.frames(2)
    robot.click_widget("choice:0")
    assert len(app.session.document.constraints) == 2, "all but the gesture that was under way"
    np.testing.assert_allclose(app.scene.vertices[::500].ravel(), posed, atol=1e-4)
    assert app.session.dirty
    robot.frames(20)
    assert len(list(autosave_dir().glob("*.json"))) == 1, "it is in the journal of the new program now"


@pytest.mark.skipif(sys.platform == "win32", reason="needs SIGKILL")
def test_what_is_discarded_is_not_offered_again(tmp_path: Path, robots: list[Robot]) -> None:
    kill_one(tmp_path)
    for offered in (True, False):
        robots.append(start(tmp_path))
        robot = robots[0]
        robot.frames(2)
        assert robot.app.dialogs.open == offered
        if offered:
            robot.click_widget("choice:1")
        robot.app.close()
        robots.clear()
    assert list(autosave_dir().iterdir()) == []


def test_a_clean_end_and_a_save_leave_no_journal(tmp_path: Path, robots: list[Robot]) -> None:
    robots.append(start(tmp_path))
    robot = robots[0]
    app = robot.app
    x, y = robot.at("8.3")
    robot.drag((x, y), (x + 10, y - 10))
    robot.frames(20)
    assert len(list(autosave_dir().glob("*.json"))) == 1
    app.session.save(tmp_path / "saved.json")
    robot.frames(20)
    assert list(autosave_dir().glob("*.json")) == []
    robot.drag(robot.at("8.3"), (x, y))
    robot.frames(20)
    app.files.quit()
    robot.frames(2)
    robot.click_widget("choice:1")
    assert app.closing
    app.close()
    robots.clear()
    assert list(autosave_dir().iterdir()) == []


def test_an_end_that_nobody_asked_for_keeps_the_work(tmp_path: Path, robots: list[Robot]) -> None:
    robots.append(start(tmp_path))
    robot = robots[0]
    x, y = robot.at("8.3")
    robot.drag((x, y), (x + 10, y - 10))
    robot.app.close()
    robots[0] = start(tmp_path)
    robots[0].frames(2)
    assert "Recover" in robots[0].app.dialogs.waiting[0].title


def test_recent_files_are_remembered_opened_and_forgotten(tmp_path: Path, robots: list[Robot]) -> None:
    robots.append(start(tmp_path))
    robot = robots[0]
    app = robot.app
    for name in ("one", "two"):
        x, y = robot.at("8.3")
        robot.drag((x, y), (x + 5, y - 5))
        robot.key("Ctrl+Shift+S")
        robot.key("Ctrl+A")
        robot.type(str(tmp_path / f"{name}.json"))
        robot.click_widget("files:accept")
    assert [Path(path).stem for path in app.settings.recent] == ["two", "one"]
    robot.click_widget("menu:File")
    robot.move(app.marks.center("menu:open-recent"))
    robot.frames(30)
    robot.click_widget("menu:recent:1")
    assert app.session.path == (tmp_path / "one.json").resolve()
    assert [Path(path).stem for path in app.settings.recent] == ["one", "two"]
    (tmp_path / "two.json").unlink()
    app.files.recent.open(app.settings.recent[1])
    robot.frames(2)
    assert "is gone" in app.dialogs.waiting[0].title
    assert [Path(path).stem for path in app.settings.recent] == ["one"]
    robot.click_widget("choice:0")
    app.files.recent.clear()
    assert app.settings.recent == []
