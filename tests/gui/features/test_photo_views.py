"""What the view shows of a photo: the wipe, the face put back into it, and the work on that."""

import threading
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import faceposer.photo.faces
import faceposer.photo.putting_back
import faceposer.session.putting_back
from faceposer.gui.features.photo.feature import PhotoFeature
from faceposer.gui.testing.scripted_user import Robot
from faceposer.photo.aligning import first_camera
from faceposer.photo.photo import Photo
from faceposer.progress import Progress
from tests.gui.features.test_photo import at, colour
from tests.windows import OpenWindow

pytestmark = pytest.mark.gl

SIZE = (400, 300)
RED, BLUE = (200, 30, 30), (20, 20, 220)


@pytest.fixture
def quick(open_window: OpenWindow) -> Robot:
    return open_window("low", (680, 540))


@pytest.fixture
def path(tmp_path: Path) -> Path:
    file = tmp_path / "face.png"
    Image.new("RGB", SIZE, RED).save(file)
    return file


class Slow:
    """Stands for the computation of the picture, which goes on only when it may."""

    def __init__(self) -> None:
        self.may_go = threading.Event()
        self.begun = threading.Semaphore(0)
        self.pictures = 0

    def head(self, *_: object) -> str:
        return "head"

    def put_back(self, _head: str, _vertices: object, _skin: object, progress: Progress) -> np.ndarray:
        progress.at("Putting the face back", 0.5)
        self.begun.release()
        while not self.may_go.wait(0.005):
            progress.check()
        progress.check()
        self.pictures += 1
        return np.full((SIZE[1], SIZE[0], 3), BLUE, dtype=np.uint8)


@pytest.fixture
def slow(monkeypatch: pytest.MonkeyPatch) -> Iterator[Slow]:
    slow = Slow()
    monkeypatch.setattr(faceposer.photo.putting_back, "put_back", slow.put_back)
    monkeypatch.setattr(faceposer.session.putting_back, "head_in_photo", slow.head)
    yield slow
    slow.may_go.set()


def show(robot: Robot, path: Path, known: bool = True) -> PhotoFeature:
    """Show a photo with the face of the session in its middle, of which the expression is known or not."""
    app = robot.app
    photo = Photo(str(path), SIZE)
    photo = replace(photo, camera=first_camera(photo, app.session.model))
    if known:
        photo = photo.with_expression(app.session.model, app.session.model.neutral())
    with app.session.edit("Open a photo"):
        app.session.replace(replace(app.session.document, photos=(*app.session.document.photos, photo)))
    photos = app.features[PhotoFeature]
    photos.choose(len(photos.photos) - 1)
    robot.frames(2)
    robot.click_widget("tab:Photo")
    return photos


def begin(robot: Robot, slow: Slow) -> None:
    """Draw frames until the computation has begun."""
    for _ in range(200):
        robot.frames()
        if slow.begun.acquire(timeout=0.02):
            return
    raise AssertionError("no work has begun")


def face(robot: Robot) -> tuple[float, float]:
    """The tip of the nose in the window."""
    return robot.at("9.3")


def picture(robot: Robot) -> object:
    layer = robot.app.scene.photo
    assert layer is not None
    return layer.picture


# The wipe


def test_left_of_the_line_is_the_photo_and_right_the_face(open_window: OpenWindow, path: Path) -> None:
    robot = open_window("low", (680, 540), pictures=True)
    photos = show(robot, path)
    robot.key("Shift+W")
    x, y = face(robot)
    line = robot.app.widget_rects.center("photo-wipe-line")[0]
    assert line == pytest.approx(x, abs=30.0), "it begins at the face"
    robot.drag((line, y + 60.0), (x + 25.0, y), steps=2)
    np.testing.assert_allclose(colour(robot, (x, y)), RED, atol=3)
    robot.drag((x + 25.0, y + 60.0), (x - 25.0, y), steps=2)
    assert np.abs(colour(robot, (x, y)) - RED).max() > 30, "the face, at full opacity"
    np.testing.assert_allclose(colour(robot, at(robot, (395.0, 150.0))), RED, atol=3)
    assert photos.photo is not None
    photos.change(replace(photos.photo, front=True), "In front")
    robot.frames(2)
    assert np.abs(colour(robot, at(robot, (395.0, 150.0))) - RED).max() > 30, "the face is alone on its side"


def test_the_line_is_dragged_and_the_face_beside_it(quick: Robot, path: Path) -> None:
    robot, app = quick, quick.app
    photos = show(robot, path)
    robot.click_widget("photo-wipe")
    x, y = face(robot)
    wipe = photos.wipe
    assert wipe.shown
    robot.move((app.widget_rects.center("photo-wipe-line")[0], y))
    robot.frames(2)
    assert app.gui.cursors.shown == "resize_ew"
    assert "line between photo and face" in app.hint()
    assert app.toolbox.hover is None
    zoom = app.viewport.view.distance
    robot.wheel(1)
    assert app.viewport.view.distance < zoom, "the wheel zooms there, too"
    robot.wheel(-1)
    x, y = face(robot)
    begin = app.viewport.origin[0] + wipe.share * app.viewport.size[0]
    robot.drag((begin, y), (begin + 15.0, y + 20.0), steps=3)
    assert app.viewport.origin[0] + wipe.share * app.viewport.size[0] == pytest.approx(begin + 15.0, abs=1.0)
    assert not app.session.document.constraints
    assert not wipe.hovered or app.toolbox.hover is None
    share, at_line = wipe.share, begin + 15.0
    for away in (-6.0, 6.0):
        robot.drag((at_line + away, y), (at_line + away + 10.0, y - 12.0), steps=3)
    assert len(app.session.document.constraints) == 2, "drags that begin beside the line pose the face"
    assert wipe.share == share
    # A drag of the face does not take the line along where it crosses it.
    robot.drag((at_line - 12.0, y + 5.0), (at_line + 20.0, y + 5.0), steps=4)
    assert wipe.share == share
    robot.key("Esc")
    robot.key("Ctrl+Right")
    assert wipe.share == pytest.approx(share + 0.02)
    for _ in range(60):
        robot.key_down("Ctrl+Left")
    assert wipe.share == 0.0
    left, top, right, bottom = app.widget_rects["photo-wipe-line"]
    assert left >= app.viewport.origin[0]
    robot.drag(((left + right) / 2.0, (top + bottom) / 2.0), (x, y), steps=3)
    assert wipe.share > 0.2, "it can be taken at the edge, too"


def test_the_wipe_is_there_while_the_photo_is_looked_through(quick: Robot, path: Path) -> None:
    robot, app = quick, quick.app
    photos = show(robot, path)
    robot.key("Shift+W")
    robot.frames(2)
    line = app.widget_rects.center("photo-wipe-line")
    assert photos.contains(line)
    robot.key("O")
    robot.frames(2)
    assert not photos.contains(line), "pins are set on the photo alone"
    robot.key("Q")
    robot.frames(2)
    assert photos.contains(line)
    robot.key("1")
    robot.frames(2)
    assert not photos.contains(line)
    assert "photo-wipe-line" not in app.widget_rects
    photos.look_through()
    robot.frames(2)
    assert photos.contains(line)
    left, top, right, bottom = app.widget_rects["photo-opacity"]
    robot.drag(((left + right) / 2, (top + bottom) / 2), (left + 3, (top + bottom) / 2), steps=3)
    assert not photos.wipe.on, "the opacity is to be seen"
    robot.key("Shift+O")
    robot.key("1")
    robot.key("Shift+W")
    assert photos.aligned
    assert photos.wipe.shown, "it is seen at once when it is switched on"
    app.files.open("low")
    robot.frames(4)
    robot.click_widget("choice:1")
    robot.frames(3)
    assert not app.session.document.photos
    assert not photos.wipe.on


# The face put back


def test_work_on_the_picture_is_shown_and_the_face_stays(quick: Robot, path: Path, slow: Slow) -> None:
    robot, app = quick, quick.app
    photos = show(robot, path)
    own = picture(robot)
    robot.click_widget("photo-put-back")
    begin(robot, slow)
    robot.frames(2)
    assert "photo-busy" in app.widget_rects
    assert photos.patience <= 0.1
    assert picture(robot) is own, "photo and face, until the picture is there"
    slow.may_go.set()
    photos.putting_back.join()
    robot.frames(3)
    assert "photo-busy" not in app.widget_rects
    first = picture(robot)
    assert first is not own
    # Without a gesture the last picture stays; the opacity is no change of the face.
    slow.may_go.clear()
    model = app.session.model
    app.session.rebase_pose(model.coefficients_of({"jawOpen": 0.5}), "Pose")
    begin(robot, slow)
    robot.frames(2)
    assert picture(robot) is first
    assert "photo-busy" in app.widget_rects
    # Another change: the old work is of no use any more.
    app.session.rebase_pose(model.coefficients_of({"jawOpen": 0.3}), "Pose")
    begin(robot, slow)
    slow.may_go.set()
    photos.putting_back.join()
    robot.frames(3)
    assert slow.pictures == 2
    assert picture(robot) not in (first, own)


def test_in_gestures_the_face_is_shown(quick: Robot, path: Path, slow: Slow) -> None:
    robot, app = quick, quick.app
    photos = show(robot, path)
    own = picture(robot)
    slow.may_go.set()
    photos.put_back()
    robot.frames(2)
    photos.putting_back.join()
    robot.frames(3)
    first = picture(robot)
    assert first is not own
    slow.may_go.clear()
    x, y = robot.at("8.3")
    robot.move((x, y))
    robot.press()
    robot.move((x + 8.0, y - 8.0), 2)
    assert picture(robot) is own
    robot.release()
    robot.frames(3)
    assert picture(robot) is own, "until there is a picture of the face as it is now"
    begin(robot, slow)
    robot.frames(2)
    assert "photo-busy" in app.widget_rects
    slow.may_go.set()
    photos.putting_back.join()
    robot.frames(3)
    assert picture(robot) not in (own, first)
    robot.key("C")
    assert picture(robot) is own, "the neutral face is compared"
    robot.key("C")
    robot.frames(2)
    assert picture(robot) is not own
    assert slow.pictures == 2


def test_the_wipe_divides_photo_and_changed_photo(quick: Robot, path: Path, slow: Slow) -> None:
    slow.may_go.set()
    robot, app = quick, quick.app
    photos = show(robot, path)
    own = picture(robot)
    robot.click_widget("photo-wipe")
    robot.click_widget("photo-put-back")
    photos.putting_back.join()
    robot.frames(3)
    layer = app.scene.photo
    assert layer is not None
    assert layer.left is own
    assert layer.picture is not own
    assert layer.split == photos.wipe.share


def test_an_expression_that_is_being_found_is_shown_and_cancelled(
    quick: Robot, path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    robot, app = quick, quick.app
    may_go = threading.Event()
    monkeypatch.setattr(faceposer.photo.faces, "read_face", lambda *_: may_go.wait(10.0))
    photos = show(robot, path, known=False)
    try:
        robot.click_widget("photo-expression")
        robot.frames(2)
        assert "photo-busy" in app.widget_rects
        assert not app.actions["photo-expression"].enabled()
        robot.key("Esc")
        assert "photo-busy" not in app.widget_rects
    finally:
        may_go.set()
    photos.expression.join()
    robot.frames(3)
    assert not app.dialogs.open
    assert app.session.undo_label == "Open a photo"
    assert app.actions["photo-expression"].enabled()


def _expression(robot: Robot, photos: PhotoFeature) -> None:
    photos.take_expression()
    photos.expression.cancel()
    photos.expression.join()


SEEN: dict[str, Callable[[Robot, PhotoFeature], None]] = {
    "expression": _expression,
    "pins": lambda robot, photos: robot.key("O"),
    "hidden": lambda robot, photos: robot.key("Shift+O"),
    "layer": lambda robot, photos: robot.click_widget("photo-layer:1"),
    "removed": lambda robot, photos: robot.click_widget("photo:0:delete"),
    "session": lambda robot, photos: robot.app.files._open("low"),
}


@pytest.mark.parametrize("what", SEEN)
def test_it_is_switched_off_where_the_face_must_be_seen(quick: Robot, path: Path, slow: Slow, what: str) -> None:
    robot = quick
    photos = show(robot, path)
    robot.click_widget("photo-put-back")
    assert photos.putting_back.on
    SEEN[what](robot, photos)
    robot.frames(2)
    assert not photos.putting_back.on
    assert "photo-busy" not in robot.app.widget_rects


def test_it_is_seen_at_once_when_switched_on(quick: Robot, path: Path, slow: Slow) -> None:
    robot, app = quick, quick.app
    slow.may_go.set()
    photos = show(robot, path)
    robot.key("Shift+O")
    robot.key("1")
    app.actions["photo-put-back"].run()
    robot.frames(2)
    photos.putting_back.join()
    robot.frames(3)
    assert photos.aligned
    assert app.scene.photo is not None
    assert app.scene.photo.before == 1.0


def test_another_photo_of_which_nothing_is_known_switches_it_off(quick: Robot, path: Path, slow: Slow) -> None:
    photos = show(quick, path)
    photos.put_back()
    show(quick, path, known=False)
    assert not photos.putting_back.on


@pytest.mark.parametrize("what", ["low", "creature"])
def test_what_to_do_first_is_true(open_window: OpenWindow, path: Path, what: str) -> None:
    robot = open_window(what, (680, 540))
    photos = show(robot, path, known=False)
    assert not robot.app.actions["photo-put-back"].enabled()
    assert not robot.app.actions["photo-save"].enabled()
    if what == "low":
        assert photos.takes_expressions
        assert photos.put_back_problem.startswith("Take the expression first")
        assert "pins" not in photos.put_back_problem
        photos.pin_place("8.3")
        robot.click(at(robot, (150.0, 100.0)))
        assert "pins alone do not tell" in photos.put_back_problem
    else:
        assert not photos.takes_expressions
        assert "Take the expression" not in photos.put_back_problem
        assert "use another character" in photos.put_back_problem
    path.unlink()
    photos.textures.release()
    show(robot, path)
    assert photos.put_back_problem == "The file of the photo cannot be read."
