"""Strokes by pointer: a source, a target, another target, and taken back at each stage."""

import numpy as np
import pytest

from faceposer.model.face_model import FaceModel
from faceposer.solve.constraints.stroke import StrokeConstraint
from tests.tools.context import HeadlessContext, Pixel, along, check_stages, shifted, straight

LEFT, RIGHT = "8.3", "8.4"
BACKGROUND = (5.0, 5.0)


@pytest.fixture
def context(model: FaceModel) -> HeadlessContext:
    context = HeadlessContext(model)
    context.toolbox.choose("stroke")
    return context


def lip(context: HeadlessContext, dy: float = 0.0) -> list[Pixel]:
    """Return a way across the lower lip, ``dy`` pixels lower."""
    begin, end = shifted(context.feature(RIGHT), 12, 8 + dy), shifted(context.feature(LEFT), -12, 8 + dy)
    return straight(begin, end, 6)


def draw(context: HeadlessContext, dy: float = 12.0) -> None:
    source, target = lip(context), lip(context, dy)
    context.follow(source)
    context.follow(target)


def test_a_source_waits_for_its_target(context: HeadlessContext) -> None:
    tool = context.toolbox.stroke_tool
    source, target = lip(context), lip(context, 12)
    hint = context.toolbox.hint()
    context.follow(source)
    assert tool.source is not None
    assert context.constraints == ()
    assert context.toolbox.hint() != hint
    waiting = tool.source
    for count in range(1, len(target)):
        for event in along(target)[:count]:
            context.send(*event)
        assert tool.drawing is not None
        context.undo()
        assert context.toolbox.cancel()
        assert tool.drawing is None
        assert tool.source is waiting, "Esc takes back the target, not the source"
    context.follow(target)
    (stroke,) = context.constraints
    assert isinstance(stroke, StrokeConstraint)
    assert stroke.placed == waiting.points
    assert tool.source is None
    assert context.toolbox.selection == {0}
    assert context.session.residuals_px[0] < 5
    lips = context.session.model.character.regions["lip_lower"]
    assert (context.vertices - context.session.model.character.vertices)[lips, 1].min() < -0.15
    posed = context.vertices
    context.undo()
    assert context.constraints == ()
    np.testing.assert_array_equal(context.vertices, context.session.model.character.vertices)
    context.redo()
    assert context.constraints == (stroke,)
    np.testing.assert_array_equal(context.vertices, posed)


def test_a_source_is_forgotten_by_escape_undo_and_another_tool(context: HeadlessContext) -> None:
    tool = context.toolbox.stroke_tool
    for forget in (context.toolbox.cancel, context.undo, lambda: context.toolbox.choose("point")):
        context.toolbox.choose("stroke")
        context.follow(lip(context))
        assert tool.draws_target
        forget()
        assert not tool.draws_target
        assert not context.session.can_redo
    context.toolbox.choose("stroke")
    draw(context)
    context.follow(lip(context))
    context.undo()
    assert len(context.constraints) == 1, "undo stays inside what is begun"


def test_a_source_begun_is_taken_back_by_escape(context: HeadlessContext) -> None:
    for count in range(1, 6):
        for event in along(lip(context))[:count]:
            context.send(*event)
        assert context.toolbox.cancel()
        assert context.toolbox.stroke_tool.drawing is None
        assert not context.toolbox.stroke_tool.draws_target


def test_beside_the_face_there_is_no_source_but_a_target(context: HeadlessContext) -> None:
    view = context.view
    context.drag(BACKGROUND, shifted(BACKGROUND, 40, 0))
    assert context.view != view, "the background orbits"
    context.view = view
    context.follow(lip(context))
    context.follow(straight((10, 10), (60, 10)))
    assert len(context.constraints) == 1
    assert context.view == view


@pytest.mark.parametrize("shape", ["line", "closed", "region"])
@pytest.mark.parametrize("energy", ["distance", "image"])
def test_the_options_make_the_stroke(context: HeadlessContext, shape: str, energy: str) -> None:
    options = context.toolbox.tool_settings.options
    options.shape, options.energy, options.brush = shape, energy, 5.0  # type: ignore[assignment]
    context.ui_scale = 2.0
    draw(context, 5.0)
    stroke = context.constraints[0]
    assert (stroke.shape, stroke.energy, stroke.width) == (shape, energy, 10.0)


def test_only_the_target_is_redrawn(context: HeadlessContext) -> None:
    draw(context)
    before = context.constraints[0]
    context.toolbox.stroke_tool.redraw(context.constraints[0])
    assert context.toolbox.stroke_tool.draws_target
    assert context.toolbox.cancel()
    assert not context.toolbox.stroke_tool.draws_target
    context.toolbox.stroke_tool.redraw(context.constraints[0])
    context.undo()
    assert context.constraints == (before,)
    context.toolbox.stroke_tool.redraw(context.constraints[0])
    context.follow(straight((350, 500), (430, 500)))
    (after,) = context.constraints
    assert after.placed == before.placed
    assert np.allclose(np.array(after.target)[:, 1], 500)
    context.undo()
    assert context.constraints == (before,)


def test_a_target_is_not_redrawn_for_another_stroke(context: HeadlessContext) -> None:
    draw(context)
    draw(context, -6.0)
    kept = context.constraints[1]
    context.toolbox.stroke_tool.redraw(context.constraints[0])
    context.session.remove_constraints({0}, "Remove a stroke")
    context.follow(straight((350, 500), (430, 500)))
    assert context.constraints == (kept,)


def test_shift_moves_a_target(context: HeadlessContext) -> None:
    draw(context)
    before = context.constraints[0]
    at = tuple(np.mean(before.target, axis=0).tolist())
    check_stages(context, along(straight(at, shifted(at, 5, -9), 4), "shift"))
    after = context.constraints[0]
    np.testing.assert_allclose(np.subtract(after.target, before.target), np.tile([5, -9], (len(after.target), 1)))
    assert after.placed == before.placed
    document = context.session.document
    context.click(shifted(at, 5, -9), "left", "shift")
    assert context.session.document is document, "a click moves nothing"


def test_right_click_removes_only_on_the_target(context: HeadlessContext) -> None:
    draw(context)
    kept = context.constraints
    at = tuple(np.mean(kept[0].target, axis=0).tolist())
    context.click(shifted(at, 0, 60), "right")
    assert context.constraints == kept
    context.click(at, "right")
    assert context.constraints == ()
    context.undo()
    assert context.constraints == kept


def test_locked_it_is_neither_moved_redrawn_nor_removed(context: HeadlessContext) -> None:
    draw(context)
    context.change(0, locked=True)
    kept = context.constraints
    at = tuple(np.mean(kept[0].target, axis=0).tolist())
    context.drag(at, shifted(at, 0, 9), "left", "shift")
    context.click(at, "right")
    context.toolbox.stroke_tool.redraw(context.constraints[0])
    context.follow(straight((350, 500), (430, 500)))
    context.toolbox.select(0)
    assert not context.toolbox.nudge(1.0, 1.0)
    assert not context.toolbox.delete_selected()
    assert context.constraints == kept


def test_nudges_are_one_step(context: HeadlessContext) -> None:
    draw(context)
    before = context.constraints
    for _ in range(3):
        context.toolbox.nudge(1.0, 0.0)
        context.session.poll()
    np.testing.assert_allclose(np.subtract(context.constraints[0].target, before[0].target)[:, 0], 3.0)
    context.undo()
    assert context.constraints == before


def test_in_another_view_its_target_is_out_of_reach(context: HeadlessContext) -> None:
    draw(context)
    kept = context.constraints
    at = tuple(np.mean(kept[0].target, axis=0).tolist())
    context.view = context.view.looking("back")
    context.click(at, "right")
    context.drag(at, shifted(at, 9, 9), "left", "shift")
    assert context.constraints == kept


@pytest.mark.parametrize("stage", ["source", "target", "redrawn"])
def test_a_stroke_that_covers_too_much_is_said_and_can_be_drawn_again(context: HeadlessContext, stage: str) -> None:
    tool, options = context.toolbox.stroke_tool, context.toolbox.tool_settings.options
    if stage == "redrawn":
        draw(context)
        (stroke,) = context.constraints
        assert isinstance(stroke, StrokeConstraint)
        tool.redraw(stroke)
    elif stage == "target":
        context.follow(lip(context))
    before, depth = context.constraints, context.session.depth
    options.shape = "filled"
    start = lip(context)[0]
    context.follow([start, shifted(start, 3000, 0), shifted(start, 3000, 3000), shifted(start, 0, 3000)])
    assert context.notices == ["The stroke is not kept: it covers more than 4 million pixels"]
    assert context.constraints == before
    assert context.session.depth == depth
    assert tool.draws_target == (stage != "source"), "what was drawn before waits for another target"
    options.shape = "line"
    context.follow(lip(context, 12))
    if stage == "source":
        context.follow(lip(context, 12))
    assert len(context.constraints) == 1
    assert len(context.notices) == 1


def test_strokes_that_together_cover_too_much_are_said(
    context: HeadlessContext, monkeypatch: pytest.MonkeyPatch
) -> None:
    draw(context)
    monkeypatch.setattr("faceposer.session.effort.MOST_EFFORT", 1.0)
    before, depth = context.constraints, context.session.depth
    draw(context)
    assert context.notices == [
        "The stroke is not kept: the session has too many strokes, or they cover too many pixels"
    ]
    assert (context.constraints, context.session.depth) == (before, depth)
