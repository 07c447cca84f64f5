"""Photos in a session: their files move along with it, undo knows them, and what was drawn through them follows."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from faceposer.geometry.camera import Camera, OrbitView
from faceposer.model.face_model import FaceModel
from faceposer.photo.aligning import aligned
from faceposer.photo.photo import Photo, Pin
from faceposer.photo.places import GUIDED
from faceposer.session.document import Document, read_document
from faceposer.session.opening import open_session
from faceposer.session.photos import pose_from_photo, with_photo
from faceposer.session.session import Session
from faceposer.solve.constraints.point import PointConstraint

CAMERA = Camera(np.diag([1.0, -1.0, -1.0]), np.array([3.0, -2.0, 120.0]), 2000.0, (900, 700))


def pinned(model: FaceModel, path: Path) -> Photo:
    pose = model.coefficients_of({"mouthSmileLeft": 0.7, "mouthSmileRight": 0.7})
    vertices = model.instance(pose)[[model.character.feature_points[name] for name in GUIDED]]
    pins = zip(GUIDED, CAMERA.project(vertices).tolist(), strict=True)
    photo = Photo(str(path), (900, 700), tuple(Pin(name, (u, v)) for name, (u, v) in pins))
    return aligned(photo, model, model.neutral())


def test_a_session_names_its_photos_from_where_it_lies(model: FaceModel, tmp_path: Path) -> None:
    photo = pinned(model, tmp_path / "shots" / "face.jpg")
    session = Session(model, Document("man"))
    with session.edit("Open a photo"):
        session.replace(replace(session.document, photos=(photo,)))
    assert session.dirty
    assert session.document.solved, "a photo asks for no other face"
    session.save(tmp_path / "a.json", photo.camera)
    assert not session.dirty
    written = read_document(tmp_path / "a.json")
    assert written.photos[0].path == "shots/face.jpg"
    again = open_session(str(tmp_path / "a.json"))
    assert again.document.photos == (photo,), "the file need not be there"
    assert again.document.camera == photo.camera
    session.undo()
    assert session.document.photos == ()
    session.redo()
    assert session.document.photos == (photo,)


def test_what_was_drawn_through_a_photo_follows_its_camera(model: FaceModel, tmp_path: Path) -> None:
    photo = pinned(model, tmp_path / "face.jpg")
    assert photo.camera is not None
    through = replace(photo.camera, focal=photo.camera.focal * 2.0, size=(500, 500), shift=(7.0, 9.0))
    elsewhere = OrbitView((0.0, 0.0, 0.0)).camera((500, 500))
    constraints = (PointConstraint(5, (10.0, 20.0), through), PointConstraint(5, (10.0, 20.0), elsewhere))
    document = Document("man", constraints, photos=(photo,))
    x, y = photo.pins[0].pixel
    moved = aligned(photo.with_pin(replace(photo.pins[0], pixel=(x + 30.0, y))), model, model.neutral())
    after = with_photo(document, 0, moved)
    assert after.photos == (moved,)
    assert moved.camera is not None
    followed = after.constraints[0].camera
    assert followed is not None
    assert followed.same_viewpoint(moved.camera)
    assert not followed.same_viewpoint(photo.camera)
    on_photo = through.focal / photo.camera.focal
    assert followed.focal / moved.camera.focal == on_photo
    assert after.constraints[1] == constraints[1]


def test_the_expression_replaces_what_the_pins_told_before(model: FaceModel, tmp_path: Path) -> None:
    photo = pinned(model, tmp_path / "face.jpg")
    own = PointConstraint(3, (10.0, 20.0), OrbitView((0.0, 0.0, 0.0)).camera((500, 500)))
    once = pose_from_photo(Document("man", (own,), photos=(photo,)), model, photo)
    again = pose_from_photo(once, model, photo)
    assert len(again.constraints) == len(once.constraints) > 10
    assert again.constraints[0] == own
    locked = replace(once, constraints=(own, replace(once.constraints[1], locked=True)))
    assert len(pose_from_photo(locked, model, photo).constraints) == len(once.constraints) + 1


def test_a_camera_that_a_file_leaves_out_is_sought(model: FaceModel, tmp_path: Path) -> None:
    photo = pinned(model, tmp_path / "face.jpg")
    bare = replace(photo, camera=None)
    (found,) = Session(model, Document("man", photos=(bare,))).document.photos
    assert found.camera is not None
    assert photo.camera is not None
    np.testing.assert_allclose(found.camera.rotation, photo.camera.rotation, atol=0.02)
