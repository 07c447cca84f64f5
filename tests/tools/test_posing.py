"""Gestures through the toolbox pose the face, and undo, redo and Esc take them back at each stage."""

from pathlib import Path

import numpy as np
import pytest

from faceposer.model.face_model import FaceModel
from faceposer.solve.constraints.point import PointConstraint
from faceposer.solve.constraints.registry import CONSTRAINTS
from faceposer.tools.point_tool import handle_pixels
from tests.tools.context import HeadlessContext, shifted

NOSE, CORNER = "9.3", "8.3"
BACKGROUND = (5.0, 5.0)


@pytest.fixture
def context(model: FaceModel) -> HeadlessContext:
    return HeadlessContext(model)


def vertices(context: HeadlessContext) -> np.ndarray:
    return context.session.model.instance(context.session.coefficients)


def test_a_drag_pulls_the_face_under_the_pointer(context: HeadlessContext) -> None:
    begin = shifted(context.feature(CORNER), -4, 0)
    end = shifted(begin, 12, -12)
    context.drag(begin, end)
    document = context.session.document
    assert len(document.constraints) == 1
    assert document.constraints[0].target == pytest.approx(end)  # type: ignore[attr-defined]
    assert context.session.residuals_px[0] < 3
    assert np.abs(vertices(context) - context.session.model.character.vertices).max() > 0.1


def test_a_click_pins_the_face_where_it_is(context: HeadlessContext) -> None:
    context.click(context.feature(NOSE))
    assert len(context.session.document.constraints) == 1
    np.testing.assert_allclose(vertices(context), context.session.model.character.vertices, atol=1e-3)


def test_a_click_with_a_trembling_hand_is_still_a_click(context: HeadlessContext) -> None:
    begin = context.feature(NOSE)
    context.drag(begin, shifted(begin, 1.5, 1.0))
    np.testing.assert_allclose(vertices(context), context.session.model.character.vertices, atol=2e-3)


def test_grabbing_a_pin_off_its_centre_does_not_make_it_jump(context: HeadlessContext) -> None:
    begin = context.feature(NOSE)
    context.click(begin)
    context.drag(shifted(begin, 5, 3), shifted(begin, 15, 3))
    assert len(context.session.document.constraints) == 1
    assert context.session.document.constraints[0].target == pytest.approx(shifted(begin, 10, 0))  # type: ignore[attr-defined]


def test_undo_and_redo_move_pins_and_pose_together(context: HeadlessContext) -> None:
    session = context.session
    poses = [session.coefficients.copy()]
    for name, dx, dy in ((CORNER, 12, -10), (NOSE, 0, 0), ("8.4", -12, -10)):
        begin = context.feature(name)
        context.drag(begin, shifted(begin, dx, dy))
        poses.append(session.coefficients.copy())
    for expected in poses[-2::-1]:
        session.undo()
        assert not session.poll()
        np.testing.assert_array_equal(session.coefficients, expected)
    assert not session.can_undo
    for expected in poses[1:]:
        session.redo()
        np.testing.assert_array_equal(session.coefficients, expected)
    assert not session.can_redo
    assert len(session.document.constraints) == 3


def test_a_new_edit_drops_what_was_undone(context: HeadlessContext) -> None:
    context.click(context.feature(NOSE))
    context.session.undo()
    context.click(context.feature(CORNER))
    assert not context.session.can_redo
    assert len(context.session.document.constraints) == 1


def test_escape_takes_a_gesture_back_at_every_stage(context: HeadlessContext) -> None:
    session = context.session
    begin = context.feature(CORNER)
    for moves in range(4):
        context.send("press", begin)
        for step in range(moves):
            context.send("move", shifted(begin, 5.0 * step, -5.0))
        assert context.toolbox.active
        assert context.toolbox.cancel()
        assert not context.toolbox.active
        assert session.document.constraints == ()
        assert not session.can_undo
        session.poll()
        np.testing.assert_array_equal(vertices(context), session.model.character.vertices)
        context.send("release", begin)
    assert not context.toolbox.cancel()


def test_escape_puts_a_moved_pin_back(context: HeadlessContext) -> None:
    begin = context.feature(CORNER)
    context.drag(begin, shifted(begin, 10, -10))
    before, pose = context.session.document.constraints, context.session.coefficients.copy()
    context.send("press", shifted(begin, 10, -10))
    context.send("move", shifted(begin, 30, -10))
    context.toolbox.cancel()
    assert context.session.document.constraints == before
    np.testing.assert_array_equal(context.session.coefficients, pose)


def test_undo_waits_for_the_gesture_to_end(context: HeadlessContext) -> None:
    context.click(context.feature(NOSE))
    context.send("press", context.feature(CORNER))
    context.session.undo()
    assert len(context.session.document.constraints) == 2
    context.toolbox.cancel()


def test_right_click_and_delete_remove_pins(context: HeadlessContext) -> None:
    for name in (NOSE, CORNER, "8.4"):
        context.click(context.feature(name))
    context.click(context.feature(CORNER), "right")
    assert len(context.session.document.constraints) == 2
    context.click(context.feature(NOSE))
    context.click(context.feature("8.4"), "left", "shift")
    assert context.toolbox.selection == {0, 1}
    assert context.toolbox.delete_selected()
    assert context.session.document.constraints == ()
    assert not context.toolbox.delete_selected()
    context.session.undo()
    assert len(context.session.document.constraints) == 2


def test_without_pins_the_face_is_neutral_again(context: HeadlessContext) -> None:
    begin = context.feature(CORNER)
    context.drag(begin, shifted(begin, 12, -12))
    context.click(shifted(begin, 12, -12), "right")
    np.testing.assert_allclose(vertices(context), context.session.model.character.vertices, atol=1e-3)


def test_selected_pins_move_together(context: HeadlessContext) -> None:
    left, right = context.feature(CORNER), context.feature("8.4")
    context.click(left)
    context.click(right)
    context.click(left)
    context.click(right, "left", "shift")
    context.drag(right, shifted(right, 0, -9))
    targets = [constraint.target for constraint in context.session.document.constraints]  # type: ignore[attr-defined]
    assert targets[0] == pytest.approx(shifted(left, 0, -9))
    assert targets[1] == pytest.approx(shifted(right, 0, -9))


def test_a_pin_grabbed_from_another_view_follows_the_pointer_there(context: HeadlessContext) -> None:
    begin = context.feature(CORNER)
    context.drag(begin, shifted(begin, 10, -10))
    own = context.session.document.constraints[0].camera
    context.drag(BACKGROUND, (80.0, 5.0))
    assert context.session.document.constraints[0].camera == own, "orbiting does not move a target"
    pose = vertices(context)
    here = context.feature(CORNER)
    context.send("press", here)
    context.send("move", shifted(here, 0.5, 0))
    assert np.abs(vertices(context) - pose).max() < 0.8, "taking hold of it from here does not make the face jump"
    context.send("move", shifted(here, 6, 0))
    context.send("release", shifted(here, 6, 0))
    constraint = context.session.document.constraints[0]
    assert isinstance(constraint, PointConstraint)
    assert constraint.camera == context.camera


def test_resizing_the_window_keeps_pins_where_they_are(context: HeadlessContext) -> None:
    begin = context.feature(CORNER)
    context.drag(begin, shifted(begin, 10, -10))
    before = np.array(handle_pixels(context)[0])
    context.size = (1200, 400)
    np.testing.assert_allclose(handle_pixels(context)[0], (before - 400) / 2 + (600, 200), atol=1e-6)


def test_background_and_middle_button_orbit_but_do_not_edit(context: HeadlessContext) -> None:
    for begin, button in ((BACKGROUND, "left"), (context.feature(NOSE), "middle")):
        yaw = context.view.yaw
        context.drag(begin, shifted(begin, 60, 0), button)
        assert context.view.yaw < yaw
    assert not context.session.can_undo


def test_navigation_presets(context: HeadlessContext) -> None:
    nose = context.feature(NOSE)
    cases = [
        ("blender", "middle", ("shift",), "target"),
        ("blender", "middle", ("ctrl",), "distance"),
        ("blender", "left", ("alt",), "yaw"),
        ("maya", "left", ("alt",), "yaw"),
        ("maya", "middle", ("alt",), "target"),
        ("maya", "right", ("alt",), "distance"),
    ]
    for navigation, button, modifiers, changed in cases:
        context.navigation = navigation  # type: ignore[assignment]
        before = context.view
        context.drag(nose, shifted(nose, 40, 10), button, *modifiers)
        for field in ("target", "distance", "yaw"):
            same = getattr(before, field) == getattr(context.view, field)
            assert same == (field != changed), (navigation, button, modifiers, field)
        context.view = before
    assert context.session.document.constraints == ()


def test_escape_puts_the_view_back(context: HeadlessContext) -> None:
    before = context.view
    context.send("press", BACKGROUND)
    context.send("move", (90.0, 40.0))
    assert context.view != before
    context.toolbox.cancel()
    assert context.view == before


def test_the_wheel_zooms_at_the_pointer(context: HeadlessContext) -> None:
    corner = context.feature(CORNER)
    context.send("wheel", corner, None, wheel=3)
    np.testing.assert_allclose(context.feature(CORNER), corner, atol=12)
    before = context.view.distance
    context.send("wheel", corner, None, wheel=-3)
    assert context.view.distance > before


def test_apply_mode_waits_for_the_word(context: HeadlessContext) -> None:
    session = context.session
    session.mode = "apply"
    begin = context.feature(CORNER)
    context.drag(begin, shifted(begin, 12, -12))
    assert session.pending
    np.testing.assert_array_equal(vertices(context), session.model.character.vertices)
    session.apply()
    session.poll()
    assert not session.pending
    assert session.residuals_px[0] < 3
    session.undo()
    assert session.pending
    np.testing.assert_array_equal(vertices(context), session.model.character.vertices)
    session.mode = "live"
    session.poll()
    assert session.residuals_px[0] < 3


def test_prior_weight_is_one_step_and_may_be_zero(context: HeadlessContext) -> None:
    session = context.session
    begin = context.feature(CORNER)
    context.drag(begin, shifted(begin, 40, -40))
    held_back = session.residuals_px[0]
    with session.edit("Change the prior weight"):
        for weight in (0.5, 0.1, 0.0):
            session.set_prior_weight(weight)
            session.poll()
    assert session.residuals_px[0] < held_back
    session.undo()
    assert session.document.prior_weight == 1.0
    assert session.residuals_px[0] == pytest.approx(held_back)


def test_the_prior_is_chosen_as_one_step(context: HeadlessContext) -> None:
    session = context.session
    begin = context.feature(CORNER)
    context.drag(begin, shifted(begin, 40, -40))
    pose = session.coefficients.copy()
    session.set_prior("whole")
    session.poll()
    assert session.document.prior == "whole"
    assert np.abs(session.coefficients - pose).max() > 1e-3
    session.undo()
    assert session.document.prior == "regions"
    np.testing.assert_array_equal(session.coefficients, pose)


def test_reset_is_one_step(context: HeadlessContext) -> None:
    session = context.session
    begin = context.feature(CORNER)
    context.drag(begin, shifted(begin, 12, -12))
    pose = session.coefficients.copy()
    session.reset_pose()
    session.poll()
    np.testing.assert_array_equal(vertices(context), session.model.character.vertices)
    assert session.document.constraints == ()
    session.undo()
    np.testing.assert_array_equal(session.coefficients, pose)


def test_unsaved_changes_are_known(context: HeadlessContext, tmp_path: Path) -> None:
    session = context.session
    assert not session.dirty
    context.click(context.feature(NOSE))
    assert session.dirty
    session.save(tmp_path / "a.json")
    assert not session.dirty
    session.undo()
    assert session.dirty


def test_hints_tell_what_the_mouse_will_do(context: HeadlessContext) -> None:
    toolbox = context.toolbox
    seen = [toolbox.hint()]
    for position in (context.feature(NOSE), BACKGROUND):
        context.send("hover", position, None)
        seen.append(toolbox.hint())
    context.click(context.feature(NOSE))
    context.send("hover", context.feature(NOSE), None)
    seen.append(toolbox.hint())
    context.send("press", context.feature(NOSE))
    seen.append(toolbox.hint())
    assert len(set(seen)) == len(seen)


def act_at_random(context: HeadlessContext, action: int, rng: np.random.Generator) -> None:
    """Do what keys and panels do: one thing for each ``action`` from 10 to 17."""
    session, toolbox = context.session, context.toolbox
    options, share = toolbox.tool_settings.options, rng.random()
    if action == 10:
        (toolbox.cancel if share < 0.15 else toolbox.accept)()
    elif action == 11:
        (context.undo if share < 0.6 else context.redo)()
    elif action == 12 and share < 0.3:
        toolbox.delete_selected()
    elif action == 13 and not session.editing and share < 0.3:
        session.mode = "apply" if session.mode == "live" else "live"
    elif action == 14 and share < 0.1:
        toolbox.step_back()
    elif action == 15:
        toolbox.nudge(*rng.uniform(-9, 9, 2).tolist())
    elif action == 16 and not toolbox.active:
        toolbox.tool_settings.symmetry.on = bool(rng.integers(2))
        options.fix_mode = "lasso" if rng.integers(2) else "brush"
        options.shape = "region" if rng.integers(2) else "line"
    elif action == 17 and share < 0.1 and not session.editing:
        session.accept_pose()


@pytest.mark.slow
def test_thousands_of_random_events_leave_a_sound_document(context: HeadlessContext) -> None:
    rng = np.random.default_rng(0)
    session, toolbox = context.session, context.toolbox
    front = context.view
    buttons, modifiers = ["left"] * 14 + ["middle", "right"], [(), (), (), (), (), (), ("shift",), ("alt",), ("ctrl",)]
    kinds: set[str] = set()
    for step in range(3000):
        if step % 250 == 0:
            toolbox.finish()
            context.view = front
            toolbox.choose(list(toolbox.tools)[step // 250 % len(toolbox.tools)])
        action = rng.integers(18)
        position = tuple(rng.uniform(250, 550, 2).tolist()) if rng.random() < 0.9 else BACKGROUND
        button = buttons[rng.integers(len(buttons))]
        if action < 3:
            context.send("press", position, button, *modifiers[rng.integers(len(modifiers))])
        elif action < 7:
            context.send("move", position, button)
        elif action < 9:
            context.send("release", position, button)
        elif action == 9:
            context.send("wheel", position, None, wheel=float(rng.integers(-2, 3)))
        else:
            act_at_random(context, int(action), rng)
        session.poll()
        kinds |= {constraint.kind for constraint in session.document.constraints}
        assert toolbox.posing or not session.editing
        assert all(i < len(session.document.constraints) for i in toolbox.selection)
        assert np.isfinite(session.coefficients).all()
    # Strokes drawn at random depict no feature.
    assert kinds >= set(CONSTRAINTS) - {"gaze", "sketch"}
    toolbox.cancel()
    session.document.resolved(session.model)
    while session.can_undo:
        session.undo()
    np.testing.assert_allclose(vertices(context), session.model.character.vertices, atol=1e-6)


def test_a_pin_on_skin_that_contact_moved_asks_for_the_pose_as_it_is(context: HeadlessContext) -> None:
    session = context.session
    pose = session.model.coefficients_of({"eyeBlinkLeft": 1.5, "eyeBlinkRight": 1.5})
    session.rebase_pose(pose, "Close the eyes")
    assert np.abs(session.vertices - vertices(context)).max() > 0.1
    context.click(context.feature("3.1"))
    (pin,) = session.document.constraints
    assert pin.residual_px(session.model, pose) == pytest.approx(0.0, abs=0.05)
