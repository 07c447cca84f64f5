"""With symmetry, what is done on one side is done on the other, and what is uneven already stays so."""

from collections.abc import Callable

import numpy as np
import pytest

from faceposer.geometry.mirror import mirrored_pixels
from faceposer.model.face_model import FaceModel
from faceposer.tools.fix_tool import toggle_fixed_region
from tests.tools.context import HeadlessContext, along, check_stages, shifted, straight

LEFT, RIGHT = "8.3", "8.4"


@pytest.fixture
def context(model: FaceModel) -> HeadlessContext:
    context = HeadlessContext(model)
    context.toolbox.tool_settings.symmetry.on = True
    return context


def flipped(context: HeadlessContext, pixel: tuple[float, float]) -> np.ndarray:
    return mirrored_pixels(pixel, context.camera)[0]


def cheek(context: HeadlessContext, dx: float = 0.0, dy: float = 0.0) -> tuple[float, float]:
    """Return a place on the character's left cheek, (dx, dy) pixels beside its middle."""
    return shifted(context.feature(LEFT), 18 + dx, -22 + dy)


def draw_pin(context: HeadlessContext) -> None:
    context.drag(cheek(context), cheek(context, 4, -8))


def draw_distance(context: HeadlessContext) -> None:
    context.toolbox.choose("distance")
    context.drag(cheek(context), cheek(context, 6, 30))


def draw_stroke(context: HeadlessContext) -> None:
    context.toolbox.choose("stroke")
    way = straight(cheek(context), cheek(context, 14, 8), 4)
    context.follow(way)
    context.follow([shifted(place, 0, -7) for place in way])


def draw_curve(context: HeadlessContext) -> None:
    context.toolbox.choose("curve")
    for place in straight(cheek(context, -10), cheek(context, 20, 14), 3):
        context.click(place)
    context.toolbox.accept()


def draw_fixed(context: HeadlessContext) -> None:
    context.toolbox.choose("fix")
    context.click(cheek(context))


@pytest.mark.parametrize("draw", [draw_pin, draw_distance, draw_stroke, draw_curve, draw_fixed])
def test_each_kind_is_mirrored_and_removed_together(
    context: HeadlessContext, draw: Callable[[HeadlessContext], None]
) -> None:
    draw(context)
    own, image = context.constraints
    assert own.kind == image.kind
    model = context.session.model
    rest = model.character.vertices
    places = own.points.positions(rest, model.triangles) * (-1, 1, 1)
    across = image.points.positions(rest, model.triangles)
    np.testing.assert_allclose(across, places, atol=0.02 * model.character.height)
    partner = context.toolbox.tool_settings.symmetry.partner
    assert partner(context.session.document, 0, model) == 1
    assert partner(context.session.document, 1, model) == 0
    if own.camera is not None:
        target, other = (
            np.reshape(constraint.target, (-1, 2 if own.kind != "distance" else 1)) for constraint in (own, image)
        )
        expected = target if own.kind == "distance" else mirrored_pixels(target, own.camera)
        np.testing.assert_allclose(other, expected, atol=2.5)
    context.undo()
    assert context.constraints == ()
    context.redo()
    assert context.constraints == (own, image)
    context.toolbox.select(0)
    assert context.toolbox.delete_selected()
    assert context.constraints == ()
    context.undo()
    assert context.constraints == (own, image)


def test_a_drag_poses_both_sides_alike_at_each_stage(context: HeadlessContext) -> None:
    begin = shifted(context.feature(LEFT), -3, 0)
    check_stages(context, along(straight(begin, shifted(begin, 8, -10), 4)))
    assert len(context.constraints) == 2
    np.testing.assert_allclose(flipped(context, context.feature(LEFT)), context.feature(RIGHT), atol=1.5)
    assert context.feature(LEFT)[1] < shifted(begin, 0, -5)[1]


def test_editing_one_side_edits_the_other(context: HeadlessContext) -> None:
    draw_curve(context)
    at = context.constraints[0].target[1]
    before = context.constraints
    check_stages(context, along(straight(at, shifted(at, 3, -6), 3)))
    assert len(context.constraints) == 2
    offset = np.subtract(context.constraints[1].target[1], before[1].target[1])
    np.testing.assert_allclose(offset, (-3, -6), atol=0.05)
    context.click(context.constraints[0].target[1], "right")
    assert [len(c.target) for c in context.constraints] == [2, 2]
    context.undo()
    at = context.constraints[0].target[1]
    context.toolbox.select(0)
    before = context.constraints
    context.toolbox.nudge(2.0, 0.0)
    np.testing.assert_allclose(np.subtract(context.constraints[1].target, before[1].target)[:, 0], -2.0, atol=0.05)


def test_what_is_uneven_already_stays_so(context: HeadlessContext) -> None:
    symmetry = context.toolbox.tool_settings.symmetry
    symmetry.on = False
    context.session.set_prior_weight(0.1)
    context.click(shifted(context.feature(RIGHT), 3, 0))
    begin = shifted(context.feature(LEFT), -3, 0)
    context.drag(begin, shifted(begin, 2, -12))
    context.session.accept_pose()
    uneven = flipped(context, context.feature(LEFT)) - context.feature(RIGHT)
    assert np.hypot(*uneven) > 2
    symmetry.on = True
    begin = shifted(context.feature(LEFT), -3, 0)
    context.click(begin)
    assert len(context.constraints) == 2
    kept = flipped(context, context.feature(LEFT)) - context.feature(RIGHT)
    np.testing.assert_allclose(kept, uneven, atol=0.6)
    first, second = (np.array(c.target) for c in context.constraints)
    context.drag(begin, shifted(begin, 3, 5))
    now = [np.array(c.target) for c in context.constraints]
    np.testing.assert_allclose(now[0] - first, (3, 5), atol=1e-6)
    np.testing.assert_allclose(now[1] - second, (-3, 5), atol=0.05)


def test_a_painted_area_grows_and_shrinks_on_both_sides(context: HeadlessContext) -> None:
    draw_fixed(context)
    few = [len(c.points) for c in context.constraints]
    context.click(cheek(context, 30, 10))
    assert len(context.constraints) == 2
    assert all(len(c.points) > before for c, before in zip(context.constraints, few, strict=True))
    context.toolbox.tool_settings.options.fix_brush = 80.0
    context.drag(cheek(context), cheek(context, 30, 10), "left", "ctrl")
    assert context.constraints == (), "what is let go on one side is let go on the other"


def test_in_the_middle_and_for_the_eyes_nothing_is_mirrored(context: HeadlessContext) -> None:
    context.click(context.feature("2.1"))
    assert len(context.constraints) == 1
    context.toolbox.choose("gaze")
    handle = context.toolbox.gaze_tool.handle(context)
    assert handle is not None
    context.drag(handle, shifted(handle, 30, 0))
    assert [c.kind for c in context.constraints] == ["point", "gaze"]
    toggle_fixed_region(("nose",), context, context.toolbox.tool_settings)
    assert len(context.constraints) == 3


def test_a_locked_image_is_left_alone(context: HeadlessContext) -> None:
    draw_pin(context)
    context.change(1, locked=True)
    kept = context.constraints[1]
    at = context.constraints[0].target
    context.drag(at, shifted(at, 5, 5))
    assert context.constraints[0].target == pytest.approx(shifted(at, 5, 5))
    assert context.constraints[1] == kept
    context.click(shifted(at, 5, 5), "right")
    assert context.constraints == (kept,)


def test_without_symmetry_one_side_is_enough(context: HeadlessContext) -> None:
    context.toolbox.tool_settings.symmetry.on = False
    draw_pin(context)
    assert len(context.constraints) == 1
