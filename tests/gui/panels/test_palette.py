"""The command palette: what it finds, and that it does it from the keyboard and by the mouse."""

import pytest
from imgui_bundle import imgui

# The bundle tells glfw which GLFW library to load, so that both share one; it must come first.
# isort: split
import glfw

from faceposer.gui.actions import Action, Actions
from faceposer.gui.panels.action_search import ranked
from faceposer.gui.testing.scripted_user import Robot
from tests.windows import OpenWindow

pytestmark = pytest.mark.gl

ARROWS = {
    "Up": glfw.KEY_UP,
    "Down": glfw.KEY_DOWN,
    "PageUp": glfw.KEY_PAGE_UP,
    "PageDown": glfw.KEY_PAGE_DOWN,
    "Home": glfw.KEY_HOME,
    "End": glfw.KEY_END,
}


def action(label: str, menu: str = "File", keys: tuple[str, ...] = (), text: str = "") -> Action:
    return Action(label.lower(), label, menu, lambda: None, keys, help=text)


TABLE = (
    action("Open...", keys=("Ctrl+O",), text="Open a session or a character"),
    action("Save", keys=("Ctrl+S",), text="Save the session"),
    action("Save OBJ as...", keys=("Ctrl+Shift+E",)),
    action("Reset to neutral", "Edit", ("R",), "Back to the neutral face, no points"),
    action("Wireframe", "View", ("W",), "Show the edges of the mesh"),
    action("Side panel", "View", ("N",)),
    action("Show points", "View", ("P",), "Draw the pins over the face"),
)


def found(query: str) -> list[str]:
    return [match.action.label for match in ranked(query, TABLE)]


@pytest.mark.parametrize(
    ("query", "labels"),
    [
        ("", [entry.label for entry in TABLE]),
        ("  ", [entry.label for entry in TABLE]),
        ("save", ["Save", "Save OBJ as..."]),
        ("SAVE", ["Save", "Save OBJ as..."]),
        ("save o", ["Save OBJ as..."]),
        ("view", ["Wireframe", "Side panel", "Show points"]),
        ("view pan", ["Side panel"]),
        ("pins", ["Show points"]),
        ("ctrl+o", ["Open..."]),
        ("soa", ["Save OBJ as..."]),
        ("wirfrme", ["Wireframe"]),
        ("frame", ["Wireframe"]),
        ("zzz", []),
        ("save zzz", []),
    ],
)
def test_what_is_found(query: str, labels: list[str]) -> None:
    assert found(query) == labels


def test_the_best_come_first() -> None:
    assert found("w")[0] == "Wireframe"
    assert found("r")[0] == "Reset to neutral"
    assert found("points")[0] == "Show points"
    assert set(found("points")) == {"Show points", "Reset to neutral"}
    assert found("session")[:2] == ["Open...", "Save"]


def test_letters_that_were_typed_are_known() -> None:
    match = ranked("panel si", TABLE)[0]
    assert "".join(match.action.label[i] for i in sorted(match.letters)) == "Sipanel"
    match = ranked("soa", TABLE)[0]
    assert sorted(match.letters) == [0, 5, 9]


@pytest.fixture
def robot(open_window: OpenWindow) -> Robot:
    return open_window("man")


def tap(robot: Robot, name: str) -> None:
    """Tap a key that no action has."""
    for pressed in (1, 0):
        imgui.backends.glfw_key_callback(robot.app.window.address, ARROWS[name], 0, pressed, 0)
        robot.frames(1)


def names(robot: Robot) -> list[str]:
    return [action.name for action in robot.app.palette.rows]


def chosen(robot: Robot) -> str:
    return names(robot)[robot.app.palette.chosen]


def test_lists_every_action_and_those_added_later(robot: Robot) -> None:
    app = robot.app
    robot.key("Ctrl+P")
    assert app.palette.open
    assert names(robot) == [action.name for action in app.actions]
    done = []
    app.actions = Actions([*app.actions, Action("made-up", "Brand new", "Edit", lambda: done.append(1))])
    robot.type("brand")
    assert names(robot) == ["made-up"]
    robot.key("Enter")
    assert done == [1]
    assert not app.palette.open


def test_keys_go_to_the_search_and_not_to_the_view(robot: Robot) -> None:
    app = robot.app
    x, y = robot.at("8.3")
    robot.drag((x, y), (x + 12, y - 14))
    view = app.viewport.view
    robot.key("Ctrl+P")
    for key in ("R", "3", "W", "Delete"):
        robot.key(key)
    robot.type("r3")
    assert app.palette.query == "r3"
    assert app.viewport.view == view
    assert not app.wireframe
    assert len(app.session.document.constraints) == 1
    robot.key("Esc")
    assert not app.palette.open
    assert app.toolbox.selection == {0}
    robot.key("3")
    assert app.viewport.view != view


def test_a_key_in_the_same_frame_as_its_opening_is_not_the_views(robot: Robot) -> None:
    app = robot.app
    for name, modifiers in (("P", frozenset({"ctrl"})), ("W", frozenset())):
        app.window.play_key(name, "press", modifiers)
        app.window.play_key(name, "release", modifiers)
    robot.frames(4)
    assert app.palette.open
    assert not app.wireframe


def test_keys_move_the_choice(robot: Robot) -> None:
    robot.key("Ctrl+P")
    order = names(robot)
    assert chosen(robot) == order[0]
    tap(robot, "Down")
    tap(robot, "Down")
    assert chosen(robot) == order[2]
    tap(robot, "Up")
    assert chosen(robot) == order[1]
    tap(robot, "End")
    assert chosen(robot) == order[-1]
    assert f"palette:{order[-1]}" in robot.app.widget_rects
    tap(robot, "Down")
    assert chosen(robot) == order[0]
    tap(robot, "Up")
    assert chosen(robot) == order[-1]
    tap(robot, "PageUp")
    middle = order.index(chosen(robot))
    assert 0 < middle < len(order) - 5
    tap(robot, "PageDown")
    assert chosen(robot) == order[-1]
    tap(robot, "Home")
    assert chosen(robot) == order[0]
    robot.type("wir")
    tap(robot, "Home")
    robot.type("e")
    assert robot.app.palette.query == "wire"
    robot.key("Enter")
    assert robot.app.wireframe


def test_what_cannot_be_done_now_is_not_run(robot: Robot) -> None:
    app = robot.app
    robot.key("Ctrl+P")
    robot.type("undo")
    robot.key("Enter")
    assert app.palette.open
    robot.click_widget("palette:undo")
    assert app.palette.open
    robot.type(" again")
    assert app.palette.query == "undo again"
    robot.key("Esc")
    robot.key("Ctrl+P")
    robot.type("clay")
    assert names(robot) == ["clay"]
    robot.key("Enter")
    assert app.shading == "clay"


def test_nothing_found_is_nothing_run(robot: Robot) -> None:
    robot.key("Ctrl+P")
    robot.type("zzzz")
    assert names(robot) == []
    tap(robot, "Down")
    robot.key("Enter")
    assert robot.app.palette.open
    robot.key("Ctrl+P")
    assert not robot.app.palette.open


def test_the_mouse_chooses_and_a_click_outside_closes(robot: Robot) -> None:
    app = robot.app
    robot.key("Ctrl+P")
    robot.type("panel")
    robot.click_widget("palette:panel")
    assert not app.panel_shown
    assert not app.palette.open
    robot.key("Ctrl+P")
    _, _, _, bottom = app.widget_rects["view"]
    robot.click((450.0, bottom - 5.0))
    assert not app.palette.open
    assert not app.session.can_undo
    robot.key("Ctrl+P")
    assert app.palette.query == ""


def test_a_dialog_can_follow(robot: Robot) -> None:
    app = robot.app
    robot.key("Ctrl+P")
    robot.type("keys and")
    robot.key("Enter")
    robot.frames(2)
    assert app.dialogs.open
    robot.key("Esc")
    robot.key("Ctrl+P")
    robot.type("save as")
    robot.key("Enter")
    robot.frames(2)
    assert app.file_dialogs.open


@pytest.mark.parametrize("size", [(480, 360), (640, 480), (1360, 860)])
def test_it_fits_the_window(robot: Robot, size: tuple[int, int]) -> None:
    app = robot.app
    app.window.set_size(size)
    robot.frames(2)
    robot.key("Ctrl+P")
    window = imgui.internal.find_window_by_name(popup_name())
    assert window.pos.x >= 0.0
    assert window.pos.x + window.size.x <= size[0]
    assert window.pos.y + window.size.y <= size[1]
    tap(robot, "End")
    left, top, right, bottom = app.widget_rects[f"palette:{names(robot)[-1]}"]
    assert 0 <= left < right <= size[0]
    assert window.pos.y < top < bottom < window.pos.y + window.size.y


def popup_name() -> str:
    for window in imgui.get_current_context().windows:
        if window.name.startswith("##Popup_") and window.active:
            return window.name
    raise AssertionError("no popup is open")


def test_esc_right_after_it_is_opened_closes_it(robot: Robot) -> None:
    window = robot.app.window
    # Without a frame between the keys, as at a slow frame.
    window.play_key("P", "press", frozenset({"ctrl"}))
    window.play_key("Esc", "press", frozenset())
    robot.frames(3)
    assert not robot.app.palette.open
    assert not robot.app.dialogs.open
    robot.key("Ctrl+P")
    assert robot.app.palette.open
