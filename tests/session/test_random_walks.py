"""Whatever is set, undone, done again and saved: the session stays one, and its file holds all of it."""

from pathlib import Path
from typing import cast

import numpy as np
import pytest

from faceposer.animation.keyframes import Keyframes
from faceposer.identity.editing import head_editor
from faceposer.identity.identity import is_editable
from faceposer.model.framing import face_view
from faceposer.session.opening import open_session
from faceposer.session.session import Session
from faceposer.solve.constraints.point import PointConstraint
from faceposer.solve.priors import Prior

PRIORS = ("regions", "whole", "plain")
STEPS = {"low": 60, "man": 30}


def change_the_head(session: Session, rng: np.random.Generator) -> None:
    """Change the head, show one without setting it, or return to the original."""
    editor = head_editor(session.base_model.character)
    head = session.document.identity or editor.own
    match int(rng.integers(4)):
        case 0:
            session.set_identity(None, "Original head")
        case 1:
            session.set_identity(editor.random(int(rng.integers(1000)), head), "Random head")
        case 2:
            older = editor.with_attributes(head, {"age": float(rng.uniform(-0.5, 1.0))})
            session.preview_identity(older)
            assert session.preview is not None
            session.set_identity(older, "Age")
        case _:
            session.preview_identity(editor.average)
            session.preview_identity(None)


def do_something(session: Session, rng: np.random.Generator) -> None:
    """Do one of the things that a user does."""
    model, document = session.model, session.document
    match int(rng.integers(14)):
        case 0:
            session.set_spread(float(rng.choice([0.0, 0.2, 0.5, 1.0])))
        case 1:
            session.set_contact(not document.contact)
        case 2:
            session.set_prior(cast(Prior, str(rng.choice(PRIORS))))
        case 3:
            session.set_prior_weight(float(rng.choice([0.0, 0.5, 1.0, 3.0])))
        case 4 | 5:
            camera = face_view(model.character, "front", 4 / 3).camera((640, 480))
            vertex = int(rng.choice(sorted(model.character.feature_points.values())))
            u, v = camera.project(model.instance(session.coefficients)[[vertex]])[0] + rng.normal(0.0, 8.0, 2)
            session.add_constraint(PointConstraint(vertex, (float(u), float(v)), camera), "Place a point")
        case 6 if document.constraints:
            session.remove_constraints({0}, "Remove")
        case 7:
            session.accept_pose()
        case 8:
            session.animation.set_key()
        case 9:
            session.animation.go_to(int(rng.integers(30)))
        case 10 | 11:
            session.undo()
        case 12:
            session.redo()
        case 13:
            session.reset_pose()
    session.wait()


@pytest.mark.parametrize(("character", "seed"), [*(("low", seed) for seed in range(6)), ("man", 1)])
def test_random_walks(character: str, seed: int, tmp_path: Path) -> None:
    rng = np.random.default_rng(seed)
    session = open_session(character)
    session.animation.auto_key = bool(seed % 2)
    for step in range(STEPS[character]):
        if is_editable(session.base_model.character) and rng.random() < 0.3:
            change_the_head(session, rng)
        else:
            do_something(session, rng)
        document = session.document
        np.testing.assert_array_equal(
            session.vertices, session.model.surface(session.coefficients, document.contact), err_msg=f"step {step}"
        )
        if step % 6 == 5:
            path = tmp_path / "walk.json"
            session.save(path)
            again = open_session(str(path))
            again.wait()
            assert not again.dirty
            assert again.remark == ""
            assert again.document.same_input(document), f"step {step}"
            np.testing.assert_allclose(again.coefficients, session.coefficients, atol=1e-9)
    while session.can_redo:
        session.redo()
    end, steps = session.document, 0
    while session.can_undo:
        session.undo()
        session.wait()
        steps += 1
    for _ in range(steps):
        session.redo()
        session.wait()
    assert not session.can_redo
    assert session.document.same_input(end)
    np.testing.assert_allclose(session.coefficients, 0.0 if end.coefficients is None else end.coefficients, atol=1e-9)


def test_settings_of_the_prior_make_no_work_of_a_frame_that_nobody_changed() -> None:
    """Spread, prior and its weight say how a face follows pulls, and at a frame of an animation nothing pulls."""
    session = open_session("low")
    model = session.model
    keyframes = Keyframes(length=30).with_key(0, model.neutral()).with_key(20, model.coefficients_of({"jawOpen": 0.8}))
    session.animation.load(keyframes, "Open", frame=10)
    pose = session.coefficients.copy()
    session.animation.auto_key = True
    for change in (
        lambda: session.set_spread(0.1),
        lambda: session.set_prior_weight(3.0),
        lambda: session.set_contact(False),
    ):
        change()
        session.wait()
        np.testing.assert_array_equal(session.coefficients, pose)
        assert session.document.animated
        assert session.animation.keyframes.frames == (0, 20)
    assert not session.animation.go_to(5), "nothing is lost"
    session.undo()
    session.undo()
    assert session.document.spread == 0.1
    session.undo()
    assert session.document.spread == 0.5
    assert session.document.contact


def test_going_back_to_the_neutral_face_is_no_change(tmp_path: Path) -> None:
    session = open_session("low")
    session.reset_pose()
    session.save(tmp_path / "neutral.json")
    again = open_session(str(tmp_path / "neutral.json"))
    with again.edit("Pose"):
        again.set_start(again.model.coefficients_of({"jawOpen": 0.5}))
    assert again.dirty
    again.reset_pose()
    assert not again.dirty


def test_a_face_that_the_prior_alone_moves_keeps_its_start(tmp_path: Path) -> None:
    session = open_session("low")
    session.set_prior("plain")
    session.wait()
    assert np.abs(session.coefficients).max() > 1e-3
    session.save(tmp_path / "plain.json")
    again = open_session(str(tmp_path / "plain.json"))
    np.testing.assert_array_equal(again.coefficients, session.coefficients)
    again.set_prior("regions")
    again.wait()
    assert np.abs(again.coefficients).max() < 1e-6
