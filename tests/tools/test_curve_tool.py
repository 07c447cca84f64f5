"""Curves by pointer: clicked, accepted, edited point by point, and taken back at each stage."""

import numpy as np
import pytest

from faceposer.geometry.curves import curve_at, relaxed_bezier
from faceposer.model.face_model import FaceModel
from faceposer.solve.constraints.curve import CurveConstraint
from tests.tools.context import HeadlessContext, Pixel, along, check_stages, shifted, straight

LEFT, RIGHT = "8.3", "8.4"


@pytest.fixture
def context(model: FaceModel) -> HeadlessContext:
    context = HeadlessContext(model)
    context.toolbox.choose("curve")
    return context


def lip(context: HeadlessContext) -> list[Pixel]:
    begin, end = shifted(context.feature(RIGHT), 8, 8), shifted(context.feature(LEFT), -8, 8)
    return straight(begin, end, 4)


def draw(context: HeadlessContext) -> None:
    for place in lip(context):
        context.click(place)
    assert context.toolbox.accept()


def test_points_are_clicked_and_accepted_as_one_step(context: HeadlessContext) -> None:
    tool = context.toolbox.curve_tool
    assert not context.toolbox.accept()
    places = lip(context)
    for i, place in enumerate(places):
        context.click(place)
        assert len(tool.points) == i + 1
        assert ("Enter" in context.toolbox.hint()) == (i > 0)
        if i == 0:
            assert context.toolbox.accept()
            assert len(tool.points) == 1, "one point is no curve"
    np.testing.assert_allclose(tool.pixels(context), places, atol=0.5)
    assert context.constraints == ()
    assert context.toolbox.accept()
    assert tool.points == []
    (curve,) = context.constraints
    assert isinstance(curve, CurveConstraint)
    assert curve.source == curve.target
    assert context.toolbox.selection == {0}
    np.testing.assert_allclose(context.vertices, context.session.model.character.vertices, atol=1e-2)
    context.undo()
    assert context.constraints == ()
    context.redo()
    assert context.constraints == (curve,)


def test_undo_stays_inside_an_unaccepted_curve(context: HeadlessContext) -> None:
    draw(context)
    tool = context.toolbox.curve_tool
    context.toolbox.choose("point")
    context.toolbox.choose("curve")
    for place in lip(context):
        context.click(shifted(place, 0, -60))
    for left in (3, 2, 1, 0):
        context.undo()
        assert len(tool.points) == left
        assert len(context.constraints) == 1
    context.undo()
    assert context.constraints == ()


def test_undo_takes_back_inserting_moving_and_removing_a_source_point(context: HeadlessContext) -> None:
    tool = context.toolbox.curve_tool
    first, _, _, last = places = lip(context)
    context.click(first)
    context.click(last)
    line = tool.pixels(context)
    middle = tuple(curve_at(relaxed_bezier(line), [0.5])[0][0].tolist())
    context.click(middle)
    inserted = list(tool.points)
    np.testing.assert_allclose(tool.pixels(context)[1], middle, atol=0.5)
    context.drag(middle, shifted(middle, 0, -15))
    moved = list(tool.points)
    assert moved != inserted
    context.click(places[0], "right")
    assert tool.points == moved[1:]
    context.undo()
    assert tool.points == moved
    context.undo()
    assert tool.points == inserted
    context.undo()
    np.testing.assert_allclose(tool.pixels(context), line)


def test_escape_takes_back_a_point_and_then_the_curve(context: HeadlessContext) -> None:
    tool = context.toolbox.curve_tool
    places = lip(context)
    context.click(places[0])
    before = list(tool.points)
    for events in (along(places[1:]), along(straight(places[0], shifted(places[0], 0, 20)))):
        for count in range(1, len(events)):
            for event in events[:count]:
                context.send(*event)
            assert context.toolbox.cancel()
            assert tool.points == before
            assert tool.step_back()
            assert tool.points == []
            context.click(places[0])
            before = list(tool.points)
    assert context.toolbox.cancel()
    assert tool.points == []
    context.click(places[0])
    context.toolbox.choose("point")
    assert tool.points == []


def test_a_target_point_is_dragged_while_the_face_follows(context: HeadlessContext) -> None:
    draw(context)
    before = context.constraints[0]
    at = before.target[1]
    check_stages(context, along(straight(at, shifted(at, 0, 12), 4)))
    after = context.constraints[0]
    assert after.source == before.source
    assert after.target[1] == pytest.approx(shifted(at, 0, 12))
    assert after.target[0] == before.target[0]
    lips = context.session.model.character.regions["lip_lower"]
    assert (context.vertices - context.session.model.character.vertices)[lips, 1].min() < -0.1
    document = context.session.document
    context.click(after.target[1])
    assert context.session.document is document, "a click changes nothing"


def test_a_press_on_the_line_inserts_a_point_and_drags_it(context: HeadlessContext) -> None:
    draw(context)
    before = context.constraints[0]
    at = tuple(curve_at(relaxed_bezier(before.target), [1.5])[0][0].tolist())
    check_stages(context, along(straight(at, shifted(at, 0, 8), 3)))
    after = context.constraints[0]
    assert len(after.source) == len(after.target) == 5
    assert after.target[2] == pytest.approx(shifted(at, 0, 8))
    assert after.points == before.points
    assert context.session.undo_label == "Add a point to a curve"


def test_right_click_removes_points_and_then_the_curve(context: HeadlessContext) -> None:
    draw(context)
    before = context.constraints
    seen = [before]
    for left in (3, 2):
        context.click(context.constraints[0].target[1], "right")
        assert len(context.constraints[0].target) == left
        seen.append(context.constraints)
    context.click(context.constraints[0].target[0], "right")
    assert context.constraints == ()
    for constraints in reversed(seen):
        context.undo()
        assert context.constraints == constraints


@pytest.mark.parametrize("tool", ["curve", "point"])
def test_locked_it_is_neither_edited_nor_removed(context: HeadlessContext, tool: str) -> None:
    draw(context)
    context.change(0, locked=True)
    kept = context.constraints[0]
    context.toolbox.choose(tool)
    at = kept.target[1]
    context.click(at, "right")
    context.drag(at, shifted(at, 0, 10))
    assert context.constraints[0] == kept
    context.toolbox.select(0)
    assert not context.toolbox.delete_selected()
    assert not context.toolbox.nudge(1.0, 0.0)


def test_the_point_tool_edits_a_target_too(context: HeadlessContext) -> None:
    draw(context)
    context.toolbox.choose("point")
    at = context.constraints[0].target[2]
    context.send("hover", at, None)
    assert context.toolbox.hover is not None
    assert context.toolbox.hover.pin == 0
    context.drag(at, shifted(at, 0, 9))
    assert [c.kind for c in context.constraints] == ["curve"]
    assert context.constraints[0].target[2] == pytest.approx(shifted(at, 0, 9))


def test_from_behind_its_points_are_out_of_reach(context: HeadlessContext) -> None:
    draw(context)
    kept = context.constraints
    at = kept[0].target[1]
    context.view = context.view.looking("back")
    assert context.toolbox.curve_tool.handle_at(at, context) is None
    context.click(at, "right")
    assert context.constraints == kept


def test_nudges_move_the_target_in_one_step(context: HeadlessContext) -> None:
    draw(context)
    before = context.constraints
    for _ in range(3):
        context.toolbox.nudge(0.0, 2.0)
        context.session.poll()
    np.testing.assert_allclose(np.subtract(context.constraints[0].target, before[0].target)[:, 1], 6.0)
    assert context.constraints[0].source == before[0].source
    context.undo()
    assert context.constraints == before


def test_a_curve_too_many_is_said_and_its_source_stays(
    context: HeadlessContext, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("faceposer.session.effort.MOST_DRAWN", 0)
    draw(context)
    assert context.constraints == ()
    assert context.notices[0].startswith("The curve is not kept: the session has too many strokes")
    assert len(context.toolbox.curve_tool.points) == len(lip(context))
    monkeypatch.undo()
    assert context.toolbox.accept()
    assert len(context.constraints) == 1
