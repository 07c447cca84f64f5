"""Distances by pointer: joined, pulled, removed, and taken back at each stage."""

import numpy as np
import pytest

from faceposer.model.face_model import FaceModel
from faceposer.solve.constraints.distance import DistanceConstraint
from faceposer.tools.distance_tool import add_distance, pair_marks
from tests.tools.context import HeadlessContext, along, check_stages, shifted, straight

NOSE, CHIN, LEFT, RIGHT = "9.3", "2.1", "8.3", "8.4"
BACKGROUND = (5.0, 5.0)


@pytest.fixture
def context(model: FaceModel) -> HeadlessContext:
    context = HeadlessContext(model)
    context.toolbox.choose("distance")
    return context


def mouth(context: HeadlessContext) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return two places a little inside the corners of the mouth, the character's right one first."""
    return shifted(context.feature(RIGHT), 3, 0), shifted(context.feature(LEFT), -3, 0)


def join(context: HeadlessContext) -> None:
    context.drag(*mouth(context))
    assert len(context.constraints) == 1


def test_a_drag_joins_two_points_as_far_apart_as_they_are(context: HeadlessContext) -> None:
    begin, end = mouth(context)
    check_stages(context, along(straight(begin, end, 4)))
    (pair,) = context.constraints
    assert isinstance(pair, DistanceConstraint)
    assert pair.target == pytest.approx(np.hypot(*np.subtract(begin, end)), abs=0.5)
    assert context.toolbox.selection == {0}
    np.testing.assert_allclose(context.vertices, context.session.model.character.vertices, atol=1e-3)


def test_two_clicks_join_as_a_drag_does(context: HeadlessContext) -> None:
    begin, end = mouth(context)
    context.click(begin)
    assert context.toolbox.distance_tool.first is not None
    assert context.constraints == ()
    assert "second" in context.toolbox.hint()
    context.click(end)
    assert context.toolbox.distance_tool.first is None
    (clicked,) = context.constraints
    context.undo()
    context.drag(begin, end)
    assert context.constraints == (clicked,)


def test_a_first_point_is_forgotten_by_escape_undo_and_another_tool(context: HeadlessContext) -> None:
    begin, end = mouth(context)
    tool = context.toolbox.distance_tool
    context.click(shifted(context.feature(NOSE), 0, 0))
    assert context.toolbox.cancel()
    assert tool.first is None
    join(context)
    context.click(context.feature(NOSE))
    context.undo()
    assert tool.first is None
    assert len(context.constraints) == 1, "undo stays inside what is begun"
    context.undo()
    assert context.constraints == ()
    context.click(begin)
    context.toolbox.choose("point")
    assert tool.first is None
    context.toolbox.choose("distance")
    context.send("press", begin)
    context.send("move", end)
    assert tool.pointer == end
    context.toolbox.cancel()
    assert tool.first is None
    assert tool.pointer is None


def test_joined_to_nothing_or_to_itself_there_is_no_distance(context: HeadlessContext) -> None:
    begin, _ = mouth(context)
    context.drag(begin, BACKGROUND)
    assert context.constraints == ()
    assert context.toolbox.distance_tool.first is None
    context.click(begin)
    context.click(begin)
    assert context.constraints == ()
    assert not context.session.can_undo


def test_an_end_pulls_the_distance_by_as_much(context: HeadlessContext) -> None:
    join(context)
    before = context.constraints[0].target
    _, end = mouth(context)
    check_stages(context, along(straight(end, shifted(end, 8, 0), 4)))
    assert context.constraints[0].target == pytest.approx(before + 8, abs=0.1)
    assert context.session.residuals_px[0] < 2.0
    measured = context.constraints[0].measured(context.session.model, context.session.coefficients)
    assert measured > before + 5
    context.drag(end, shifted(end, -500, 0))
    assert context.constraints[0].target == 0.0, "no distance is less than nothing"


def test_a_click_on_an_end_only_selects(context: HeadlessContext) -> None:
    join(context)
    document = context.session.document
    context.toolbox.cancel()
    assert not context.toolbox.selection
    context.click(mouth(context)[1])
    assert context.toolbox.selection == {0}
    assert context.session.document is document
    context.undo()
    assert not context.session.can_undo


@pytest.mark.parametrize("tool", ["distance", "point"])
def test_right_click_removes_and_undo_brings_back(context: HeadlessContext, tool: str) -> None:
    join(context)
    kept = context.constraints
    context.toolbox.choose(tool)
    context.click(BACKGROUND, "right")
    assert context.constraints == kept
    context.click(mouth(context)[0], "right")
    assert context.constraints == ()
    context.undo()
    assert context.constraints == kept


def test_locked_it_is_neither_dragged_nor_removed(context: HeadlessContext) -> None:
    join(context)
    context.change(0, locked=True)
    kept = context.constraints
    _, end = mouth(context)
    for tool in ("distance", "point"):
        context.toolbox.choose(tool)
        context.drag(end, shifted(end, 10, 0))
        assert context.constraints[0] == kept[0]
        context.click(end, "right")
        assert context.constraints[0] == kept[0]
    context.toolbox.select(0)
    assert not context.toolbox.delete_selected()
    assert not context.toolbox.nudge(1.0, 0.0)
    assert context.constraints[0] == kept[0]


def test_the_point_tool_grips_an_end_and_the_hover_tells(context: HeadlessContext) -> None:
    join(context)
    context.toolbox.choose("point")
    before = context.constraints[0].target
    end = mouth(context)[1]
    context.send("hover", end, None)
    assert context.toolbox.hover is not None
    assert context.toolbox.hover.pin == 0
    context.drag(end, shifted(end, 6, 0))
    assert len(context.constraints) == 1
    assert context.constraints[0].target == pytest.approx(before + 6, abs=0.1)


def test_from_behind_an_end_is_out_of_reach(context: HeadlessContext) -> None:
    join(context)
    kept = context.constraints
    context.view = context.view.looking("back")
    (mark,) = pair_marks(context)
    assert mark.goal is None
    end = tuple(mark.ends[1].tolist())
    context.drag(end, shifted(end, 15, 0))
    context.toolbox.cancel()
    assert context.constraints[0] == kept[0]
    context.click(end, "right")
    assert kept[0] in context.constraints
    assert context.toolbox.distance_tool.handle_at(end, context) is None


def test_from_another_view_it_is_taken_as_seen_there(context: HeadlessContext) -> None:
    join(context)
    context.view = context.view.looking("three-quarter")
    pose = context.vertices
    end = shifted(context.feature(LEFT), 0, 0)
    context.drag(end, shifted(end, 0.5, 0.0), steps=2)
    assert context.constraints[0].camera == context.camera
    assert np.abs(context.vertices - pose).max() < 0.3, "nothing jumps"


def test_a_ready_made_distance_is_added_once(context: HeadlessContext) -> None:
    features = context.session.model.character.feature_points
    for anchors in ((features["2.2"], features["2.3"]), (features["2.3"], features["2.2"])):
        context.toolbox.cancel()
        add_distance(anchors, context, context.toolbox.tool_settings)
        assert len(context.constraints) == 1
        assert context.toolbox.selection == {0}
    assert context.constraints[0].points.faces.tolist() == [-1 - features["2.2"], -1 - features["2.3"]]


def test_nudges_are_one_step_and_open_by_what_goes_up(context: HeadlessContext) -> None:
    join(context)
    before = context.constraints
    for _ in range(4):
        assert context.toolbox.nudge(0.0, -1.0)
        context.session.poll()
    assert context.constraints[0].target == pytest.approx(before[0].target + 4)
    context.undo()
    assert context.constraints == before
    context.redo()
    assert context.constraints[0].target == pytest.approx(before[0].target + 4)
