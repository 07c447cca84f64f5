"""The animation in a session: frames, keys, undo, and the file."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from faceposer.animation.keyframes import Keyframes
from faceposer.errors import FacePoserError
from faceposer.geometry.camera import OrbitView
from faceposer.model.face_model import FaceModel
from faceposer.session.document import Document, read_document, write_document
from faceposer.session.session import Session
from faceposer.solve.constraints.point import PointConstraint

CORNER = "8.3"


@pytest.fixture
def session(model: FaceModel) -> Session:
    return Session(model, Document("man"))


def set_shape(session: Session, name: str, value: float) -> None:
    """Set the pose to one shape alone, as its slider does."""
    with session.edit(f"Set {name}"):
        session.set_start(session.model.coefficients_of({name: value}))


def pull(session: Session, dy: float = -15.0) -> None:
    """Pull a corner of the mouth, as a drag does."""
    model = session.model
    vertex = int(model.character.feature_points[CORNER])
    camera = OrbitView((0.0, 0.0, 0.0), 0.0, 0.0).camera((800, 800))
    u, v = camera.project(model.instance(session.coefficients)[[vertex]])[0].tolist()
    session.add_constraint(PointConstraint(vertex, (u, v + dy), camera), "Place a point")
    session.poll()


def animated(session: Session) -> None:
    """Key a smile at 0, a neutral face at 14 and an open mouth at 29."""
    animation = session.animation
    for frame, name, value in ((0, "mouthSmileLeft", 0.8), (14, "mouthSmileLeft", 0.0), (29, "jawOpen", 0.5)):
        animation.go_to(frame)
        set_shape(session, name, value)
        animation.set_key()
    animation.auto_key = True


def weights(session: Session) -> dict[str, float]:
    values = session.model.weights_of(session.coefficients).tolist()
    return dict(zip(session.model.character.shape_names, values, strict=True))


def key_pose(session: Session, frame: int) -> NDArray[np.float64]:
    key = session.animation.keyframes.at(frame)
    assert key is not None
    return key.pose


def test_going_through_the_frames_is_no_edit(session: Session, tmp_path: Path) -> None:
    animated(session)
    session.save(tmp_path / "a.json")
    label, document = session.undo_label, session.document
    for frame in (0, 7, 14, 20, 29, 40):
        assert not session.animation.go_to(frame)
        assert session.animation.frame == frame
    assert session.undo_label == label
    assert not session.dirty
    assert session.unsaved is None
    assert session.animation.shown == "between"
    session.animation.go_to(7)
    assert 0.1 < weights(session)["mouthSmileLeft"] < 0.7
    session.animation.go_to(14)
    assert session.animation.shown == "key"
    assert document.same_input(session.document)


def test_undo_comes_back_to_the_frame_of_the_edit(session: Session) -> None:
    animated(session)
    animation = session.animation
    animation.go_to(20)
    between = session.coefficients.copy()
    set_shape(session, "browOuterUpLeft", 0.9)
    assert animation.keyframes.frames == (0, 14, 20, 29), "the change became a key"
    animation.go_to(3)
    session.undo()
    assert animation.frame == 20
    np.testing.assert_array_equal(session.coefficients, between)
    assert animation.keyframes.frames == (0, 14, 29)
    assert animation.shown == "between"
    session.redo()
    assert animation.frame == 20
    assert weights(session)["browOuterUpLeft"] == pytest.approx(0.9, abs=0.05)
    assert animation.shown == "key"


def test_a_pulled_pose_becomes_the_key_of_its_frame(session: Session) -> None:
    animated(session)
    animation = session.animation
    animation.go_to(0)
    before = key_pose(session, 0)
    pull(session)
    assert animation.keyframes.frames == (0, 14, 29)
    assert animation.shown == "key"
    np.testing.assert_array_equal(key_pose(session, 0), session.coefficients)
    assert not np.array_equal(key_pose(session, 0), before)
    pulled = session.document
    assert not animation.go_to(10), "the pose is kept as a key"
    assert session.document.constraints == ()
    assert session.undo_label == "Go to another frame", "for the point would be lost"
    session.undo()
    assert session.document.constraints == pulled.constraints
    assert animation.frame == 0
    session.undo()
    np.testing.assert_array_equal(key_pose(session, 0), before)
    np.testing.assert_array_equal(session.coefficients, before)


def test_without_keys_by_themselves_a_change_is_left_behind_and_undo_brings_it_back(session: Session) -> None:
    animated(session)
    animation = session.animation
    animation.auto_key = False
    animation.go_to(20)
    set_shape(session, "browOuterUpLeft", 0.9)
    assert animation.shown == "changed"
    assert animation.keyframes.frames == (0, 14, 29)
    changed = session.coefficients.copy()
    animation.change(replace(animation.keyframes, rate=25.0), "Change the frame rate")
    np.testing.assert_array_equal(session.coefficients, changed)
    assert animation.shown == "changed", "another setting does not touch the face"
    assert animation.go_to(25)
    assert animation.shown == "between"
    session.undo()
    np.testing.assert_array_equal(session.coefficients, changed)
    animation.set_key()
    assert animation.shown == "key"
    assert not animation.go_to(25)


def test_a_face_without_keys_stays_while_frames_pass(session: Session) -> None:
    pull(session)
    pose, constraints = session.coefficients.copy(), session.document.constraints
    session.animation.auto_key = True
    assert not session.animation.go_to(12)
    assert session.animation.shown == "unkeyed"
    np.testing.assert_array_equal(session.coefficients, pose)
    assert session.document.constraints == constraints
    assert session.animation.performance is None
    session.animation.set_key()
    assert session.animation.keyframes.frames == (12,)
    assert session.document.constraints == constraints, "the points stay, for the pose to be changed further"


def test_the_face_follows_its_keys(session: Session) -> None:
    animated(session)
    animation = session.animation
    animation.go_to(14)
    animation.change(animation.keyframes.without({14}), "Delete a key")
    assert animation.shown == "between"
    assert weights(session)["mouthSmileLeft"] > 0.1
    session.undo()
    assert animation.shown == "key"
    assert weights(session)["mouthSmileLeft"] == pytest.approx(0.0, abs=1e-9)
    pull(session)
    animation.change(animation.keyframes.without({14}), "Delete a key")
    assert animation.keyframes.frames == (0, 29), "what pulled at it does not bring the key back"
    assert session.document.constraints == ()
    for frame in (0, 29):
        animation.change(animation.keyframes.without({frame}), "Delete a key")
    assert animation.shown == "unkeyed"
    set_shape(session, "jawOpen", 0.3)
    assert animation.keyframes.frames == (), "the first key is set by hand"


def test_settings_in_a_row_are_one_step(session: Session) -> None:
    animated(session)
    animation = session.animation
    for length in (61, 62, 63):
        animation.change(replace(animation.keyframes, length=length), "Change the length", merges=True)
    assert animation.performance is not None
    assert len(animation.performance) == 63
    session.undo()
    assert animation.keyframes.length == 60


def test_inbetweens_are_a_step_and_are_kept_in_the_file(session: Session, tmp_path: Path) -> None:
    animated(session)
    animation = session.animation
    animation.go_to(7)
    before = session.coefficients.copy()
    animation.change(replace(animation.keyframes, inbetweens="feature points"), "Change the in-betweens")
    after = session.coefficients.copy()
    assert animation.shown == "between", "the face follows"
    assert np.abs(after - before).max() > 1e-3
    assert animation.performance is not None
    np.testing.assert_allclose(animation.performance.coefficients[7], after, atol=1e-9)
    session.save(tmp_path / "a.json")
    again = Session(session.model, read_document(tmp_path / "a.json"))
    assert again.animation.keyframes.same(animation.keyframes)
    assert again.animation.shown == "between"
    assert not again.dirty
    assert again.animation.performance is not None
    np.testing.assert_array_equal(again.animation.performance.coefficients, animation.performance.coefficients)
    session.undo()
    assert animation.keyframes.inbetweens == "poses"
    np.testing.assert_array_equal(session.coefficients, before)
    assert session.dirty
    session.redo()
    assert not session.dirty
    np.testing.assert_array_equal(session.coefficients, after)


def test_keys_are_kept_in_the_file(session: Session, tmp_path: Path) -> None:
    animated(session)
    animation = session.animation
    animation.change(replace(animation.keyframes, rate=24.0, length=48, loop=True), "Loop")
    animation.go_to(9)
    path = tmp_path / "a.json"
    session.save(path)
    data = json.loads(path.read_text())
    assert set(data["animation"]) == {"frame", "rate", "length", "loop", "keys"}
    assert [key["frame"] for key in data["animation"]["keys"]] == [0, 14, 29]
    again = Session(session.model, read_document(path))
    assert again.animation.frame == 9
    assert again.animation.keyframes.same(animation.keyframes)
    assert again.animation.shown == "between"
    assert not again.dirty
    again.animation.go_to(20)
    assert not again.dirty
    set_shape(session, "jawOpen", 0.1)
    assert session.dirty
    session.save(path)
    again = Session(session.model, read_document(path))
    assert again.animation.shown == "key"
    np.testing.assert_array_equal(again.coefficients, session.coefficients)


def test_an_unkeyed_change_is_kept_in_the_file(session: Session, tmp_path: Path) -> None:
    animated(session)
    session.animation.auto_key = False
    session.animation.go_to(5)
    set_shape(session, "jawOpen", 0.7)
    session.save(tmp_path / "a.json")
    again = Session(session.model, read_document(tmp_path / "a.json"))
    assert again.animation.shown == "changed"
    np.testing.assert_array_equal(again.coefficients, session.coefficients)


def test_wrong_files_are_refused(model: FaceModel, tmp_path: Path) -> None:
    path = tmp_path / "a.json"
    write_document(path, Document("man", keyframes=Keyframes().with_key(3, np.zeros(2))))
    with pytest.raises(FacePoserError, match=r"animation.keys\[0\].coefficients has 2 numbers"):
        Session(model, read_document(path))
    keys = Keyframes().to_json()
    for animation, expected in (
        (3, "animation must be an object"),
        (keys | {"frame": -1}, "animation.frame must be"),
        ({}, "animation lacks the key 'rate'"),
    ):
        data = Document("man").to_json() | {"animation": animation}
        path.write_text(json.dumps(data))
        with pytest.raises(FacePoserError, match=expected):
            read_document(path)
    assert "animation" not in Document("man").to_json(), "files without keys are as they were"
