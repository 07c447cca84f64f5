"""Sketches at the window, by pointer and keys alone, with the real recogniser."""

from typing import Any

import pytest

from faceposer.gui.features.sketch.feature import SketchFeature
from faceposer.gui.testing.scripted_user import Position, Robot
from faceposer.model.feature_curves import feature_curves
from faceposer.tools.sketch_tool import UNRECOGNISED
from tests.windows import OpenWindow

pytestmark = pytest.mark.gl


@pytest.fixture
def robot(open_window: OpenWindow) -> Robot:
    robot = open_window("man", (1100, 900), pictures=False)
    robot.key("E")
    return robot


def sketches(robot: Robot) -> tuple[Any, ...]:
    return robot.app.session.document.constraints


def features(robot: Robot) -> list[str]:
    return [sketch.feature for sketch in sketches(robot)]


def way_of(robot: Robot, feature: str, dy: float = 0.0) -> list[Position]:
    """Return a way along ``feature`` of the present face, ``dy`` pixels beside it."""
    app = robot.app
    points = feature_curves(app.session.model.character)[feature][0].points
    places = app.session.model.positions_at(points, app.session.coefficients)
    pixels = app.viewport.camera.project(places) + app.viewport.origin + (0.0, dy)
    return [(u, v) for u, v in pixels[::6].tolist()] + [(float(pixels[-1, 0]), float(pixels[-1, 1]))]


def scribble(robot: Robot) -> list[Position]:
    x, y = robot.at("9.3")
    return [(x - 60 + 4 * i, y - 120 + 80 * (i % 2)) for i in range(30)]


def test_a_brow_is_drawn_named_and_listed(robot: Robot) -> None:
    app = robot.app
    vertex = app.session.model.character.feature_points["4.3"]
    rest = float(app.scene.vertices[vertex, 1])
    robot.draw(way_of(robot, "left brow", -10.0))
    assert features(robot) == ["left brow"]
    assert float(app.scene.vertices[vertex, 1]) > rest + 0.2
    assert app.point_name(0) == "left brow"
    assert {"sketch:0:label", "sketch:0:list", "point:0", "detail:feature"} <= set(app.widget_rects)
    robot.key("Q")
    robot.key("Esc")
    robot.frames(2)
    assert "sketch:0:label" not in app.widget_rects, "names of all are shown with the tool alone"
    robot.click_widget("point:0")
    assert "sketch:0:label" in app.widget_rects, "and that of the selected one"
    robot.key("Delete")
    assert features(robot) == []
    robot.key("Ctrl+Z")
    robot.key("Ctrl+Z")
    assert features(robot) == []
    assert float(app.scene.vertices[vertex, 1]) == pytest.approx(rest, abs=1e-6)
    robot.key("Ctrl+Y")
    assert features(robot) == ["left brow"]


def test_the_stroke_in_progress_is_cancelled_by_esc(robot: Robot) -> None:
    robot.draw(way_of(robot, "left brow", -10.0), release=False)
    assert robot.app.toolbox.sketch_tool.drawing
    robot.key("Ctrl+Z")
    assert robot.app.toolbox.active, "undo waits for the end of the stroke"
    robot.key("Esc")
    robot.release()
    assert features(robot) == []
    assert not robot.app.session.can_undo


def test_the_name_is_clicked_for_the_next_feature(robot: Robot) -> None:
    app = robot.app
    robot.draw(way_of(robot, "inner upper lip", -2.0))
    (first,) = features(robot)
    robot.click_widget("sketch:0:label")
    (second,) = features(robot)
    assert second != first
    robot.click_widget("sketch:next")
    (third,) = features(robot)
    assert third != second
    for expected in (second, first):
        robot.key("Ctrl+Z")
        assert features(robot) == [expected]
    robot.click_widget("sketch:0:list")
    assert app.is_modal
    robot.click_widget("feature:jaw line")
    assert features(robot) == ["jaw line"]
    assert not app.is_modal
    robot.key("Ctrl+Z")
    robot.click_widget("sketch:0:list")
    robot.key("Esc")
    assert not app.is_modal
    assert features(robot) == [first]
    robot.click_widget("detail:feature")
    robot.click_widget(f"feature:{second}")
    assert features(robot) == [second]


def test_a_scribble_is_reported_and_can_be_named(robot: Robot) -> None:
    app = robot.app
    robot.draw(scribble(robot))
    assert features(robot) == []
    assert UNRECOGNISED in app.hint()
    assert not app.session.can_undo
    assert "sketch:unnamed:label" in app.widget_rects
    robot.key("Esc")
    assert "sketch:unnamed:label" not in app.widget_rects
    assert UNRECOGNISED not in app.hint()
    robot.draw(scribble(robot))
    robot.click_widget("sketch-name")
    robot.click_widget("feature:mouth line")
    assert features(robot) == ["mouth line"]
    robot.key("Ctrl+Z")
    robot.draw(scribble(robot))
    robot.click_widget("sketch:unnamed:list")
    robot.click_widget("feature:left brow")
    assert features(robot) == ["left brow"]


def test_the_method_is_a_step_of_the_history(robot: Robot) -> None:
    session = robot.app.session
    robot.draw(way_of(robot, "left brow", -10.0))
    posed = session.coefficients.copy()
    robot.click_widget("sketch-method:1")
    assert session.document.sketch_method == "paper"
    assert abs(session.coefficients - posed).max() > 1e-6
    robot.key("Ctrl+Z")
    assert session.document.sketch_method == "map"
    assert session.coefficients == pytest.approx(posed)


def test_symmetry_and_hidden_names(robot: Robot) -> None:
    robot.key("X")
    robot.draw(way_of(robot, "left brow", -10.0))
    assert features(robot) == ["left brow", "right brow"]
    robot.click_widget("point:1:visible")
    robot.key("Esc")
    robot.move((robot.app.viewport.origin[0] + 5, robot.app.viewport.origin[1] + 5))
    robot.frames(2)
    assert "sketch:0:label" in robot.app.widget_rects
    assert "sketch:1:label" not in robot.app.widget_rects
    robot.key("Ctrl+Z")
    assert features(robot) == []


def test_names_follow_the_turned_view(robot: Robot) -> None:
    app = robot.app
    robot.draw(way_of(robot, "left brow", -10.0))
    before = app.widget_rects["sketch:0:label"]
    robot.key("2")
    robot.frames(2)
    assert app.widget_rects["sketch:0:label"] != before
    robot.click_widget("its-view")
    assert app.widget_rects["sketch:0:label"] == pytest.approx(before, abs=1.5)
    robot.key("C")
    robot.frames(2)
    assert "sketch:0:label" not in app.widget_rects, "the neutral face has no names"


def test_the_recogniser_is_prepared_in_the_background(robot: Robot, monkeypatch: pytest.MonkeyPatch) -> None:
    import threading

    app = robot.app
    feature = app.feature(SketchFeature)
    gate = threading.Event()
    monkeypatch.setattr("faceposer.gui.features.sketch.feature.prepare_recognition", lambda model: gate.wait(30.0))
    feature._prepare(app.session.model)
    robot.draw(way_of(robot, "left brow", -10.0))
    assert features(robot) == []
    assert "Preparing" in app.hint()
    gate.set()
    feature.join()
    robot.frames(2)
    assert features(robot) == ["left brow"]
    assert "Preparing" not in app.hint()
