"""The handle of the eyes by pointer: dragged, let go, locked, and taken back at each stage."""

import numpy as np
import pytest

from faceposer.model.face_model import FaceModel
from faceposer.solve.constraints.gaze import MOST_PITCH, MOST_YAW, GazeConstraint, gaze_direction
from faceposer.tools.gaze_tool import pupil_centres_of
from tests.tools.context import HeadlessContext, along, check_stages, shifted, straight

CORNER = "8.3"


@pytest.fixture
def context(model: FaceModel) -> HeadlessContext:
    context = HeadlessContext(model)
    context.toolbox.choose("gaze")
    return context


def handle(context: HeadlessContext) -> tuple[float, float]:
    found = context.toolbox.gaze_tool.handle(context)
    assert found is not None
    return found


def turn(context: HeadlessContext, dx: float, dy: float) -> None:
    context.drag(handle(context), shifted(handle(context), dx, dy))


def test_the_eyes_follow_the_handle_and_the_mouth_does_not(context: HeadlessContext) -> None:
    begin = handle(context)
    check_stages(context, along(straight(begin, shifted(begin, 60, -40), 4)))
    (gaze,) = context.constraints
    assert isinstance(gaze, GazeConstraint)
    assert gaze.direction[0] > 5
    assert gaze.direction[1] > 3
    model, pose = context.session.model, context.session.coefficients
    np.testing.assert_allclose(gaze_direction(model, pose), gaze.direction, atol=0.3)
    assert context.session.residuals_px[0] < 3
    lips = model.character.regions["lip_lower"]
    assert np.abs(context.vertices - model.character.vertices)[lips].max() < 0.02
    np.testing.assert_allclose(handle(context), shifted(begin, 60, -40), atol=0.5)


def test_a_second_drag_goes_on_from_the_first(context: HeadlessContext) -> None:
    turn(context, 50, 0)
    begin = handle(context)
    check_stages(context, along(straight(begin, shifted(begin, -90, 10), 4)))
    assert len(context.constraints) == 1
    assert context.constraints[0].direction[0] < 0


def test_grabbed_beside_its_middle_the_handle_does_not_jump(context: HeadlessContext) -> None:
    begin = handle(context)
    context.drag(shifted(begin, 8, 6), shifted(begin, 38, 6))
    np.testing.assert_allclose(handle(context), shifted(begin, 30, 0), atol=0.5)


def test_eyes_turn_no_farther_than_they_can(context: HeadlessContext) -> None:
    turn(context, 2000, 0)
    yaw = context.constraints[0].direction[0]
    assert yaw == pytest.approx(MOST_YAW, abs=2)
    turn(context, 0, 2000)
    pitch = context.constraints[0].direction[1]
    assert -MOST_PITCH <= pitch < -10


def test_a_click_leaves_nothing(context: HeadlessContext) -> None:
    for position in (handle(context), context.feature(CORNER), (5.0, 5.0)):
        context.click(position)
        assert not context.session.can_undo
        assert context.constraints == ()


@pytest.mark.parametrize("place", ["mouth", "corner of the view"])
def test_the_handle_follows_a_drag_anywhere_in_the_view(context: HeadlessContext, place: str) -> None:
    view, before = context.view, handle(context)
    begin = context.feature(CORNER) if place == "mouth" else (5.0, 5.0)
    context.drag(begin, shifted(begin, 40, -20))
    assert context.view == view
    np.testing.assert_allclose(handle(context), shifted(before, 40, -20), atol=0.5)
    context.undo()
    assert context.constraints == ()


def test_elsewhere_than_on_the_handle_the_point_tool_drags_points(context: HeadlessContext) -> None:
    turn(context, 50, 0)
    context.toolbox.choose("point")
    corner = context.feature(CORNER)
    context.drag(corner, shifted(corner, 8, -8))
    assert [constraint.kind for constraint in context.constraints] == ["gaze", "point"]


@pytest.mark.parametrize("direction", [(0.0, 0.0), (25.0, 10.0), (-25.0, -15.0)])
def test_lines_begin_at_the_pupils_that_one_sees(model: FaceModel, direction: tuple[float, float]) -> None:
    character = model.character
    pupils = pupil_centres_of(character, direction)
    assert pupils is not None
    constraint = GazeConstraint(direction)
    posed = model.instance(constraint.offset_start(model, model.neutral()))
    for name, pupil in zip(("3.5", "3.6"), sorted(pupils, key=lambda place: -place[0]), strict=True):
        seen = posed[character.feature_points[name]]
        assert np.linalg.norm(pupil - seen) < 0.45, "centimetres"


@pytest.mark.parametrize("tool", ["gaze", "point"])
def test_right_click_lets_the_eyes_go(context: HeadlessContext, tool: str) -> None:
    turn(context, 60, 0)
    kept = context.constraints
    context.toolbox.choose(tool)
    context.click(handle(context), "right")
    assert context.constraints == ()
    np.testing.assert_allclose(context.vertices, context.session.model.character.vertices, atol=1e-3)
    context.undo()
    assert context.constraints == kept


def test_locked_the_handle_stays(context: HeadlessContext) -> None:
    turn(context, 60, 0)
    context.change(0, locked=True)
    kept = context.constraints
    for tool in ("gaze", "point"):
        context.toolbox.choose(tool)
        view = context.view
        context.drag(handle(context), shifted(handle(context), -40, 0))
        assert context.constraints[0] == kept[0]
        context.view = view
        context.click(handle(context), "right")
        assert context.constraints[0] == kept[0]
    context.toolbox.select(0)
    assert not context.toolbox.delete_selected()


def test_the_point_tool_grips_the_handle_only_where_the_eyes_follow(context: HeadlessContext) -> None:
    context.toolbox.choose("point")
    turn(context, 0, -12)
    assert [c.kind for c in context.constraints] == ["point"]
    context.undo()
    context.toolbox.choose("gaze")
    turn(context, 60, 0)
    context.toolbox.choose("point")
    context.send("hover", handle(context), None)
    assert context.toolbox.hover is not None
    assert context.toolbox.hover.pin == 0
    turn(context, 20, 0)
    assert [c.kind for c in context.constraints] == ["gaze"]


def test_from_behind_the_head_hides_the_handle(context: HeadlessContext) -> None:
    turn(context, 10, 0)
    kept = context.constraints
    context.view = context.view.looking("back")
    at = handle(context)
    assert context.pick(at) is not None
    context.click(at, "right")
    assert context.constraints == kept
    context.toolbox.choose("point")
    context.drag(at, shifted(at, 40, 0))
    assert context.constraints[: len(kept)] == kept, "the point tool takes what it sees"


def test_other_constraints_keep_the_gaze(context: HeadlessContext) -> None:
    turn(context, 60, 0)
    direction = context.constraints[0].direction
    context.toolbox.choose("point")
    begin = context.feature(CORNER)
    context.drag(begin, shifted(begin, 12, -12))
    assert [c.kind for c in context.constraints] == ["gaze", "point"]
    looking = gaze_direction(context.session.model, context.session.coefficients)
    np.testing.assert_allclose(looking, direction, atol=1.0)
    assert context.session.residuals_px[1] < 4
