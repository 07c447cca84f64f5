"""The tools of the window, and the panels of what they make, driven by pointer and keys alone."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from faceposer.gui.events import Drop, FocusLost
from faceposer.gui.panels.tool_bar import TOOL_ICONS
from faceposer.gui.testing.scripted_user import Position, Robot
from faceposer.solve.constraints.gaze import gaze_direction
from tests.windows import OpenWindow

pytestmark = pytest.mark.gl

LEFT, RIGHT, NOSE = "8.3", "8.4", "9.3"
KEYS = {
    "point": "Q",
    "distance": "D",
    "stroke": "S",
    "sketch": "E",
    "curve": "K",
    "fix": "H",
    "gaze": "G",
    "trajectory": "J",
    "head": "B",
}


@pytest.fixture
def robot(open_window: OpenWindow) -> Robot:
    return open_window("man", (1000, 940))


def constraints(robot: Robot) -> tuple[Any, ...]:
    return robot.app.session.document.constraints


def kinds(robot: Robot) -> list[str]:
    return [constraint.kind for constraint in constraints(robot)]


def beside(position: Position, dx: float, dy: float) -> Position:
    return (position[0] + dx, position[1] + dy)


def shown(robot: Robot, index: int) -> list[Position]:
    """Return where in the window the target of a stroke or curve is, in the view that it was drawn in."""
    x, y = robot.app.viewport.origin
    return [(u + x, v + y) for u, v in constraints(robot)[index].target]


def slide(robot: Robot, name: str, begin: float, end: float, let_go: bool = True) -> None:
    """Drag a slider from one share of its width to another."""
    left, top, right, bottom = robot.app.widget_rects[name]
    middle, width = 0.5 * (top + bottom), right - left
    robot.move((left + begin * width, middle))
    robot.press()
    robot.move((left + end * width, middle), 5)
    if let_go:
        robot.release()


def place_pin(robot: Robot) -> None:
    robot.key("Q")
    at = robot.at(LEFT)
    robot.drag(at, beside(at, 8, -9))


def draw_stroke(robot: Robot) -> None:
    robot.key("S")
    begin, end = beside(robot.at(RIGHT), 12, 8), beside(robot.at(LEFT), -12, 8)
    robot.drag(begin, end)
    robot.drag(beside(begin, 0, 8), beside(end, 0, 8))


def draw_sketch(robot: Robot) -> None:
    robot.key("E")
    places = [robot.at(name) for name in ("4.1", "4.3", "4.5")]
    robot.move(beside(places[0], 0, -6))
    robot.press()
    for place in places[1:]:
        robot.move(beside(place, 0, -6), 6)
    robot.release()


def draw_curve(robot: Robot) -> None:
    robot.key("K")
    begin, end = beside(robot.at(RIGHT), 0, -60), beside(robot.at(LEFT), 0, -60)
    for share in (0.0, 0.5, 1.0):
        robot.click(beside(begin, share * (end[0] - begin[0]), share * (end[1] - begin[1])))
    robot.key("Enter")


def turn_eyes(robot: Robot) -> None:
    robot.key("G")
    handle = robot.app.toolbox.gaze_tool.handle(robot.app.viewport)
    assert handle is not None
    at = beside(handle, *robot.app.viewport.origin)
    robot.drag(at, beside(at, 50, 10))


def make_all(robot: Robot) -> None:
    place_pin(robot)
    robot.key("D")
    robot.click_widget("measure:left eye height")
    draw_stroke(robot)
    draw_sketch(robot)
    draw_curve(robot)
    robot.key("H")
    robot.click_widget("hold:Nose")
    turn_eyes(robot)
    robot.key("Q")
    assert kinds(robot) == ["point", "distance", "stroke", "sketch", "curve", "fixed", "gaze"]


def test_each_tool_by_its_key_and_by_its_button(robot: Robot) -> None:
    app = robot.app
    assert set(KEYS) == set(app.toolbox.tools) == set(TOOL_ICONS)
    hints = set()
    for name, key in KEYS.items():
        robot.key("Q" if name != "point" else "D")
        robot.key(key)
        assert app.toolbox.chosen.name == name
        robot.key("Q" if name != "point" else "D")
        robot.click_widget(f"tool-{name}")
        assert app.toolbox.chosen.name == name
        hints.add(app.toolbox.chosen.hint(app.viewport))
    assert len(hints) == len(KEYS)
    assert not app.session.can_undo


def test_a_ready_made_distance_and_its_slider(robot: Robot) -> None:
    app = robot.app
    robot.key("D")
    robot.click_widget("measure:mouth height")
    assert kinds(robot) == ["distance"]
    assert app.point_name(0) == "mouth height"
    closed = constraints(robot)[0].target
    features = app.session.model.character.feature_points
    lips = [features["2.2"], features["2.3"]]
    height = np.diff(app.scene.vertices[lips][:, 1])[0]
    slide(robot, "detail:target", 0.05, 0.4, let_go=False)
    assert app.busy
    robot.release()
    opened = constraints(robot)[0].target
    assert opened > closed + 5
    assert abs(np.diff(app.scene.vertices[lips][:, 1])[0]) > abs(height) + 0.2
    robot.key("Ctrl+Z")
    assert constraints(robot)[0].target == closed, "one drag is one step"
    robot.key("Ctrl+Y")
    assert constraints(robot)[0].target == opened
    slide(robot, "detail:target", 0.4, 0.8, let_go=False)
    assert constraints(robot)[0].target > opened
    robot.key("Esc")
    robot.release()
    assert constraints(robot)[0].target == opened
    assert not app.busy
    robot.key("Ctrl+Z")
    robot.key("Ctrl+Z")
    assert kinds(robot) == []


def test_a_press_on_the_view_ends_what_a_slider_has_begun(robot: Robot) -> None:
    app = robot.app
    place_pin(robot)
    slide(robot, "detail:weight", 0.3, 0.6, let_go=False)
    assert constraints(robot)[0].weight != 1.0
    app.window.play_event(FocusLost())
    robot.frames(2)
    at = robot.at(NOSE)
    robot.drag(at, beside(at, 4, 0))
    assert not app.dialogs.waiting
    assert not app.busy
    assert constraints(robot)[0].weight != 1.0
    assert len(constraints(robot)) == 2
    robot.key("Ctrl+Z")
    robot.key("Ctrl+Z")
    assert constraints(robot)[0].weight == 1.0


def test_a_stroke_that_covers_too_many_pixels_is_said(robot: Robot, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("faceposer.geometry.strokes.MOST_PIXELS", 50)
    draw_stroke(robot)
    assert kinds(robot) == []
    assert robot.app.notice.startswith("The stroke is not kept: it covers more than ")
    monkeypatch.undo()
    draw_stroke(robot)
    assert kinds(robot) == ["stroke"]


def test_a_stroke_needs_source_and_target(robot: Robot) -> None:
    app = robot.app
    draw_stroke(robot)
    assert kinds(robot) == ["stroke"]
    before = constraints(robot)[0]
    assert app.session.residuals_px[0] < 6
    robot.click_widget("redraw")
    assert app.toolbox.stroke_tool.draws_target
    lower = [beside(place, 0, 6) for place in shown(robot, 0)]
    robot.drag(lower[0], lower[-1])
    after = constraints(robot)[0]
    assert after.placed == before.placed
    assert after.target != before.target
    robot.key("Ctrl+Z")
    assert constraints(robot) == (before,)
    robot.click_widget("stroke-energy:1")
    assert constraints(robot)[0].energy == "image"
    robot.key("Ctrl+Z")
    robot.key("Ctrl+Z")
    assert kinds(robot) == []


def test_a_curve_is_accepted_by_enter_and_by_its_button(robot: Robot) -> None:
    app = robot.app
    draw_curve(robot)
    assert kinds(robot) == ["curve"]
    at = shown(robot, 0)[1]
    robot.drag(at, beside(at, 0, -6))
    assert constraints(robot)[0].target != constraints(robot)[0].source
    robot.click(beside(robot.at(RIGHT), 10, 10))
    robot.click(beside(robot.at(LEFT), -10, 10))
    robot.key("Ctrl+Z")
    assert len(app.toolbox.curve_tool.points) == 1
    robot.click(beside(robot.at(LEFT), -10, 10))
    robot.click_widget("curve:accept")
    assert kinds(robot) == ["curve", "curve"]


def test_a_region_is_held_and_weighed(robot: Robot) -> None:
    app = robot.app
    robot.key("H")
    robot.click_widget("hold:Mouth")
    assert kinds(robot) == ["fixed"]
    place_pin(robot)
    moved = np.abs(app.scene.vertices - app.session.model.character.vertices).max()
    robot.frames(2)
    weight = constraints(robot)[0].weight
    slide(robot, "hold-weight", 0.5, 0.0)
    assert constraints(robot)[0].weight < weight
    assert np.abs(app.scene.vertices - app.session.model.character.vertices).max() > moved
    robot.key("Ctrl+Z")
    assert constraints(robot)[0].weight == weight
    robot.key("H")
    robot.click_widget("hold:Mouth")
    assert kinds(robot) == ["point"]


def test_the_eyes_follow_their_handle_and_sliders(robot: Robot) -> None:
    app = robot.app
    turn_eyes(robot)
    assert kinds(robot) == ["gaze"]
    looking = gaze_direction(app.session.model, app.session.coefficients)
    assert looking[0] > 2
    slide(robot, "detail:gaze:0", 0.5, 0.1)
    assert constraints(robot)[0].direction[0] < 0
    robot.key("Ctrl+Z")
    assert gaze_direction(app.session.model, app.session.coefficients) == pytest.approx(looking, abs=1e-6)


def test_rows_of_the_list_switch_lock_and_remove(robot: Robot) -> None:
    app = robot.app
    place_pin(robot)
    posed = app.scene.vertices.copy()
    robot.click_widget("point:0:on")
    assert not constraints(robot)[0].enabled
    assert np.abs(app.scene.vertices - posed).max() > 0.1
    robot.click_widget("point:0:on")
    robot.click_widget("point:0:lock")
    locked = constraints(robot)
    assert locked[0].locked
    robot.click_widget("point:0:delete")
    robot.key("Delete")
    robot.key("Up")
    at = beside(locked[0].target, *app.viewport.origin)
    robot.drag(at, beside(at, 9, 0))
    robot.click(at, "right")
    assert constraints(robot) == locked
    robot.click_widget("clear")
    assert constraints(robot) == locked, "what is locked is not cleared"
    robot.click_widget("point:0:lock")
    robot.click_widget("point:0:delete")
    assert constraints(robot) == ()
    robot.key("Ctrl+Z")
    assert len(constraints(robot)) == 1


def test_list_and_view_point_at_each_other(robot: Robot) -> None:
    app = robot.app
    place_pin(robot)
    robot.key("Esc")
    left, top, right, bottom = app.widget_rects["point:0"]
    robot.move((left + 0.4 * (right - left), 0.5 * (top + bottom)))
    robot.frames(2)
    assert app.highlighted == 0
    target = beside(constraints(robot)[0].target, *app.viewport.origin)
    robot.move(target)
    robot.frames(2)
    assert app.highlighted is None
    assert app.toolbox.hover is not None
    assert app.toolbox.hover.pin == 0
    robot.click((left + 0.4 * (right - left), 0.5 * (top + bottom)))
    assert app.toolbox.selection == {0}
    before = constraints(robot)[0].target
    robot.key("Right")
    robot.key("Shift+Down")
    assert constraints(robot)[0].target == pytest.approx(beside(before, 1, 10))
    robot.key("Ctrl+Z")
    assert constraints(robot)[0].target == before


def test_the_sliders_of_shapes_move_the_face_and_follow_it(robot: Robot) -> None:
    app = robot.app
    robot.click_widget("tab:Shapes")
    robot.click_widget("shapes:filter")
    robot.type("jawOpen")
    robot.frames(2)
    names = app.session.model.character.shape_names

    def weight(name: str) -> float:
        return float(app.session.model.weights_of(app.session.coefficients)[names.index(name)])

    slide(robot, "shape:jawOpen", 0.1, 0.6)
    opened = weight("jawOpen")
    assert opened > 0.3
    assert np.abs(app.scene.vertices - app.session.model.character.vertices).max() > 0.3
    robot.key("Ctrl+Z")
    assert weight("jawOpen") == pytest.approx(0.0, abs=1e-9)
    robot.key("Ctrl+Y")
    slide(robot, "shape:jawOpen", 0.6, 0.9, let_go=False)
    assert weight("jawOpen") > opened
    robot.key("Esc")
    robot.release()
    assert weight("jawOpen") == pytest.approx(opened)
    at = robot.at(LEFT)
    robot.drag(at, beside(at, 3, -3))
    kept = constraints(robot)
    slide(robot, "shape:jawOpen", 0.5, 0.2)
    assert constraints(robot) == kept, "constraints stay"
    assert weight("jawOpen") < opened


def test_accepting_the_pose_keeps_the_face(robot: Robot) -> None:
    app = robot.app
    place_pin(robot)
    posed, kept = app.scene.vertices.copy(), constraints(robot)
    robot.key("Ctrl+Enter")
    assert constraints(robot) == ()
    np.testing.assert_allclose(app.scene.vertices, posed, atol=1e-5)
    robot.drag(robot.at(NOSE), beside(robot.at(NOSE), 0.5, 0.5))
    np.testing.assert_allclose(app.scene.vertices, posed, atol=0.3)
    robot.key("Ctrl+Z")
    robot.key("Ctrl+Z")
    assert constraints(robot) == kept
    np.testing.assert_allclose(app.scene.vertices, posed, atol=1e-5)


def test_symmetry_by_key_and_button(robot: Robot) -> None:
    symmetry = robot.app.toolbox.tool_settings.symmetry
    robot.key("X")
    assert symmetry.on
    place_pin(robot)
    assert kinds(robot) == ["point", "point"]
    robot.click_widget("symmetry")
    assert not symmetry.on
    at = beside(robot.at(LEFT), 20, -40)
    robot.drag(at, beside(at, 4, 4))
    assert len(constraints(robot)) == 3


def test_all_kinds_are_saved_and_opened_again(robot: Robot, tmp_path: Path) -> None:
    app = robot.app
    make_all(robot)
    before, posed = constraints(robot), app.scene.vertices.copy()
    path = tmp_path / "all.json"
    robot.key("Ctrl+S")
    robot.key("Ctrl+A")
    robot.type(str(path))
    robot.click_widget("files:accept")
    assert not app.session.dirty
    first = app.session
    app.window.play_event(Drop((str(path),)))
    robot.frames(3)
    assert app.session is not first
    assert constraints(robot) == before
    np.testing.assert_allclose(app.scene.vertices, posed, atol=1e-5)
    for _ in range(len(before)):
        robot.click_widget("point:0")
        robot.key("Delete")
    assert constraints(robot) == ()
    assert not app.dialogs.waiting
