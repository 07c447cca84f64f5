"""Sketches at the window, by pointer and keys alone, with the real recogniser."""

import itertools
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from faceposer.gui.events import Drop
from faceposer.gui.features.sketch.feature import SketchFeature
from faceposer.gui.features.sketch.name_places import box_of_name, distance_to_box, leader, outer_end
from faceposer.gui.overlays.marks.sketch import apart
from faceposer.gui.testing.scripted_user import Position, Robot
from faceposer.gui.widgets.widget_rects import overlap
from faceposer.model.feature_curves import feature_curves
from faceposer.tools.sketch_tool import UNRECOGNISED
from tests.windows import OpenWindow

pytestmark = pytest.mark.gl


@pytest.fixture
def robot(open_window: OpenWindow) -> Robot:
    robot = open_window("man", (1100, 900))
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
    assert "sketch:unnamed:label" not in app.widget_rects
    robot.key("Ctrl+Z")
    assert features(robot) == []
    assert "sketch:unnamed:label" in app.widget_rects, "it is unnamed again"
    robot.click_widget("sketch:unnamed:list")
    robot.click_widget("feature:left brow")
    assert features(robot) == ["left brow"]


def test_strokes_without_a_name_wait_and_are_deleted(robot: Robot) -> None:
    app = robot.app
    robot.draw(way_of(robot, "left brow", -10.0))
    for dy in (0.0, 60.0):
        robot.draw([(x, y + dy) for x, y in scribble(robot)])
    assert {"sketch:unnamed:label", "sketch:unnamed-2:label"} <= set(app.widget_rects)
    robot.draw(way_of(robot, "right brow", -10.0))
    assert {"sketch:unnamed:label", "sketch:unnamed-2:label"} <= set(app.widget_rects)
    robot.key("Delete")
    assert features(robot) == ["left brow"], "the selected sketch is removed"
    assert len(app.toolbox.sketch_tool.unnamed) == 2
    for left in (1, 0):
        robot.key("Delete")
        assert len(app.toolbox.sketch_tool.unnamed) == left, "then the strokes from the last to the first"
    assert features(robot) == ["left brow"]
    robot.draw(scribble(robot))
    robot.key("Delete")
    assert app.toolbox.sketch_tool.unnamed == ()
    assert features(robot) == ["left brow"], "a stroke that is no feature is removed before what was selected"


def test_the_panel_of_many_sketches_shows_the_selected_one_and_its_settings(
    open_window: OpenWindow, monkeypatch: pytest.MonkeyPatch
) -> None:
    # The settings need more room than is assumed at first.
    monkeypatch.setattr("faceposer.gui.panels.constraints._BELOW", 3.0)
    robot = open_window("man", (1360, 830))
    app = robot.app
    robot.key("E")
    robot.key("X")
    features = (("left brow", -10.0), ("left upper lid", -4.0), ("left cheek line", 0.0), ("left lower lid", 4.0))
    for feature, dy in (*features, ("outer upper lip", -3.0), ("outer lower lip", 4.0), ("jaw line", 14.0)):
        robot.draw(way_of(robot, feature, dy))
    robot.frames(4)
    assert len(sketches(robot)) >= 9
    (chosen,) = app.toolbox.selection
    rects = [app.widget_rects[name] for name in (f"point:{chosen}", "delete", "sketch:next", "detail:weight", "save")]
    assert all(above[3] <= below[1] for above, below in itertools.pairwise(rects)), rects
    heights = [rect[3] - rect[1] for rect in rects[1:4]]
    assert max(heights) - min(heights) <= 1.0, "the settings are not cut"
    above = app.widget_rects[f"point:{chosen - 1}"]
    assert rects[0][3] - rects[0][1] >= above[3] - above[1] - 1.0, "nor is the row"


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


def test_names_keep_off_the_features(robot: Robot) -> None:
    app = robot.app
    way = way_of(robot, "left brow", -10.0)
    inner, outer = sorted([way[: len(way) // 2], way[2 * len(way) // 5 :]], key=lambda part: part[0][0])
    robot.draw(inner)
    assert features(robot) == ["left brow"]
    left, top, right, bottom = app.widget_rects["sketch:0:label"]
    brow = np.array(way_of(robot, "left brow"))
    covered = (brow[:, 0] > left) & (brow[:, 0] < right) & (brow[:, 1] > top) & (brow[:, 1] < bottom)
    assert not covered.any(), "the other half can be drawn"
    robot.draw(outer)
    assert features(robot) == ["left brow", "left brow"]
    labels = [name for name in app.widget_rects if name.startswith("sketch:") and name.endswith(":label")]
    assert len(labels) == 1, "a feature has one name"
    robot.draw(way_of(robot, "left upper lid", -3.0))
    robot.draw(way_of(robot, "left lower lid", 2.0))
    names = [name for name in app.widget_rects if name.startswith("sketch:") and name.endswith(":label")]
    boxes = [app.widget_rects[name] for name in names]
    assert len(boxes) == 3
    assert not any(overlap(a, b) for i, a in enumerate(boxes) for b in boxes[:i])


def test_a_name_with_no_free_place_is_shown() -> None:
    line = np.array([(40.0, 50.0), (60.0, 50.0)])
    everywhere = np.stack(np.meshgrid(np.arange(0.0, 100.0, 4.0), np.arange(0.0, 100.0, 4.0)), axis=-1).reshape(-1, 2)
    box = box_of_name(line, (30.0, 10.0), (100.0, 100.0), False, everywhere, 5.0, [(0.0, 0.0, 100.0, 100.0)])
    assert box is not None
    assert 0.0 <= box[0] < box[2] <= 100.0
    assert 0.0 <= box[1] < box[3] <= 100.0
    assert box_of_name(line + 90.0, (30.0, 10.0), (100.0, 100.0), False, everywhere, 5.0, []) is None
    assert distance_to_box((0.0, 0.0, 10.0, 10.0), (13.0, 14.0)) == pytest.approx(5.0)


def test_names_of_lines_that_meet_are_in_their_order_and_connected() -> None:
    upper = np.stack([np.linspace(100.0, 200.0, 30), 300.0 - 20.0 * np.sin(np.linspace(0.0, np.pi, 30))], axis=1)
    lines = [
        upper,
        (upper - (0.0, 300.0)) * (1.0, -0.2) + (0.0, 300.0),
        (upper - (0.0, 300.0)) * (1.0, -1.0) + (0.0, 300.0),
    ]
    obstacles = np.vstack(lines)
    boxes: list[tuple[float, float, float, float]] = []
    for line in lines:
        box = box_of_name(line, (60.0, 16.0), (600.0, 600.0), False, obstacles, 8.0, boxes)
        assert box is not None
        assert box[0] > 200.0
        boxes.append(box)
    assert not any(overlap(a, b) for i, a in enumerate(boxes) for b in boxes[:i])
    assert [box[1] for box in boxes] == sorted(box[1] for box in boxes)
    assert leader(boxes[0], outer_end(upper, False), 40.0) is None, "close to its line"
    begin, end = leader((300.0, 100.0, 360.0, 116.0), outer_end(upper, False), 40.0) or ((0.0, 0.0), (0.0, 0.0))
    assert begin == (300.0, 108.0)
    assert end == pytest.approx((200.0, 300.0))
    assert outer_end(upper, True) == pytest.approx((100.0, 300.0))


def test_knobs_do_not_cover_each_other() -> None:
    places = np.array([(0.0, 0.0), (20.0, 0.0), (23.0, 0.0), (26.0, 0.0), (50.0, 0.0)])
    assert apart(places, 6.0)[:, 0].tolist() == [0.0, 20.0, 26.0, 50.0]
    assert len(apart(places[:1], 6.0)) == 1
    assert len(apart(places[:0], 6.0)) == 0


def test_another_character_keeps_the_tool(robot: Robot) -> None:
    app = robot.app
    app.open_file("woman")
    robot.frames(3)
    assert app.session.model.character.name == "woman"
    assert app.toolbox.chosen is app.toolbox.sketch_tool
    robot.draw(way_of(robot, "left brow", -10.0))
    assert features(robot) == ["left brow"]


def test_sketching_over_a_photo_has_its_options_in_the_tab(robot: Robot, tmp_path: Path) -> None:
    robot.draw(way_of(robot, "left brow", -10.0))
    robot.click_widget("tab:Photo")
    robot.frames(2)
    assert "sketch-method:1" not in robot.app.widget_rects, "the tab begins with the photo to open"
    Image.fromarray(np.full((60, 80, 3), 90, dtype=np.uint8)).save(tmp_path / "one.png")
    robot.app.window.play_event(Drop((str(tmp_path / "one.png"),)))
    robot.frames(3)
    robot.key("Enter")
    robot.frames(3)
    robot.key("E")
    robot.click_widget("tab:Photo")
    robot.frames(3)
    assert {"sketch-method:1", "point:0", "detail:feature"} <= set(robot.app.widget_rects)
    robot.key("Q")
    robot.frames(2)
    assert "sketch-method:1" not in robot.app.widget_rects


def test_residuals_are_those_of_solved_poses(robot: Robot, monkeypatch: pytest.MonkeyPatch) -> None:
    app = robot.app
    robot.draw(way_of(robot, "left brow", -10.0))
    drawn, session = app.drawn_constraints, app.session
    before = drawn.residuals_px
    assert before == session.residuals_px
    monkeypatch.setattr(type(session), "solving", property(lambda _: True))
    monkeypatch.setattr(type(session), "_solve_if_live", lambda _: None)
    brow = session.document.constraints[0]
    with session.edit("Again"):
        session.replace(replace(session.document, constraints=(brow, brow), solved=False))
    assert not session.document.solved
    assert drawn.residuals_px == (*before, None)
    monkeypatch.undo()
    robot.frames(2)
    assert all(residual is not None for residual in drawn.residuals_px)


def test_the_recogniser_is_prepared_in_the_background(robot: Robot, monkeypatch: pytest.MonkeyPatch) -> None:
    import threading

    app = robot.app
    feature = app.feature(SketchFeature)
    gate = threading.Event()
    monkeypatch.setattr("faceposer.gui.features.sketch.feature.prepare_recognition", lambda model: gate.wait(30.0))
    feature._prepare(app.session.model)
    robot.draw(scribble(robot))
    robot.draw(way_of(robot, "left brow", -10.0))
    assert features(robot) == []
    assert len(app.toolbox.sketch_tool.waiting) == 2
    assert "Preparing" in app.hint()
    gate.set()
    feature.join()
    robot.draw(way_of(robot, "right brow", -10.0))
    robot.frames(2)
    assert features(robot) == ["left brow", "right brow"]
    assert len(app.toolbox.sketch_tool.unnamed) == 1, "nor is the stroke lost that is no feature"
    assert "Preparing" not in app.hint()
