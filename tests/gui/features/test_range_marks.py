"""How far a point can go, and how far the face spreads a pull: seen, heard of and set at the window."""

import json
from pathlib import Path

import numpy as np
import pytest

from faceposer.gui.features.range_marks.feature import BEYOND_TEXT, HARDLY_MOVES_TEXT, RangeMarksFeature
from faceposer.gui.testing.scripted_user import Robot
from faceposer.session.document import read_document
from faceposer.solve.problem import SPREAD
from tests.windows import OpenWindow

pytestmark = pytest.mark.gl

CORNER, HAIRLINE, BRIDGE = "8.3", "11.1", "9.12"


@pytest.fixture
def robot(open_window: OpenWindow) -> Robot:
    return open_window("man", pictures=True)


def marks(robot: Robot) -> RangeMarksFeature:
    return robot.app.features[RangeMarksFeature]


def said(robot: Robot) -> str:
    return robot.app.features.hint or robot.app.hint()


def hover(robot: Robot, x: float, y: float) -> None:
    robot.move((x, y))
    robot.frames(2)


def around(robot: Robot, x: float, y: float, size: int = 70) -> np.ndarray:
    picture = robot.app.screenshot().astype(np.int64)
    return picture[int(y) - size : int(y) + size, int(x) - size : int(x) + size]


def test_hovering_outlines_how_far_the_point_can_go_and_the_menu_hides_it(robot: Robot) -> None:
    x, y = robot.at(CORNER)
    x -= 2.0
    hover(robot, x, y)
    shown = around(robot, x, y)
    assert said(robot).startswith("Drag: pull the face here")
    hide = robot.app.actions["range-marks"]
    assert hide.menu == "View"
    hide.run()
    robot.frames(2)
    assert hide.checked is not None
    assert not hide.checked()
    assert not robot.app.settings.range_marks
    changed = np.abs(shown - around(robot, x, y)).sum(axis=2) > 12
    assert 60 < changed.sum() < 0.4 * changed.size, "a line around the pointer, no more"
    rows, columns = np.nonzero(changed)
    assert np.hypot(rows - 70, columns - 70).max() > 15.0


def test_the_range_is_worked_out_once_for_each_triangle(robot: Robot) -> None:
    x, y = robot.at("5.1")
    hover(robot, x, y)
    before = marks(robot).computed
    assert before > 0
    hover(robot, x + 0.05, y)
    hover(robot, x, y)
    assert marks(robot).computed == before
    hover(robot, x + 25.0, y - 10.0)
    assert marks(robot).computed == before + 1
    hover(robot, 80.0, 300.0)
    assert marks(robot).computed == before + 1, "nothing is looked at where there is no face"


def test_a_part_that_hardly_moves_says_so_before_the_pull(robot: Robot) -> None:
    for place, dy in ((HAIRLINE, 8.0), (BRIDGE, 0.0)):
        x, y = robot.at(place)
        hover(robot, x, y + dy)
        assert said(robot) == HARDLY_MOVES_TEXT
        robot.press()
        assert said(robot) == HARDLY_MOVES_TEXT
        before = robot.app.scene.vertices.copy()
        robot.move((x + 30.0, y - 60.0), 4)
        assert np.abs(robot.app.scene.vertices - before).max() < 0.1
        robot.release()
        index = len(robot.app.session.document.constraints) - 1
        assert robot.app.drawn_constraints.conflicts[index] == "Not reached: this part of the face hardly moves."


def test_a_point_dragged_beyond_its_range_says_so(robot: Robot) -> None:
    x, y = robot.at(CORNER)
    robot.move((x - 2.0, y))
    robot.press()
    robot.move((x + 8.0, y - 8.0), 3)
    assert BEYOND_TEXT not in said(robot)
    robot.move((x + 160.0, y - 120.0), 4)
    assert said(robot).startswith(BEYOND_TEXT)
    robot.release()
    assert robot.app.drawn_constraints.conflicts[0] == "Not reached: this part of the face cannot move that far."
    robot.key("Ctrl+Z")
    assert not robot.app.session.document.constraints


def test_a_pin_shows_its_range_until_undo_takes_it_away(robot: Robot) -> None:
    x, y = robot.at(CORNER)
    robot.click((x - 2.0, y))
    robot.frames(2)
    assert marks(robot).has_range
    robot.key("Ctrl+Z")
    robot.frames(2)
    assert not robot.app.dialogs.open
    assert not robot.app.session.document.constraints


def test_other_tools_show_no_range(robot: Robot) -> None:
    x, y = robot.at(HAIRLINE)
    robot.key("S")
    hover(robot, x, y + 8.0)
    assert HARDLY_MOVES_TEXT not in said(robot)


def test_spread_by_its_slider_is_one_step_and_live(robot: Robot) -> None:
    app = robot.app
    x, y = robot.at(CORNER)
    robot.drag((x - 2.0, y), (x + 10.0, y - 12.0))
    left, top, right, bottom = app.widget_rects["spread"]
    middle = 0.5 * (top + bottom)
    usual = app.scene.vertices.copy()
    robot.move((0.5 * (left + right), middle))
    robot.press()
    robot.move((right - 2.0, middle), 4)
    assert app.session.document.spread == 1.0
    during = app.scene.vertices.copy()
    assert np.abs(during - usual).max() > 0.05, "the face follows while the slider is dragged"
    robot.release()
    assert app.session.undo_label == "Change the spread"
    robot.click_widget("spread:reset")
    assert app.session.document.spread == SPREAD
    robot.key("Ctrl+Z")
    assert app.session.document.spread == 1.0
    robot.key("Ctrl+Z")
    assert app.session.document.spread == SPREAD
    np.testing.assert_allclose(app.scene.vertices, usual, atol=1e-6)
    assert app.session.undo_label == "Place a point"


def test_esc_takes_the_drag_of_the_spread_back(robot: Robot) -> None:
    app = robot.app
    left, top, right, bottom = app.widget_rects["spread"]
    robot.move((0.5 * (left + right), 0.5 * (top + bottom)))
    robot.press()
    robot.move((right - 10.0, 0.5 * (top + bottom)), 3)
    assert app.session.document.spread > 0.8
    robot.key("Esc")
    robot.release()
    assert app.session.document.spread == SPREAD
    assert not app.session.can_undo


def test_a_session_keeps_its_spread(robot: Robot, tmp_path: Path) -> None:
    app = robot.app
    usual, local = tmp_path / "usual.json", tmp_path / "local.json"
    app.session.save(usual)
    app.session.set_spread(0.0)
    assert app.session.dirty
    app.session.save(local)
    assert "spread" not in json.loads(usual.read_text())
    assert json.loads(local.read_text())["spread"] == 0.0
    assert read_document(local).spread == 0.0
    app.files.open(str(local))
    robot.frames(2)
    assert app.session.document.spread == 0.0


def test_other_priors_are_under_advanced(robot: Robot) -> None:
    app = robot.app
    assert "prior:1" not in app.widget_rects
    robot.click_widget("advanced")
    robot.click_widget("prior:1")
    assert app.session.document.prior == "whole"
    spread = app.widget_rects.center("spread")
    robot.drag(spread, (spread[0] + 30.0, spread[1]))
    assert app.session.document.spread == SPREAD, "the whole face knows no spread"
    robot.key("Ctrl+Z")
    assert app.session.document.prior == "regions"
    robot.click_widget("advanced")
    assert "prior:1" not in app.widget_rects
