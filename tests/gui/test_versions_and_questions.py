"""The window says what it changed of a session, and Enter destroys nothing that cannot be brought back."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from faceposer.gui.app import App
from faceposer.gui.features.range_marks.feature import RangeMarksFeature
from faceposer.gui.settings import Settings
from faceposer.gui.testing.few_pixels import draw_few_pixels
from faceposer.gui.testing.scripted_user import Robot
from faceposer.gui.widgets.dialogs import Choice, Question
from faceposer.model.character_file import load_character, save_character
from tests.versions import renumbered

pytestmark = [pytest.mark.gl, pytest.mark.usefixtures("small_textures")]

CORNER = "8.3"


def opened(what: Path | str, folder: Path) -> Robot:
    app = App(str(what), hidden=True, threaded=False, settings=Settings(window_size=(900, 680), folder=str(folder)))
    return Robot(draw_few_pixels(app))


@pytest.fixture
def robot(tmp_path: Path) -> Iterator[Robot]:
    robot = opened("low", tmp_path)
    yield robot
    robot.app.close()


def pull(robot: Robot) -> None:
    x, y = robot.at(CORNER)
    robot.drag((x - 2.0, y), (x + 10.0, y - 10.0), steps=3)
    robot.frames(2)


@pytest.mark.parametrize("later", [False, True])
def test_a_session_of_another_version_says_so_once(tmp_path: Path, later: bool) -> None:
    save_character(tmp_path / "own.npz", load_character("low"))
    first = opened(tmp_path / "own.npz", tmp_path)
    pull(first)
    path = tmp_path / "pulled.json"
    first.app.session.save(path, first.app.viewport.camera)
    was = first.at(CORNER)
    first.app.close()
    save_character(tmp_path / "own.npz", renumbered(load_character("low")))
    robot = opened("low" if later else path, tmp_path)
    if later:
        robot.app.files.open(str(path))
    robot.frames(3)
    try:
        app = robot.app
        question = app.dialogs.waiting[0]
        assert question.title == "The character may have changed"
        assert question.text == (
            'This session was made with another version of "own"; 1 point was reattached by position.'
        )
        robot.key("Enter")
        robot.frames(2)
        assert not app.dialogs.open
        assert not app.session.dirty, "opening is no work"
        assert robot.at(CORNER) == pytest.approx(was, abs=2.0)
        app.files.save()
        app.files.open(str(path))
        robot.frames(2)
        assert not app.dialogs.open
    finally:
        robot.app.close()


def test_opening_the_open_session_again_reverts_it(robot: Robot, tmp_path: Path) -> None:
    app = robot.app
    pull(robot)
    path = tmp_path / "a.json"
    app.session.save(path, app.viewport.camera)
    for action in ("view-left", "wireframe", "clay", "range-marks", "expression-lines", "view-front", "wireframe"):
        app.actions[action].run()
        robot.frames(1)
    session = app.session
    app.files.open(str(path))
    robot.frames(2)
    assert not app.dialogs.open, "a view is no change"
    assert app.session is not session
    robot.drag(robot.at("4.1"), (450.0, 150.0), steps=3)
    assert app.session.dirty
    for key, left in (("Enter", 2), ("Esc", 2)):
        app.files.open(str(tmp_path / "." / "a.json"))
        robot.frames(2)
        assert app.dialogs.waiting[0].title == "Revert to the saved a.json?"
        robot.key(key)
        robot.frames(2)
        assert not app.dialogs.open
        assert len(app.session.document.constraints) == left, "nothing is lost by a key"
    app.files.open(str(path))
    robot.frames(2)
    robot.click_widget("choice:0")
    robot.frames(2)
    assert len(app.session.document.constraints) == 1
    assert not app.session.dirty


def test_enter_saves_and_esc_stays_when_another_file_is_opened(robot: Robot, tmp_path: Path) -> None:
    app = robot.app
    pull(robot)
    app.session.save(tmp_path / "a.json", app.viewport.camera)
    robot.drag(robot.at("4.1"), (450.0, 150.0), steps=3)
    app.files.open("man")
    robot.frames(2)
    assert app.dialogs.waiting[0].title == "Save a.json?"
    robot.key("Esc")
    robot.frames(2)
    assert app.session.model.character.name == "low"
    app.files.open("man")
    robot.frames(2)
    robot.key("Enter")
    robot.frames(2)
    assert app.session.model.character.name == "man"
    app.files.open(str(tmp_path / "a.json"))
    assert len(app.session.document.constraints) == 2


def test_enter_takes_the_default_of_a_question(robot: Robot) -> None:
    taken: list[str] = []
    choices = (Choice("Delete", lambda: taken.append("delete")), Choice("Cancel", lambda: taken.append("cancel")))
    for default in (0, 1):
        robot.app.dialogs.ask(Question("Delete it?", f"{default}", choices, default=default))
        robot.frames(2)
        robot.key("Enter")
        robot.frames(2)
    assert taken == ["delete", "cancel"]


def test_range_marks_are_switched_in_the_tab_view_too(robot: Robot) -> None:
    robot.click_widget("tab:View")
    robot.frames(2)
    marks = robot.app.features[RangeMarksFeature]
    assert marks.shown
    robot.click_widget("range-marks")
    robot.frames(1)
    assert not marks.shown
    robot.app.actions["range-marks"].run()
    assert marks.shown


def test_switches_go_through_undo_files_and_other_characters(robot: Robot, tmp_path: Path) -> None:
    """Spread and contact belong to a session and its history, marks and lines to the window."""
    app = robot.app
    for name in ("contact", "expression-lines", "range-marks"):
        app.actions[name].run()
        robot.frames(1)
    app.session.set_spread(0.9)

    def state() -> tuple[float, bool, bool, bool]:
        document = app.session.document
        return document.spread, document.contact, app.scene.expression_lines, app.features[RangeMarksFeature].shown

    assert state() == (0.9, False, False, False)
    robot.key("Ctrl+Z")
    assert state() == (0.5, False, False, False)
    robot.key("Ctrl+Z")
    assert state() == (0.5, True, False, False)
    assert not app.session.dirty
    robot.key("Ctrl+Shift+Z")
    robot.key("Ctrl+Shift+Z")
    assert state() == (0.9, False, False, False)
    app.session.save(tmp_path / "a.json", app.viewport.camera)
    app.files.open("creature")
    robot.frames(2)
    assert state() == (0.5, True, False, False)
    app.files.open(str(tmp_path / "a.json"))
    robot.frames(2)
    assert state() == (0.9, False, False, False)
    x, y = robot.at(CORNER)
    robot.move((x - 2.0, y))
    robot.press()
    robot.move((x + 10.0, y - 8.0), 3)
    app.actions["contact"].run()
    robot.key("Ctrl+Z")
    assert state() == (0.9, False, False, False), "nothing else while a point is dragged"
    robot.release()
    robot.frames(1)
    assert app.session.undo_label == "Place a point"
