"""What the window says is true: hints, reasons, names and questions."""

from dataclasses import replace
from pathlib import Path

import pytest
from imgui_bundle import imgui

from faceposer.gui.panels.status_bar import fitting
from faceposer.gui.testing.scripted_user import Robot
from faceposer.model.character_file import load_character, save_character
from tests.windows import OpenWindow


@pytest.fixture
def robot(open_window: OpenWindow) -> Robot:
    return open_window("low", (1100, 800))


def pull(robot: Robot, name: str = "8.3") -> None:
    x, y = robot.at(name)
    robot.drag((x, y), (x + 8, y - 10))


def test_a_locked_constraint_says_so(robot: Robot, monkeypatch: pytest.MonkeyPatch) -> None:
    app = robot.app
    pull(robot)
    x, y = robot.at("8.3")
    robot.move((x, y))
    assert "right click: remove it" in app.hint()
    assert app.actions["delete"].enabled()
    robot.click_widget("point:0:lock")
    robot.move((x, y))
    assert "remove it" not in app.hint().replace("to move or remove it", "")
    assert app.hint().startswith("Locked")
    assert not app.actions["delete"].enabled()
    assert not app.actions["nudge-up"].enabled()
    app.toolbox.choose("distance")
    robot.move((x, y))
    assert "right click: remove it" not in app.hint()
    said: list[str] = []
    style = imgui.get_style()
    style.hover_stationary_delay = style.hover_delay_normal = 0.0
    text = imgui.text_unformatted
    monkeypatch.setattr(imgui, "text_unformatted", lambda words: (said.append(words), text(words))[1])
    for name in ("point:0:delete", "delete"):
        robot.move(app.widget_rects.center(name))
        said.clear()
        robot.frames(3)
        assert any("locked" in words for words in said), name


def test_a_drag_says_what_the_tool_that_drags_does(robot: Robot) -> None:
    app = robot.app
    robot.key("J")
    x, y = robot.at("8.3")
    robot.move((x, y))
    robot.press()
    robot.move((x + 20, y - 20), 4)
    assert "pull the face" not in app.hint()
    robot.release()


def test_figures_give_way_to_the_hint() -> None:
    parts = ["solved in 0.5 ms", "residual 0.1 px", "Man"]
    assert fitting(parts, 100, len) == "   ·   ".join(parts)
    assert fitting(parts, 30, len) == "residual 0.1 px   ·   Man"
    assert fitting(parts, 5, len) == "Man"
    assert fitting(parts, 2, len) == ""


@pytest.mark.parametrize("scale", [0.75, 1.0, 1.5, 2.0])
def test_the_status_bar_is_inside_the_window(scale: float, open_window: OpenWindow) -> None:
    robot = open_window("low", (1100, 800), ui_scale=scale)
    robot.frames(3)
    bar = next(w for w in imgui.get_current_context().windows if w.name == "##status")
    assert bar.pos.y + bar.size.y <= 800.0


def test_the_open_character_is_renamed_everywhere_at_once(robot: Robot, tmp_path: Path) -> None:
    app = robot.app
    app.characters.make_folder()
    path = app.characters.folder / "head.npz"
    save_character(path, replace(load_character("low"), name="head", title="Head"))
    app.files.open(str(path))
    robot.frames(3)
    robot.click_widget("character")
    robot.frames(3)
    robot.click_widget(f"character:{path}:rename")
    robot.frames(3)
    robot.key("Ctrl+A")
    robot.type("Somebody")
    robot.key("Enter")
    robot.frames(3)
    assert app.session.model.character.title == "Somebody"
    assert app.files.title.startswith("Somebody")
    assert app.characters.title(path) == "Somebody"
    app.files.open(str(path))
    robot.frames(3)
    assert app.session.model.character.title == "Somebody"


def test_a_character_is_not_removed_by_enter(robot: Robot) -> None:
    app = robot.app
    app.characters.make_folder()
    path = app.characters.folder / "head.npz"
    save_character(path, replace(load_character("low"), title="Head"))
    robot.click_widget("character")
    robot.frames(3)
    robot.click_widget(f"character:{path}:remove")
    robot.frames(3)
    assert app.dialogs.open
    robot.key("Enter")
    robot.frames(3)
    assert not app.dialogs.open
    assert path.exists()


def test_a_session_whose_character_is_gone_opens_with_another(robot: Robot, tmp_path: Path) -> None:
    app = robot.app
    path, session = tmp_path / "head.npz", tmp_path / "smile.json"
    save_character(path, replace(load_character("low"), name="head", title="Head"))
    app.files.open(str(path))
    robot.frames(2)
    pull(robot)
    app.files._save(session)
    app.files.open("low")
    robot.frames(2)
    path.unlink()
    app.files.open(str(session))
    robot.frames(4)
    question = app.dialogs.waiting[0]
    assert question.title == "The character 'head' is not found"
    assert "removed or moved" in question.text
    assert str(path) in question.text
    robot.click_widget("choice:2")
    assert app.session.document.character == "low"
    assert not app.session.document.constraints
    app.files.open(str(session))
    robot.frames(4)
    robot.click_widget("choice:1")
    robot.frames(4)
    assert app.session.document.character == "low"
    assert len(app.session.document.constraints) == 1
    app.files.open("low")
    robot.frames(4)
    robot.click_widget("choice:1")
    robot.frames(4)
    app.files.open(str(session))
    robot.frames(4)
    robot.click_widget("choice:0")
    robot.frames(4)
    assert app.file_dialogs.browsing


def test_unsaved_work_is_called_a_session(robot: Robot) -> None:
    pull(robot)
    robot.app.files.guard(lambda: None)
    assert robot.app.dialogs.waiting[0].title == "Save the session?"


def test_weights_opened_as_a_session_point_to_the_command_for_them(robot: Robot, tmp_path: Path) -> None:
    path = tmp_path / "weights.json"
    path.write_text('{"jawOpen": 0.5}')
    robot.app.files.open(str(path))
    assert "File > Open pose" in robot.app.dialogs.waiting[0].text
    robot.app.dialogs.waiting.clear()
    broken = tmp_path / "broken.json"
    broken.write_text('{"format": "faceposer.session", ')
    robot.app.files.open(str(broken))
    assert "Open pose" not in robot.app.dialogs.waiting[0].text


def test_one_word_for_one_thing(robot: Robot, monkeypatch: pytest.MonkeyPatch) -> None:
    """Buttons have the label of their action: views, tools, and what removes constraints."""
    app = robot.app
    shown: list[str] = []
    button = imgui.button
    monkeypatch.setattr(
        imgui, "button", lambda label, *size: (shown.append(label.split("##")[0]), button(label, *size))[1]
    )
    robot.click_widget("tab:View")
    robot.frames(2)
    for name in ("front", "three-quarter", "left", "right", "top"):
        assert app.actions[f"view-{name}"].label in shown
    labels = [action.label for action in app.actions]
    assert not [label for label in labels if label.startswith(("Delete", "Clear"))]
