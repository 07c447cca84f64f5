"""Edits of the head of a session."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from faceposer.errors import FacePoserError
from faceposer.geometry.camera import OrbitView
from faceposer.identity.editing import HeadEditor, head_editor
from faceposer.identity.identity import Identity
from faceposer.model.face_model import FaceModel
from faceposer.session.document import Document
from faceposer.session.opening import open_session
from faceposer.session.session import Session
from faceposer.solve.constraints.point import PointConstraint

CAMERA = OrbitView((0.0, 1.0, 2.0), 0.3, 0.2).camera((640, 480))


@pytest.fixture
def session(man: FaceModel) -> Session:
    return Session(man, Document("man"))


@pytest.fixture(scope="module")
def editor(man: FaceModel) -> HeadEditor:
    return head_editor(man.character)


def test_the_pose_stays_while_the_head_changes(session: Session, editor: HeadEditor) -> None:
    pose = session.model.coefficients_of({"mouthSmileLeft": 1.0, "jawOpen": 0.3})
    session.rebase_pose(pose, "Smile")
    session.set_identity(editor.random(1), "Random head")
    np.testing.assert_array_equal(session.coefficients, pose)
    moved = np.linalg.norm(session.model.character.vertices - session.base_model.character.vertices, axis=1)
    assert moved.mean() > 0.1
    weights = session.model.weights_of(session.coefficients)
    np.testing.assert_allclose(weights, session.base_model.weights_of(pose))


def test_a_new_head_accepts_the_pose(session: Session, editor: HeadEditor) -> None:
    corner = session.model.character.feature_points["8.3"]
    pixel = CAMERA.project(session.vertices[corner][None])[0] + [0.0, -8.0]
    session.add_constraint(PointConstraint(corner, (float(pixel[0]), float(pixel[1])), CAMERA), "Drag")
    session.wait()
    pose = session.coefficients
    assert np.abs(pose).max() > 0.0
    session.set_identity(editor.random(2), "Random head")
    assert not session.document.constraints
    np.testing.assert_array_equal(session.coefficients, pose)
    session.undo()
    kinds = [constraint.kind for constraint in session.document.constraints]
    assert kinds == ["point"]
    assert session.model is session.base_model


def test_undo_and_redo_change_the_head(session: Session, editor: HeadEditor) -> None:
    session.set_identity(editor.random(1), "Random head")
    first = session.model
    session.set_identity(editor.average, "Average head")
    assert not np.array_equal(session.model.character.vertices, first.character.vertices)
    session.undo()
    assert session.model is first
    assert session.undo_label == "Random head"
    session.undo()
    assert session.model is session.base_model
    session.redo()
    np.testing.assert_array_equal(session.model.character.vertices, first.character.vertices)


def test_sessions_with_a_head_are_saved_and_opened(session: Session, editor: HeadEditor, tmp_path: Path) -> None:
    pose = session.model.coefficients_of({"browInnerUp": 0.7})
    session.rebase_pose(pose, "Raise the brows")
    session.set_identity(editor.with_attributes(editor.own, {"age": 0.6}), "Age")
    session.save(tmp_path / "s.json")
    assert session.unsaved is None
    again = open_session(str(tmp_path / "s.json"))
    assert again.remark == ""
    np.testing.assert_array_equal(again.vertices, session.vertices)
    again.set_identity(None, "Original head")
    assert again.dirty


def test_heads_of_other_topologies_are_refused(creature: FaceModel, low: FaceModel, editor: HeadEditor) -> None:
    for model in (creature, low):
        session = Session(model, Document(model.character.name))
        with pytest.raises(FacePoserError, match="cannot be edited"):
            session.set_identity(editor.average, "Average head")
        assert session.undo_label is None
        with pytest.raises(FacePoserError, match="cannot be edited"):
            Session(model, replace(session.document, identity=editor.average))


def test_identities_of_another_model_are_refused(man: FaceModel) -> None:
    with pytest.raises(FacePoserError, match="another version of the model"):
        Session(man, Document("man", identity=Identity.of(np.zeros((1, 2)))))
