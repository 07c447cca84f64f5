"""Work outlives the program: it is kept as it is made, and offered at the next start; files are found again."""

import json
import os
import signal
import subprocess
import sys
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest

from faceposer.errors import FacePoserError
from faceposer.gui import recent_files as recent
from faceposer.gui.app import App
from faceposer.gui.settings import MAX_RECENT, Settings, load_settings
from faceposer.gui.testing.few_pixels import draw_few_pixels
from faceposer.gui.testing.scripted_user import Robot
from faceposer.gui.window import CloseRequest, Drop
from faceposer.session.autosave import Journal
from faceposer.session.document import Document, write_document
from faceposer.session.opening import open_session
from tests.windows import OpenWindow

pytestmark = [pytest.mark.gl, pytest.mark.usefixtures("small_textures")]

LEFT_CORNER, RIGHT_CORNER, LEFT_BROW = "8.3", "8.4", "4.1"

# A user who poses until the program is killed: two gestures, and a third one under way.
POSING = """
import json, sys
from faceposer.gui.app import App
from faceposer.gui.testing.few_pixels import draw_few_pixels
from faceposer.gui.testing.scripted_user import Robot
from faceposer.gui.settings import Settings

app = App("man", hidden=True, threaded=False, settings=Settings(window_size=(700, 540)), journal=True)
robot = Robot(draw_few_pixels(app))
for name, (across, down) in (("8.3", (12, -14)), ("8.4", (-6, -6))):
    x, y = robot.at(name)
    robot.drag((x, y), (x + across, y + down))
finished = app.session.document
"""
KILLED = """
x, y = robot.at("4.1")
robot.move((x, y))
robot.press()
robot.move((x, y - 8), 20)
print(json.dumps(finished.to_json()), flush=True)
sys.stdin.read()
"""
ASKED_TO_END = """
import signal
# Whoever runs the tests in the background may have it ignored, which the program would go along with.
signal.signal(signal.SIGINT, signal.default_int_handler)
wait = app.window.wait

def wait_and_tell(seconds):
    app.window.wait = wait
    print(json.dumps(finished.to_json()), flush=True)
    wait(seconds)

app.window.wait = wait_and_tell
try:
    app.run()
finally:
    app.close()
sys.exit(128 + app.interrupted)
"""


@pytest.fixture
def state(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder of the journals, away from the user's own."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    return tmp_path / "state" / "faceposer" / "autosave"


Start = Callable[..., Robot]


@pytest.fixture
def start(state: Path, open_window: OpenWindow) -> Start:
    """Starts the program with a journal; what still runs in the end is closed."""

    def call(what: str = "man", **choices: object) -> Robot:
        return open_window(what, (700, 540), journal=True, **choices)

    return call


def crash(robot: Robot) -> None:
    """End the program without the user's having asked for it."""
    robot.app.close()


def smile(robot: Robot, feature: str = LEFT_CORNER) -> None:
    x, y = robot.at(feature)
    robot.drag((x, y), (x + 12, y - 14))


def answer(robot: Robot, choice: int) -> None:
    robot.frames(2)
    robot.click_widget(f"choice:{choice}")


def asked(robot: Robot) -> str:
    waiting = robot.app.dialogs.waiting
    return waiting[0].title if waiting else ""


def journals(state: Path) -> list[Path]:
    return sorted(state.glob("*.json"))


def same_work(robot: Robot, document: Document) -> None:
    session = robot.app.session
    assert session.document.same_input(document)
    assert document.coefficients is not None
    np.testing.assert_allclose(session.coefficients, document.coefficients, atol=1e-12)


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")
@pytest.mark.parametrize(
    ("ending", "number"), [(KILLED, "SIGKILL"), (ASKED_TO_END, "SIGTERM"), (ASKED_TO_END, "SIGINT")]
)
def test_finished_gestures_outlive_the_program(start: Start, state: Path, ending: str, number: str) -> None:
    program = subprocess.Popen(
        [sys.executable, "-c", POSING + ending],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        env=os.environ | {"OPENBLAS_NUM_THREADS": "1"},
    )
    try:
        assert program.stdout is not None
        finished = Document.from_json(json.loads(program.stdout.readline()))
        if number == "SIGKILL":
            bystander = start()
            assert asked(bystander) == "", "the program is still running"
            bystander.app.close()
        program.send_signal(getattr(signal, number))
        assert program.wait(60.0) == (-9 if number == "SIGKILL" else 128 + getattr(signal, number))
    finally:
        program.kill()
        program.communicate()
    assert len(finished.constraints) == 2
    robot = start()
    assert asked(robot) == "Recover the unsaved session with 'man'?"
    answer(robot, 0)
    assert asked(robot) == ""
    same_work(robot, finished)
    assert robot.app.session.dirty
    assert robot.app.session.path is None
    assert len(journals(state)) == 1, "it is in the new program's journal alone"


@pytest.mark.slow
def test_recovered_work_is_saved_where_it_was(start: Start, state: Path, tmp_path: Path) -> None:
    path = tmp_path / "smile.json"
    write_document(path, Document("woman"))
    robot = start(str(path))
    smile(robot)
    view = robot.app.viewport.view
    work = robot.app.session.document
    crash(robot)
    robot = start()
    assert asked(robot) == "Recover smile.json?"
    answer(robot, 0)
    same_work(robot, work)
    app = robot.app
    assert app.viewport.view.yaw == pytest.approx(view.yaw, abs=1e-6)
    robot.frames(2)
    assert app.window.title == "smile.json* - Face Poser"
    smile(robot, RIGHT_CORNER)
    crash(robot)
    robot = start()
    answer(robot, 0)
    assert len(robot.app.session.document.constraints) == 2
    robot.key("Ctrl+S")
    assert not robot.app.session.dirty
    assert len(json.loads(path.read_text())["constraints"]) == 2
    assert journals(state) == []
    robot.key("Ctrl+Q")
    crash(robot)
    assert list(state.iterdir()) == []


@pytest.mark.slow
def test_discard_deletes_and_later_keeps(start: Start, state: Path) -> None:
    robot = start()
    smile(robot)
    crash(robot)
    for choice, left in ((2, 1), (2, 1), (1, 0)):
        robot = start()
        answer(robot, choice)
        assert asked(robot) == ""
        assert not robot.app.session.document.constraints
        assert len(journals(state)) == left
        robot.app.close()
    assert list(state.iterdir()) == []
    assert asked(start()) == ""


def test_several_are_offered_one_after_another(start: Start, state: Path, tmp_path: Path) -> None:
    for minute, name in enumerate(("first", "second", "third")):
        write_document(tmp_path / f"{name}.json", Document("man"))
        session = open_session(str(tmp_path / f"{name}.json"))
        session.set_prior_weight(2.0)
        journal = Journal(state, now=lambda minute=minute: datetime(2024, 5, 17, 12, minute, tzinfo=UTC))
        journal.flush(session)
        journal.close(keep=True)
    robot = start()
    offered = [asked(robot)]
    answer(robot, 0)
    robot.frames(2)
    offered.append(asked(robot))
    answer(robot, 0)
    assert asked(robot).startswith("Save"), "what was recovered first is not saved yet"
    answer(robot, 2)
    robot.frames(2)
    offered.append(asked(robot))
    answer(robot, 2)
    assert offered == [f"Recover {name}.json?" for name in ("third", "second", "first")]
    assert robot.app.session.path == tmp_path / "third.json"
    assert robot.app.session.document.prior_weight == 2.0
    assert len(journals(state)) == 3
    crash(robot)


@pytest.mark.slow
def test_a_gesture_under_way_does_not_hold_up_the_journal(start: Start, state: Path) -> None:
    robot = start()
    smile(robot)
    x, y = robot.at(RIGHT_CORNER)
    robot.move((x, y))
    robot.press()
    robot.move((x - 4, y + 8), 20)
    assert robot.app.toolbox.active
    (journal,) = journals(state)
    assert len(json.loads(journal.read_text())["session"]["constraints"]) == 1
    robot.release()
    robot.frames(20)
    assert len(json.loads(journal.read_text())["session"]["constraints"]) == 2
    robot.key("Ctrl+Z")
    robot.key("Ctrl+Z")
    robot.frames(2)
    assert journals(state) == []


@pytest.mark.parametrize("way", ["drop", "character", "dialog", "recent"])
def test_changes_are_asked_about_and_then_dropped(start: Start, state: Path, tmp_path: Path, way: str) -> None:
    path = tmp_path / "other.json"
    write_document(path, Document("woman"))
    robot = start(recent=[str(path)])
    app = robot.app
    smile(robot)
    robot.frames(20)
    assert len(journals(state)) == 1

    def replace() -> None:
        if way == "drop":
            app.window.play_event(Drop((str(path),)))
        elif way == "character":
            robot.click_widget("character")
            robot.click_widget("character:woman")
        elif way == "recent":
            robot.click_widget("menu:File")
            robot.click_widget("menu:open-recent")
            robot.click_widget("menu:recent:0")
        else:
            robot.key("Ctrl+O")
            robot.key("Ctrl+A")
            robot.type(str(path))
            robot.click_widget("files:accept")
        robot.frames(2)

    replace()
    assert asked(robot) == "Save the session?"
    answer(robot, 2)
    assert app.session.document.character == "man"
    assert len(journals(state)) == 1
    replace()
    answer(robot, 1)
    robot.frames(2)
    assert app.session.document.character == "woman"
    assert journals(state) == []


@pytest.mark.parametrize("way", ["key", "menu", "window"])
def test_leaving_without_saving_leaves_nothing(start: Start, state: Path, way: str) -> None:
    robot = start()
    app = robot.app
    smile(robot)
    robot.frames(20)
    if way == "key":
        robot.key("Ctrl+Q")
    elif way == "menu":
        robot.click_widget("menu:File")
        robot.click_widget("menu:quit")
    else:
        app.window.play_event(CloseRequest())
        robot.frames(2)
    assert not app.closing
    answer(robot, 1)
    assert app.closing
    app.close()
    assert list(state.iterdir()) == []


def test_what_cannot_be_recovered_is_told_and_kept(start: Start, state: Path) -> None:
    robot = start()
    smile(robot)
    crash(robot)
    (journal,) = journals(state)
    data = json.loads(journal.read_text())
    data["session"]["subject"] = "/nowhere/hero.npz"
    journal.write_text(json.dumps(data))
    robot = start()
    assert asked(robot) == "Recover the unsaved session with 'hero'?"
    answer(robot, 0)
    assert asked(robot) == "The work cannot be recovered"
    assert "hero.npz" in robot.app.dialogs.waiting[0].text
    answer(robot, 0)
    assert journals(state) == [journal]
    robot.app.close()
    journal.write_text("{")
    robot = start()
    assert "damaged" in robot.app.dialogs.waiting[0].text
    answer(robot, 0)
    assert asked(robot) == ""
    assert journal.with_suffix(".damaged").read_text() == "{"


def test_a_disk_that_takes_nothing_is_told_once(start: Start, state: Path) -> None:
    robot = start()
    state.parent.mkdir(parents=True)
    state.write_text("in the way")
    smile(robot)
    robot.frames(20)
    assert asked(robot) == "Unsaved work cannot be recovered after a crash"
    answer(robot, 0)
    robot._frames += 1000
    robot.frames(2)
    assert asked(robot) == ""
    assert "could not be saved" in robot.app.recovery.rescue()


def test_work_is_kept_when_the_window_cannot_be_drawn(
    start: Start, state: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    robot = start()
    smile(robot)
    monkeypatch.setattr(robot.app.constraints_panel, "draw", lambda app: 1 / 0)
    with pytest.raises(FacePoserError, match="your work is kept"):
        robot.frames(20)
    assert "ZeroDivisionError" in capsys.readouterr().err
    crash(robot)
    assert len(journals(state)) == 1


@pytest.mark.slow
def test_without_a_journal_nothing_is_written_or_offered(start: Start, state: Path) -> None:
    robot = start()
    smile(robot)
    crash(robot)
    before = journals(state)
    app = draw_few_pixels(App("man", hidden=True, threaded=False, settings=Settings(window_size=(700, 540))))
    try:
        robot = Robot(app)
        assert asked(robot) == ""
        smile(robot)
        robot.frames(20)
        assert journals(state) == before
        assert app.recovery.rescue() == "unsaved changes are lost."
    finally:
        app.close()
    assert journals(state) == before
    assert [path.name for path in state.parent.iterdir()] == ["autosave"]


def test_recent_files_follow_opening_and_saving(start: Start, tmp_path: Path) -> None:
    paths = [tmp_path / f"{i}.json" for i in range(MAX_RECENT + 1)]
    for path in paths:
        write_document(path, Document("man"))
    robot = start(str(paths[0]))
    app = robot.app
    for path in paths[1:]:
        app.window.play_event(Drop((str(path),)))
        robot.frames(2)
    newest_first = [str(path) for path in reversed(paths[1:])]
    assert app.settings.recent == newest_first
    smile(robot)
    robot.key("Ctrl+Shift+S")
    robot.key("Ctrl+A")
    robot.type(str(tmp_path / "saved"))
    robot.click_widget("files:accept")
    assert app.settings.recent == [str(tmp_path / "saved.json"), *newest_first[:-1]]
    robot.click_widget("character")
    robot.click_widget("character:woman")
    assert app.settings.recent[0] == str(tmp_path / "saved.json")

    paths[-1].unlink()
    robot.click_widget("menu:File")
    robot.click_widget("menu:open-recent")
    shown = [entry.label for entry in app.files.recent.entries()]
    assert len(shown) == MAX_RECENT, "those that are there, and the way to forget them"
    robot.click_widget("menu:recent:0")
    assert app.session.path == tmp_path / "saved.json"
    assert len(app.session.document.constraints) == 1

    app.files.recent.open(str(paths[-1]))
    robot.frames(2)
    assert asked(robot) == "File not found"
    assert str(paths[-1]) in app.dialogs.waiting[0].text
    answer(robot, 0)
    assert str(paths[-1]) not in app.settings.recent
    robot.click_widget("menu:File")
    robot.click_widget("menu:open-recent")
    robot.click_widget("menu:recent-clear")
    assert app.settings.recent == []


@pytest.mark.gl
def test_recent_files_are_remembered_at_once(state: Path, tmp_path: Path) -> None:
    path = tmp_path / "smile.json"
    write_document(path, Document("man"))
    app = App(str(path), hidden=True, threaded=False)
    try:
        assert load_settings().recent == [str(path)]
    finally:
        app.close()
    file = state.parent / "window.json"
    for wrong in (5, "x", [1, "relative.json", "/a\0b", str(path)] + ["/x"] * 20):
        file.write_text(json.dumps({"recent": wrong}))
        kept = load_settings().recent
        assert len(kept) <= MAX_RECENT
        assert kept == ([str(path)] + ["/x"] * (MAX_RECENT - 1) if isinstance(wrong, list) else [])


def test_long_paths_are_shown_short(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HOME", "/home/me")
    assert recent.shown_path("/home/me/faces/a.json") == "~/faces/a.json"
    assert recent.shown_path("/data/a##b.json") == "/data/a# #b.json"
    assert recent.shown_path("/data/\udcff.json") == "/data/\\udcff.json"
    shown = recent.shown_path("/" + "very" * 40 + "/smile.json")
    assert len(shown) == 64
    assert shown.endswith("/smile.json")
