"""The list of constraints and what is around it: room, scrolling, and buttons that stay under the pointer."""

import numpy as np
import pytest
from imgui_bundle import imgui

from faceposer.gui.features.timeline.feature import TimelineFeature
from faceposer.gui.features.timeline.panel import state_of
from faceposer.gui.testing.scripted_user import Robot
from faceposer.solve.constraints.point import PointConstraint
from tests.windows import OpenWindow


@pytest.fixture
def robot(open_window: OpenWindow) -> Robot:
    return open_window("low", (1100, 900))


def pull(robot: Robot, name: str = "8.3") -> None:
    x, y = robot.at(name)
    robot.drag((x, y), (x + 8, y - 10))


def pin(robot: Robot, count: int) -> None:
    """Pin ``count`` feature points where they are."""
    app = robot.app
    vertices = list(app.session.model.character.feature_points.values())[:count]
    pixels = app.viewport.camera.project(app.scene.vertices[vertices]).tolist()
    for vertex, (u, v) in zip(vertices, pixels, strict=True):
        app.session.add_constraint(PointConstraint(vertex, (u, v), app.viewport.camera), "Pin")
    robot.frames(3)


def listed() -> float:
    """Return the scroll range of the list."""
    shown = next(w for w in imgui.get_current_context().windows if w.active and "##constraints" in w.name)
    return float(shown.scroll_max.y)


def test_the_list_takes_the_room_of_the_panel(robot: Robot) -> None:
    pin(robot, 9)
    assert listed() == 0.0, "more than eight fit"
    robot.app.window.set_size((1100, 560))
    robot.frames(3)
    assert listed() > 0.0


def test_the_list_scrolls_to_what_is_selected(robot: Robot) -> None:
    app = robot.app
    app.window.set_size((1100, 760))
    pin(robot, 25)
    top, bottom = app.widget_rects["tab:Pose"][3], app.widget_rects["save"][1]
    for index in (24, 0, 12):
        app.toolbox.select(index)
        robot.frames(3)
        rect = app.widget_rects._visible[f"point:{index}"][1]
        assert rect == app.widget_rects[f"point:{index}"], "all of the row is visible"
        assert top < rect[1] < rect[3] < bottom


def test_the_first_fixed_area_moves_no_button(robot: Robot) -> None:
    app = robot.app
    robot.key("H")
    robot.frames(3)
    before = app.widget_rects["hold:Nose"]
    robot.click_widget("hold:Nose")
    robot.frames(3)
    assert app.session.document.constraints
    assert app.widget_rects["hold:Nose"] == before


def test_a_hidden_pin_is_out_of_reach(robot: Robot) -> None:
    app = robot.app
    pull(robot)
    x, y = app.session.document.constraints[0].target
    at = (x + app.viewport.origin[0], y + app.viewport.origin[1])
    robot.move(at)
    assert app.toolbox.hover.pin == 0
    robot.click_widget("point:0:visible")
    robot.move(at)
    assert app.toolbox.hover.pin is None
    robot.drag(at, (at[0] + 10, at[1]))
    assert len(app.session.document.constraints) == 2


def test_the_waiting_badge_is_for_solving_on_apply_only(robot: Robot, monkeypatch: pytest.MonkeyPatch) -> None:
    from faceposer.gui import layout

    said: list[str] = []
    badge = layout.draw_badge
    monkeypatch.setattr(layout, "draw_badge", lambda *given, **more: (said.append(given[2]), badge(*given, **more))[1])
    monkeypatch.setattr(type(robot.app.session), "pending", property(lambda _: True))
    robot.frames(2)
    assert not any("solve" in text for text in said)
    robot.app.set_mode("apply")
    robot.frames(2)
    assert any("solve" in text for text in said)


def test_the_name_of_a_distance_is_beside_its_length(robot: Robot) -> None:
    app = robot.app
    robot.key("D")
    robot.click_widget("measure:mouth height")
    mark = app.drawn_constraints.marks[0]
    middle = mark.pair.ends.mean(axis=0)
    assert mark.anchor[1] - middle[1] >= 0.5 * (imgui.get_font_size() + imgui.get_font_size() + 10.0)


def test_after_the_last_key_is_not_between_keys(robot: Robot) -> None:
    app = robot.app
    pull(robot)
    feature = app.features[TimelineFeature]
    feature.go_to(10)
    robot.key("I")
    feature.go_to(20)
    robot.key("R")
    robot.key("I")
    robot.frames(2)
    labels = {}
    for frame in (0, 10, 15, 30):
        feature.go_to(frame)
        robot.frames(2)
        labels[frame] = state_of(feature.editor)[0]
    assert labels == {0: "Before the first key", 10: "Key", 15: "Between keys", 30: "After the last key"}


def test_help_does_not_open_over_a_gesture(robot: Robot) -> None:
    app = robot.app
    x, y = robot.at("8.3")
    robot.move((x, y))
    robot.press()
    robot.move((x + 10, y - 10), 3)
    robot.key("F1")
    assert not app.dialogs.open
    assert app.toolbox.active
    robot.release()
    assert len(app.session.document.constraints) == 1
    robot.key("F1")
    assert app.dialogs.open


def test_keys_can_be_taken_from_another_action(robot: Robot) -> None:
    app = robot.app
    app.actions["preferences"].run()
    robot.frames(6)
    robot.click_widget("preferences:keymap")
    robot.frames(4)
    robot.click_widget("keymap:new")
    robot.key("Ctrl+O")
    robot.frames(2)
    assert "Ctrl+O" in app.actions["open"].keys
    robot.click_widget("preferences:reassign")
    robot.frames(2)
    assert app.actions["new"].keys == ("Ctrl+O",)
    assert "Ctrl+O" not in app.actions["open"].keys
    assert "preferences:reassign" not in app.widget_rects
    robot.click_widget("preferences:filter")
    robot.type("ctrl+")
    robot.frames(2)
    assert "keymap:undo" in app.widget_rects
    assert "keymap:wireframe" not in app.widget_rects
    np.testing.assert_equal(app.settings.keys["open"], [])
