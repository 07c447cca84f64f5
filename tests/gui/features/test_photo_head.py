"""Heads and expressions of photos in the window, driven by pointer and keys."""

import time
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from faceposer.geometry.camera import OrbitView
from faceposer.gui.features.photo.feature import PhotoFeature
from faceposer.gui.features.photo_head.feature import PhotoHeadFeature
from faceposer.gui.testing.scripted_user import Robot
from faceposer.landmarks.drawing import draw
from faceposer.landmarks.painting import painted_character
from faceposer.model.face_model import FaceModel
from tests.windows import OpenWindow

pytestmark = pytest.mark.gl


@pytest.fixture(scope="module")
def photo(woman: FaceModel, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A picture of the woman, who smiles with open mouth."""
    pose = woman.coefficients_of({"jawOpen": 0.35, "mouthSmileLeft": 0.8, "mouthSmileRight": 0.8})
    picture = draw(
        painted_character(woman.character, woman.surface(pose)), OrbitView((0.0, 1.0, 2.0), 0.1, 0.0).camera((480, 480))
    )
    path = tmp_path_factory.mktemp("photos") / "jane_doe.png"
    Image.fromarray(picture.image).save(path)
    return path


def page(robot: Robot) -> str:
    return robot.app.features[PhotoHeadFeature].page


def finish(robot: Robot) -> None:
    job = robot.app.features[PhotoHeadFeature].job
    if job is not None:
        job.join()
    robot.frames(3)


def watch_fit(robot: Robot) -> None:
    """Wait for the fit, which has one bar for all steps, and shows the head while it changes."""
    state = robot.app.features[PhotoHeadFeature]
    shares: list[float] = []
    stages: set[str] = set()
    pictures: list[object] = [None]
    while (job := state.job) is not None:
        robot.frames(1)
        shares.append(job.share)
        stages.add(job.stage)
        if state.preview is not pictures[-1]:
            pictures.append(state.preview)
        time.sleep(0.01)
    assert shares == sorted(shares)
    assert shares[-1] > 0.9
    assert {"Fitting the head to colours", "Taking the colours of the photos"} <= stages
    assert len(pictures) > 2


def weigh_likeness(robot: Robot) -> None:
    """Move the slider between likeness and likelihood to both ends, and reset it."""
    state = robot.app.features[PhotoHeadFeature]
    left, top, right, bottom = robot.app.widget_rects["photo-head:likelihood"]
    for end, weight in ((left + 3.0, 0.25), (right - 3.0, 4.0)):
        robot.click((end, 0.5 * (top + bottom)))
        assert state.likelihood == pytest.approx(weight, rel=0.02)
    robot.click_widget("photo-head:likelihood:reset")
    assert state.likelihood == 1.0


def test_a_photo_becomes_a_character_with_its_expression(open_window: OpenWindow, photo: Path) -> None:
    robot = open_window("low", (1000, 800), pictures=False)
    state = robot.app.features[PhotoHeadFeature]
    robot.app.actions["photo-head"].run()
    robot.frames(2)
    state.add(photo)
    robot.frames(2)
    assert state.title == "Jane Doe"
    robot.click_widget("photo-head:find")
    finish(robot)
    assert page(robot) == "landmarks"
    before = state.landmarks.marked[0]

    left, top, right, _ = robot.app.widget_rects["photo-head:picture"]
    factor = (right - left) / before.image.shape[1]
    u, v = before.pixels["8.3"]
    begin = (left + factor * u, top + factor * v)
    robot.drag(begin, (begin[0] + 10.0, begin[1]))
    robot.frames(2)
    moved = state.landmarks.marked[0]
    assert moved.moved == {"8.3"}
    shift = moved.with_landmarks().face.landmarks.points - before.found.face.landmarks.points
    near = np.linalg.norm(shift[:, :2], axis=1)
    assert near.max() > 5.0 * np.median(near)

    weigh_likeness(robot)

    robot.click_widget("photo-head:fit")
    watch_fit(robot)
    assert page(robot) == "result"
    assert state.error == ""
    # What was moved is saved exactly where it was dropped.
    pins = {pin.place: pin.pixel for pin in state.result.photo.pins} if state.result is not None else {}
    assert pins["8.3"] == pytest.approx(moved.placed["8.3"], abs=1e-6)
    # A line between photo and head follows the pointer.
    assert state.result is not None
    view = state.result.views[0]
    assert view.over is not None
    assert view.over.shape == view.picture.shape
    left, top, right, _ = robot.app.widget_rects["photo-head:picture"]
    robot.drag((0.5 * (left + right), top + 60.0), (0.25 * right + 0.75 * left, top + 60.0))
    robot.frames(2)
    assert state.dialog.compared.wiped == pytest.approx(0.25, abs=0.02)
    robot.click_widget("photo-head:open")
    robot.frames(4)
    session = robot.app.session
    assert session.model.character.title == "Jane Doe"
    assert Path(session.document.photos[0].path) == photo
    assert session.dirty
    assert session.document.photos[0].expression
    weights = dict(
        zip(session.model.character.shape_names, session.model.weights_of(session.coefficients), strict=True)
    )
    assert weights["mouthSmileLeft"] > 0.2
    assert robot.app.features[PhotoFeature].aligned


def test_photos_without_a_face_are_refused(open_window: OpenWindow, tmp_path: Path) -> None:
    robot = open_window("low", (1000, 800), pictures=False)
    state = robot.app.features[PhotoHeadFeature]
    grey = tmp_path / "grey.png"
    Image.fromarray(np.full((200, 300, 3), 128, dtype=np.uint8)).save(grey)
    robot.app.actions["photo-head"].run()
    robot.frames(2)
    state.add(grey)
    robot.frames(2)
    robot.click_widget("photo-head:find")
    finish(robot)
    assert page(robot) == "form"
    assert "No face was found" in state.error


def test_every_dialog_begins_with_the_same_options(open_window: OpenWindow) -> None:
    robot = open_window("low", (1000, 800), pictures=False)
    state = robot.app.features[PhotoHeadFeature]
    state.likelihood, state.painting = 2.0, True
    robot.app.actions["photo-head"].run()
    robot.frames(2)
    assert state.open
    assert (state.likelihood, state.painting) == (1.0, False)


def test_an_expression_is_taken_in_one_click(open_window: OpenWindow, photo: Path) -> None:
    robot = open_window("man", (1000, 800), pictures=False)
    photos = robot.app.features[PhotoFeature]
    photos.open(photo)
    robot.frames(2)
    robot.click_widget("tab:Photo")
    robot.frames(2)
    robot.click_widget("photo-expression")
    photos.expression.join()
    robot.frames(3)
    session = robot.app.session
    weights = dict(
        zip(session.model.character.shape_names, session.model.weights_of(session.coefficients), strict=True)
    )
    assert weights["mouthSmileLeft"] > 0.2
    assert weights["jawOpen"] > 0.1
    assert session.undo_label == "Take the expression"
    assert photos.aligned
    assert "faces were found" not in robot.app.notice
    robot.key("Ctrl+Z")
    assert not session.coefficients.any()


def test_of_two_faces_one_is_taken_and_said(open_window: OpenWindow, photo: Path, tmp_path: Path) -> None:
    with Image.open(photo) as one:
        pixels = np.asarray(one.convert("RGB"))
    both = tmp_path / "both.png"
    Image.fromarray(np.hstack([pixels, pixels[:, ::-1]])).save(both)
    robot = open_window("man", (1000, 800), pictures=False)
    photos = robot.app.features[PhotoFeature]
    photos.open(both)
    robot.frames(2)
    photos.take_expression()
    photos.expression.join()
    robot.frames(3)
    assert robot.app.notice.startswith("2 faces were found; the most distinct one, at (")


def test_photos_stand_together_in_the_menu_view(open_window: OpenWindow) -> None:
    entries = open_window("low", (680, 540), pictures=False).app.actions.in_menu("View")
    names = [entry.name for entry in entries]
    first = names.index("photo-look")
    assert names[first : first + 4] == ["photo-look", "photo-shown", "photo-put-back", "photo-wipe"]
    assert [entry.separated for entry in entries if entry.name.startswith("photo-")] == [True, False, False, False]
