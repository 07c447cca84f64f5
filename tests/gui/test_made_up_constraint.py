"""A kind of constraint that is registered can be listed, seen, set, nudged and removed in the window like any other."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from imgui_bundle import imgui

from faceposer.gui.overlays.painter import Painter
from faceposer.gui.panels.tool_bar import TOOL_ICONS
from faceposer.gui.testing.scripted_user import Robot
from faceposer.session.document import Document, read_document, write_document
from tests.made_up import MidpointConstraint, registered_constraint
from tests.windows import OpenWindow

pytestmark = pytest.mark.gl

LIPS = ("2.2", "2.3")


@pytest.fixture
def made_up() -> Iterator[None]:
    with registered_constraint():
        yield


@pytest.fixture
def robot(made_up: None, open_window: OpenWindow) -> Robot:
    return open_window("low", (1000, 900))


@pytest.fixture
def texts(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """What rows and tooltips write from now on."""
    written: list[str] = []
    add_text, text_unformatted = imgui.ImDrawList.add_text, imgui.text_unformatted

    def recorded_add(draw: imgui.ImDrawList, *arguments: Any) -> None:
        written.append(arguments[-1])
        add_text(draw, *arguments)

    def recorded_text(text: str) -> None:
        written.append(text)
        text_unformatted(text)

    monkeypatch.setattr(imgui.ImDrawList, "add_text", recorded_add)
    monkeypatch.setattr(imgui, "text_unformatted", recorded_text)
    return written


def midpoint(robot: Robot) -> MidpointConstraint:
    """Return a constraint that pulls the middle of the lips 15 pixels down."""
    app = robot.app
    vertices = tuple(app.session.model.character.feature_points[name] for name in LIPS)
    u, v = app.viewport.camera.project(app.scene.vertices[list(vertices)]).mean(axis=0).tolist()
    return MidpointConstraint((vertices[0], vertices[1]), (u, v + 15.0), app.viewport.camera)


def add(robot: Robot) -> MidpointConstraint:
    robot.app.session.add_constraint(midpoint(robot), "Set a midpoint")
    robot.frames(2)
    return shown(robot)


def shown(robot: Robot) -> Any:
    (constraint,) = robot.app.session.document.constraints
    return constraint


def test_the_face_follows_it(robot: Robot) -> None:
    before = robot.at(LIPS[1])
    add(robot)
    assert robot.at(LIPS[1])[1] > before[1] + 5.0
    assert robot.app.session.residuals_px[0] < 3.0


def test_it_is_listed_with_its_icon_its_place_and_its_noun(robot: Robot, texts: list[str]) -> None:
    add(robot)
    robot.move(robot.app.widget_rects.center("point:0"))
    texts.clear()
    # The tooltip waits for a moment of the real clock.
    for _ in range(600):
        robot.frames()
        if "Midpoint" in " ".join(texts):
            break
    assert TOOL_ICONS[MidpointConstraint.icon] in texts
    assert robot.app.point_name(0) == "middle of mouth height"
    written = " ".join(texts)
    assert written.count("middle of mouth height") > written.count("Midpoint: middle of mouth height") > 0


def test_it_appears_in_the_view_as_dots_at_its_points(robot: Robot, monkeypatch: pytest.MonkeyPatch) -> None:
    painted: list[np.ndarray] = []
    dots = Painter.dots

    def recorded(painter: Painter, pixels: np.ndarray, *style: Any) -> None:
        painted.append(pixels)
        dots(painter, pixels, *style)

    monkeypatch.setattr(Painter, "dots", recorded)
    add(robot)
    origin = np.array(robot.app.viewport.origin)
    np.testing.assert_allclose(painted[-1] + origin, [robot.at(name) for name in LIPS], atol=0.01)


def test_a_click_selects_it_and_its_weight_can_be_set(robot: Robot) -> None:
    add(robot)
    robot.click_widget("point:0")
    assert robot.app.toolbox.selection == {0}
    left, top, right, bottom = robot.app.widget_rects["detail:weight"]
    robot.drag((left + 0.2 * (right - left), (top + bottom) / 2), (right - 4, (top + bottom) / 2))
    assert shown(robot).weight > 20


def test_arrow_keys_nudge_it_and_undo_takes_it_back(robot: Robot) -> None:
    before = add(robot)
    robot.click_widget("point:0")
    robot.key("Down")
    robot.key("Shift+Right")
    assert shown(robot).target == pytest.approx((before.target[0] + 10.0, before.target[1] + 1.0))
    robot.key("Ctrl+Z")
    assert shown(robot) == before
    robot.key("Ctrl+Z")
    assert not robot.app.session.document.constraints
    robot.key("Ctrl+Y")
    assert shown(robot) == before


def test_it_can_be_disabled_locked_and_removed(robot: Robot) -> None:
    app = robot.app
    add(robot)
    robot.click_widget("point:0:on")
    assert not shown(robot).enabled
    robot.click_widget("point:0:lock")
    assert shown(robot).locked
    robot.key("Delete")
    assert shown(robot).locked, "a locked one stays"
    robot.click_widget("point:0:lock")
    robot.click_widget("point:0")
    robot.key("Delete")
    assert not app.session.document.constraints
    assert app.session.undo_label == "Remove a midpoint"
    robot.key("Ctrl+Z")
    assert not shown(robot).locked


def test_what_holds_it_back_is_named_by_its_noun(robot: Robot) -> None:
    app = robot.app
    first = add(robot)
    other = MidpointConstraint(first.anchors, (first.target[0], first.target[1] - 60.0), first.camera)
    app.session.add_constraint(other, "Set a midpoint")
    robot.frames(2)
    assert "Conflicts with middle of mouth height 2 (midpoint)." in app.drawn_constraints.conflicts.values()


def test_a_session_with_it_opens_and_is_saved(robot: Robot, tmp_path: Path) -> None:
    app = robot.app
    write_document(tmp_path / "a.json", Document("low", (midpoint(robot),)))
    app.open_file(tmp_path / "a.json")
    robot.frames(3)
    assert shown(robot).kind == "midpoint"
    robot.click_widget("point:0")
    robot.key("Left")
    robot.key("Ctrl+S")
    saved: Any = read_document(tmp_path / "a.json").constraints[0]
    assert saved.target == pytest.approx(shown(robot).target)
