"""Trajectories by pointer: drawn over the face with the times of the pen."""

import numpy as np
import pytest
from numpy.typing import NDArray

from faceposer.model.face_model import FaceModel
from faceposer.tools.tool import PointerEvent
from faceposer.tools.trajectory_tool import TrajectoryTool
from tests.tools.context import HeadlessContext, Pixel, shifted

LEFT, RIGHT = "8.3", "8.4"


@pytest.fixture
def context(model: FaceModel) -> HeadlessContext:
    context = HeadlessContext(model)
    context.toolbox.choose("trajectory")
    return context


def tool_of(context: HeadlessContext) -> TrajectoryTool:
    return context.toolbox.trajectory_tool


def draw(context: HeadlessContext, begin: Pixel, dy: float, seconds: float = 1.0, count: int = 11) -> None:
    """Draw ``dy`` pixels down within ``seconds``, ever faster."""
    shares = np.linspace(0.0, 1.0, count)
    for i, share in enumerate(shares.tolist()):
        kind = "press" if i == 0 else "release" if i == count - 1 else "move"
        position = shifted(begin, 0.0, dy * share**2)
        context.toolbox.dispatch(PointerEvent(kind, position, "left", time=5.0 + seconds * share))  # type: ignore[arg-type]


def ends(way: NDArray[np.float64]) -> list[list[float]]:
    return way[[0, -1]].tolist()


def test_a_press_takes_the_feature_point_nearby_and_its_way_begins_there(context: HeadlessContext) -> None:
    features = context.session.model.character.feature_points
    corner = context.feature(LEFT)
    draw(context, shifted(corner, 3.0, 2.0), 20.0)
    (drawn,) = tool_of(context).drawn
    assert drawn.anchor == features[LEFT]
    np.testing.assert_allclose(ends(drawn.pixels), [corner, shifted(corner, 0.0, 20.0)], atol=1e-6)
    assert drawn.times[0] == 0.0
    assert drawn.times[-1] == pytest.approx(1.0)
    assert context.constraints == (), "the face waits"
    assert not context.session.can_undo


def test_times_are_those_of_the_pen_or_even(context: HeadlessContext) -> None:
    corner = context.feature(LEFT)
    draw(context, corner, 20.0, seconds=2.0)
    (drawn,) = tool_of(context).drawn
    timed = drawn.timed(30.0)
    assert len(timed) == 61
    np.testing.assert_allclose(ends(timed), ends(drawn.pixels))
    assert timed[30, 1] - corner[1] == pytest.approx(5.0, abs=0.2), "after half of the time, a quarter of the way"
    spread = drawn.spread(11)
    np.testing.assert_allclose(np.diff(spread[:, 1]), 2.0)
    np.testing.assert_allclose(ends(spread), ends(drawn.pixels))


def test_one_for_each_point_in_one_view(context: HeadlessContext) -> None:
    tool = tool_of(context)
    draw(context, context.feature(LEFT), 20.0)
    draw(context, context.feature(RIGHT), 20.0)
    draw(context, context.feature(LEFT), -10.0)
    assert len(tool.drawn) == 2, "a point has one"
    assert tool.drawn[1].pixels[-1, 1] < tool.drawn[1].pixels[0, 1]
    context.click(context.feature("2.1"))
    assert len(tool.drawn) == 2, "a click is none"
    context.view = context.view.looking("left")
    draw(context, context.feature("2.1"), 10.0)
    assert len(tool.drawn) == 2, "another view has no part in it"
    assert "view" in context.toolbox.hint()
    context.view = context.view.looking("front")
    context.size = (400, 400)
    seen = tool.drawn[0].seen_in(context.camera)
    assert seen is not None
    np.testing.assert_allclose(seen[0], context.feature(RIGHT), atol=1e-6)


def test_taken_back_removed_and_accepted(context: HeadlessContext) -> None:
    tool, toolbox = tool_of(context), context.toolbox
    assert not toolbox.accept()
    draw(context, context.feature(LEFT), 20.0)
    draw(context, context.feature(RIGHT), 20.0)
    context.undo()
    assert len(tool.drawn) == 1
    context.click(shifted(context.feature(LEFT), 0.0, 10.0), "right")
    assert tool.drawn == ()
    context.undo()
    assert len(tool.drawn) == 1
    tool.clear()
    context.undo()
    assert len(tool.drawn) == 1
    assert toolbox.accept()
    assert tool.accepted
    corner = context.feature(RIGHT)
    toolbox.dispatch(PointerEvent("press", corner, "left", time=1.0))
    toolbox.dispatch(PointerEvent("move", shifted(corner, 30.0, 0.0), "left", time=2.0))
    assert len(tool.drawing) == 2
    assert toolbox.cancel()
    assert tool.drawing == []
    assert len(tool.drawn) == 1
    toolbox.choose("point")
    assert len(tool.drawn) == 1, "another tool leaves them"


def test_drawings_follow_undo_and_redo_in_the_order_of_what_was_done(context: HeadlessContext) -> None:
    tool, session = tool_of(context), context.session
    draw(context, context.feature(LEFT), 20.0)
    first = tool.drawn
    session.set_prior_weight(2.0)
    draw(context, context.feature(RIGHT), 20.0)
    both = tool.drawn
    assert (len(first), len(both)) == (1, 2)
    context.undo()
    assert tool.drawn == first
    assert session.document.prior_weight == 2.0
    context.undo()
    assert tool.drawn == first
    assert session.document.prior_weight == 1.0
    context.undo()
    assert tool.drawn == ()
    context.redo()
    assert tool.drawn == first
    context.redo()
    assert session.document.prior_weight == 2.0
    context.redo()
    assert tool.drawn == both
    context.undo()
    draw(context, context.feature("2.1"), 10.0)
    drawn = tool.drawn
    context.redo()
    assert tool.drawn == drawn, "what is drawn anew takes the place of what was undone"


def test_what_was_drawn_goes_with_the_step_before_it_whatever_tool_undoes_that(context: HeadlessContext) -> None:
    tool, session = tool_of(context), context.session
    session.set_prior_weight(2.0)
    draw(context, context.feature(LEFT), 20.0)
    drawn = tool.drawn
    session.undo()
    tool.follow_history(session.depth)
    assert tool.drawn == ()
    session.redo()
    session.set_prior_weight(3.0)
    tool.follow_history(session.depth)
    assert tool.drawn == drawn


def test_what_the_hand_does_while_the_wheel_turns_is_left_out(context: HeadlessContext) -> None:
    corner, toolbox = context.feature(LEFT), context.toolbox
    toolbox.dispatch(PointerEvent("press", corner, "left", time=1.0))
    toolbox.dispatch(PointerEvent("move", shifted(corner, 10.0, 0.0), "left", time=1.5))
    toolbox.dispatch(PointerEvent("wheel", corner, time=1.6, wheel=2.0))
    toolbox.dispatch(PointerEvent("release", shifted(corner, 20.0, 0.0), "left", time=2.0))
    (drawn,) = tool_of(context).drawn
    np.testing.assert_allclose(ends(drawn.pixels), [corner, shifted(corner, 10.0, 0.0)], atol=1e-6)
    assert not tool_of(context).fits(context)


def test_symmetry_draws_on_the_other_side_too(context: HeadlessContext) -> None:
    features, tool = context.session.model.character.feature_points, tool_of(context)
    context.toolbox.tool_settings.symmetry.on = True
    corner = context.feature(LEFT)
    way = [shifted(corner, 2.0 * i, -i) for i in range(10)]
    for i, position in enumerate(way):
        kind = "press" if i == 0 else "release" if i == 9 else "move"
        context.toolbox.dispatch(PointerEvent(kind, position, "left", time=0.1 * i))  # type: ignore[arg-type]
    assert [one.anchor for one in tool.drawn] == [features[LEFT], features[RIGHT]]
    moved = tool.drawn[1].pixels[-1] - context.feature(RIGHT)
    np.testing.assert_allclose(moved, (-18.0, -9.0), atol=0.5)
    draw(context, context.feature("2.1"), 10.0)
    assert len(tool.drawn) == 3, "what lies in the middle has no other side"
    draw(context, context.feature(RIGHT), 10.0)
    assert len(tool.drawn) == 3, "each has its place taken"
    context.undo()
    assert tool.drawn[0].pixels[-1, 1] < corner[1], "both come back together"
