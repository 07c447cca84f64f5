"""Photos at the window, by pointer and keys: dropped, pinned, posed after, saved and opened again."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from imgui_bundle import imgui
from PIL import Image

from faceposer.geometry.camera import Camera
from faceposer.geometry.picture_view import PictureView
from faceposer.gui.events import Drop
from faceposer.gui.features.photo.feature import PhotoFeature
from faceposer.gui.testing.scripted_user import Robot
from faceposer.model.face_model import FaceModel
from faceposer.photo.photo import Photo, Pin
from faceposer.photo.places import GUIDED, guided
from faceposer.render.offscreen import render_character
from tests.windows import OpenWindow

pytestmark = pytest.mark.gl

SIZE = (400, 300)
TAKEN = Camera(np.diag([1.0, -1.0, -1.0]), np.array([4.0, -3.0, 100.0]), 800.0, SIZE)
SMILE = {"mouthSmileLeft": 0.8, "mouthSmileRight": 0.8}


@pytest.fixture
def robot(open_window: OpenWindow) -> Robot:
    return open_window("man", (680, 540), pictures=True)


@pytest.fixture
def quick(open_window: OpenWindow) -> Robot:
    """The robot where the picture itself does not matter."""
    return open_window("man", (680, 540))


@pytest.fixture
def photo(tmp_path: Path) -> Path:
    """A red picture with a green square in its middle."""
    pixels = np.zeros((300, 400, 3), dtype=np.uint8)
    pixels[...] = (200, 30, 30)
    pixels[130:170, 180:220] = (20, 220, 20)
    path = tmp_path / "face.png"
    Image.fromarray(pixels).save(path)
    return path


def open_photo(robot: Robot, path: Path) -> None:
    """Drop the photo, show it behind the face and begin to set pins."""
    drop(robot, path)
    robot.click_widget("choice:0")
    robot.frames(2)
    robot.key("O")


def drop(robot: Robot, *files: Path) -> None:
    robot.app.window.play_event(Drop(tuple(map(str, files))))
    # A dialog is visible after some frames.
    robot.frames(5)


def at(robot: Robot, pixel: tuple[float, float]) -> tuple[float, float]:
    """Where in the window the view shows ``pixel`` of the photo."""
    viewport = robot.app.viewport
    view = viewport.view
    assert isinstance(view, PictureView)
    scale = view.scale(viewport.size)
    x, y = (viewport.origin[i] + viewport.size[i] / 2 + (pixel[i] - view.middle[i]) * scale for i in range(2))
    return (x, y)


def pin(robot: Robot, count: int) -> None:
    """Press where a photo of the smiling face itself would have its features."""
    model = robot.app.session.model
    vertices = model.instance(model.coefficients_of(SMILE))
    for name in GUIDED[:count]:
        assert robot.app.toolbox.photo_tool.place == name
        u, v = TAKEN.project(vertices[[model.character.feature_points[name]]])[0].tolist()
        robot.click(at(robot, (u, v)))


def test_the_face_is_put_back_into_its_photo(robot: Robot, tmp_path: Path) -> None:
    """The photo shows the neutral man; once he smiles, the view shows the photo with the smile."""
    app = robot.app
    model = app.session.model
    shot = tmp_path / "man.png"
    Image.fromarray(render_character(model.character, model.surface(model.neutral()), TAKEN)).save(shot)
    taken = Photo(str(shot), SIZE, camera=TAKEN).with_expression(model, model.neutral())
    with app.session.edit("Open a photo"):
        app.session.replace(replace(app.session.document, photos=(taken,)))
    photos = app.features[PhotoFeature]
    photos.choose(0)
    robot.frames(2)
    robot.click_widget("tab:Photo")
    assert not photos.put_back_problem
    robot.click_widget("photo-put-back")
    robot.frames(2)
    photos.putting_back.join()
    robot.frames(3)
    layer = app.scene.photo
    assert layer is not None
    assert layer.before == 1.0
    first = layer.picture.read()
    app.session.rebase_pose(model.coefficients_of(SMILE), "Smile")
    robot.frames(2)
    # The last picture is shown until the new one is there.
    assert app.scene.photo is not None
    assert app.scene.photo.picture.read() == first
    photos.putting_back.join()
    robot.frames(3)
    assert app.scene.photo is not None
    assert app.scene.photo.before == 1.0
    assert app.scene.photo.picture.read() != first
    robot.click_widget("photo-put-back")
    robot.frames(2)
    assert app.scene.photo is not None
    assert app.scene.photo.before < 1.0


def beside(robot: Robot) -> tuple[tuple[float, float], tuple[float, float]]:
    """Two places beside the face."""
    left, top, _, bottom = robot.app.widget_rects["view"]
    return (left + 20.0, 0.7 * bottom + 0.3 * top), (left + 80.0, 0.5 * bottom + 0.5 * top)


def pin_at_once(robot: Robot, count: int) -> None:
    """Pin as ``pin`` does, without the pointer."""
    app = robot.app
    session, tool = app.session, app.toolbox.photo_tool
    vertices = session.model.instance(session.model.coefficients_of(SMILE))
    photo = session.document.photos[0]
    for name in GUIDED[:count]:
        u, v = TAKEN.project(vertices[[session.model.character.feature_points[name]]])[0].tolist()
        photo = photo.with_pin(Pin(name, (u, v)))
    with session.edit("Set pins"):
        tool.change(photo, app.viewport)
    robot.frames(2)


def test_the_view_is_zoomed_by_the_user_alone(quick: Robot, photo: Path) -> None:
    robot = quick
    app = robot.app
    open_photo(robot, photo)
    view = app.viewport.view
    assert isinstance(view, PictureView)
    scale, middle = view.scale(app.viewport.size), view.middle
    for count in (3, 4, 5, 15):
        pin_at_once(robot, count)
        robot.frames(2)
        seen = app.viewport.view
        assert isinstance(seen, PictureView)
        assert (seen.scale(app.viewport.size), seen.middle) == (scale, middle)
    app.actions["photo-pose"].run()
    robot.click_widget("tab:Photo")
    robot.click_widget("photo:0")
    seen = app.viewport.view
    assert isinstance(seen, PictureView)
    assert (seen.scale(app.viewport.size), seen.middle) == (scale, middle)
    robot.key("F")
    seen = app.viewport.view
    assert isinstance(seen, PictureView)
    assert seen.scale(app.viewport.size) != scale


def colour(robot: Robot, place: tuple[float, float]) -> np.ndarray:
    picture = robot.app.screenshot()
    scale = picture.shape[1] / robot.app.window.size[0]
    return picture[int(place[1] * scale), int(place[0] * scale)].astype(int)


def test_a_photo_is_pinned_posed_after_saved_and_opened_again(quick: Robot, photo: Path, tmp_path: Path) -> None:
    robot = quick
    app = robot.app
    open_photo(robot, photo)
    assert app.session.undo_label == "Open a photo"
    assert app.toolbox.chosen.name == "photo"
    pin(robot, 5)
    pin_at_once(robot, 15)
    found = app.session.document.photos[0].camera
    assert found is not None
    np.testing.assert_allclose(found.rotation, TAKEN.rotation, atol=0.05)
    app.actions["photo-pose"].run()
    robot.frames(2)
    weights = dict(
        zip(
            app.session.model.character.shape_names,
            app.session.model.weights_of(app.session.coefficients).tolist(),
            strict=True,
        )
    )
    assert weights["mouthSmileLeft"] > 0.3
    assert app.session.undo_label == "Pose from the photo"
    pose = app.session.coefficients.copy()
    path = tmp_path / "posed.json"
    app.session.save(path, found)
    robot.key("1")
    assert not isinstance(app.viewport.view, PictureView)
    assert app.scene.photo is None
    app.files.open(str(path))
    robot.frames(3)
    assert not app.dialogs.open
    view = app.viewport.view
    assert isinstance(view, PictureView)
    photo_camera = app.session.document.photos[0].camera
    assert photo_camera is not None
    assert view.photo == photo_camera
    assert view.locked
    assert app.scene.photo is not None
    whole = PictureView.whole(photo_camera, (0.0, 0.0, 0.0))
    assert view.scale(app.viewport.size) == whole.scale(app.viewport.size), "all of the photo is shown"
    np.testing.assert_array_equal(app.session.coefficients, pose)


def test_tools_draw_under_the_photos_camera_and_lead_back_to_it(quick: Robot, photo: Path) -> None:
    robot = quick
    app = robot.app
    open_photo(robot, photo)
    pin_at_once(robot, 6)
    photo_camera = app.session.document.photos[0].camera
    assert photo_camera is not None
    robot.key("Q")
    robot.key("F")
    x, y = robot.at("5.1")
    robot.drag((x, y), (x + 12.0, y - 9.0), steps=3)
    drawn = app.session.document.constraints[-1]
    assert drawn.camera is not None
    assert drawn.camera.same_viewpoint(photo_camera), "tools draw under the photo's camera"
    assert app.session.residuals_px[-1] < np.hypot(12.0, 9.0) - 3.0
    robot.wheel(2)
    assert np.hypot(*(np.subtract(robot.at("5.1"), robot.position))) < 20.0
    robot.key("1")
    app.viewport.look_through(drawn.camera)
    robot.frames(2)
    assert isinstance(app.viewport.view, PictureView)
    assert app.scene.photo is not None, "its view is that of the photo"
    assert app.viewport.view.photo == photo_camera
    assert app.viewport.view.locked
    robot.click_widget("tab:Photo")
    robot.click_widget("photo:0:delete")
    robot.key("1")
    app.viewport.look_through(drawn.camera)
    robot.frames(2)
    assert app.scene.photo is None
    robot.drag(*beside(robot), steps=2)
    assert not app.viewport.view.aligned, "without the photo nothing locks its view"


def test_photo_and_face_keep_together(quick: Robot, photo: Path) -> None:
    robot = quick
    app = robot.app
    open_photo(robot, photo)
    pin_at_once(robot, 6)
    robot.key("Esc")
    view = app.viewport.view
    assert isinstance(view, PictureView)

    def checked() -> None:
        robot.frames(2)
        camera = app.viewport.camera
        assert app.session.document.photos[0].camera is not None
        assert camera.same_viewpoint(app.session.document.photos[0].camera)
        assert app.scene.photo is not None
        left, top, right, bottom = app.scene.photo.corners(camera)
        corner, end = at(robot, (0.0, 0.0)), at(robot, SIZE)
        origin = app.viewport.origin
        np.testing.assert_allclose((left + origin[0], top + origin[1]), corner, atol=1e-6)
        np.testing.assert_allclose((right + origin[0], bottom + origin[1]), end, atol=1e-6)

    checked()
    robot.move(at(robot, (250.0, 150.0)))
    robot.wheel(3)
    checked()
    begin = at(robot, (200.0, 100.0))
    robot.drag(begin, (begin[0] + 40, begin[1] + 25), steps=2, button="middle", modifiers=frozenset({"shift"}))
    checked()
    app.window.set_size((600, 560))
    checked()
    before = app.viewport.view
    robot.drag(*beside(robot), steps=2)
    assert app.viewport.view == before, "locked"
    robot.click_widget("photo-lock")
    robot.drag(*beside(robot), steps=2)
    assert not app.viewport.view.aligned  # type: ignore[union-attr]
    robot.click_widget("photo-look")
    checked()
    robot.key("F")
    checked()
    head = app.viewport.camera.project(app.scene.vertices)
    assert (head.max(axis=0) < app.viewport.size).all()
    assert np.ptp(head[:, 1]) > 0.6 * app.viewport.size[1]


def test_the_photo_lies_behind_or_before_the_face(robot: Robot, photo: Path) -> None:
    app = robot.app
    open_photo(robot, photo)
    robot.key("Q")
    robot.frames(2)
    beside, middle = at(robot, (20.0, 150.0)), at(robot, (200.0, 152.0))
    np.testing.assert_allclose(colour(robot, beside), (200, 30, 30), atol=4)
    behind = colour(robot, middle)
    assert behind[1] < 215, "the face lies over the green square"
    left, top, right, bottom = app.widget_rects["photo-opacity"]
    robot.click((left + 0.98 * (right - left) * 0.6, (top + bottom) / 2))
    robot.drag(((left + right) / 2, (top + bottom) / 2), (left + 1, (top + bottom) / 2), steps=3)
    assert app.session.document.photos[0].opacity == 0.0
    np.testing.assert_allclose(colour(robot, middle), (20, 220, 20), atol=6)
    robot.click_widget("photo-layer:1")
    assert app.session.document.photos[0].front
    assert colour(robot, beside).max() < 130, "nothing is seen of the photo"
    robot.key("Shift+O")
    assert app.scene.photo is None
    robot.key("Ctrl+Z")
    assert app.scene.photo is not None


def test_pins_by_keys_and_list_and_several_photos(quick: Robot, photo: Path, tmp_path: Path) -> None:
    robot = quick
    app = robot.app
    app.window.set_size((680, 1000))
    open_photo(robot, photo)
    tool = app.toolbox.photo_tool
    robot.key("Tab")
    assert tool.place == GUIDED[1]
    robot.click(at(robot, (150.0, 100.0)))
    robot.key("Delete")
    assert app.session.document.photos[0].pins == ()
    robot.click_widget(f"pin:{GUIDED[4]}")
    assert tool.place == GUIDED[4]
    robot.click(at(robot, (200.0, 150.0)))
    robot.click_widget(f"pin:{GUIDED[4]}:delete")
    assert app.session.document.photos[0].pins == ()
    second = tmp_path / "other.png"
    Image.new("RGB", (300, 500), (10, 10, 200)).save(second)
    drop(robot, second)
    robot.key("Enter")
    robot.frames(3)
    assert len(app.session.document.photos) == 2
    assert app.viewport.view.photo.size == (300, 500)  # type: ignore[union-attr]
    robot.click(at(robot, (100.0, 100.0)))
    assert [len(p.pins) for p in app.session.document.photos] == [0, 1]
    robot.click_widget("photo:0")
    assert app.viewport.view.photo.size == (400, 300)  # type: ignore[union-attr]
    robot.click_widget("photo:0:delete")
    assert [p.name for p in app.session.document.photos] == ["other.png"]
    robot.key("Ctrl+Z")
    assert len(app.session.document.photos) == 2
    for _ in range(8):
        robot.key("Ctrl+Z")
    assert app.session.document.photos == ()
    assert not isinstance(app.viewport.view, PictureView)
    assert app.toolbox.chosen.name == "point"


def test_what_is_no_photo_or_gone_is_said(quick: Robot, photo: Path, tmp_path: Path) -> None:
    robot = quick
    app = robot.app
    bad = tmp_path / "bad.jpg"
    bad.write_text("nothing")
    drop(robot, bad)
    assert app.dialogs.open
    robot.key("Esc")
    robot.frames(2)
    if app.dialogs.open:
        robot.click_widget("choice:0")
    assert app.session.document.photos == ()
    open_photo(robot, photo)
    app.session.save(tmp_path / "a.json", app.viewport.camera)
    photo.unlink()
    app.files.open(str(tmp_path / "a.json"))
    robot.frames(3)
    assert app.dialogs.open, "the session is open, with a word on the file"
    assert len(app.session.document.photos) == 1
    assert app.scene.photo is None
    robot.click_widget("choice:0")
    Image.new("RGB", (40, 40)).save(photo)
    app.files.open(str(tmp_path / "a.json"))
    robot.frames(3)
    assert app.dialogs.open, "another picture has its name"


@pytest.mark.gl
def test_the_picture_of_the_renderer_has_the_photo_where_its_camera_says(model: FaceModel) -> None:
    pixels = np.zeros((300, 400, 3), dtype=np.uint8)
    pixels[100:150, 300:350] = 255
    character = model.character
    camera = PictureView.whole(TAKEN, (0.0, 0.0, 0.0)).zoomed(2.0).panned(-60.0, 40.0, SIZE).camera(SIZE)
    away = character.vertices + np.float32([0.0, 0.0, 500.0])
    picture = render_character(character, away, camera, samples=0, photo=(pixels, TAKEN, 1.0, 0.0))
    rows, columns = np.nonzero(picture[:, :, 0] > 128)
    scale = camera.focal / TAKEN.focal
    low = (np.array([300.0, 100.0]) - TAKEN.principal_point) * scale + camera.principal_point
    high = (np.array([350.0, 150.0]) - TAKEN.principal_point) * scale + camera.principal_point
    assert abs(columns.min() - low[0]) < 1.5
    assert abs(rows.min() - low[1]) < 1.5
    assert abs(columns.max() + 1 - min(high[0], 400)) < 1.5
    assert abs(rows.max() + 1 - high[1]) < 1.5
    covered = render_character(character, character.vertices, camera, samples=0, photo=(pixels, TAKEN, 1.0, 1.0))
    np.testing.assert_array_equal(covered, picture)


def test_names_of_pins_are_whole_in_the_list(quick: Robot, photo: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    robot, app = quick, quick.app
    app.window.set_size((900, 2200))
    open_photo(robot, photo)
    robot.frames(2)
    written: list[str] = []
    add = imgui.ImDrawList.add_text
    monkeypatch.setattr(
        imgui.ImDrawList, "add_text", lambda draw, *given: (written.append(given[-1]), add(draw, *given))[1]
    )
    robot.frames(1)
    text = " ".join(written)
    titles = app.session.model.character.feature_titles
    assert not any("..." in line for line in written)
    for name in guided(app.session.model.character):
        assert titles[name] in text


def test_undo_asks_for_the_pin_and_for_skipped_ones_again(quick: Robot, photo: Path) -> None:
    robot, app, tool = quick, quick.app, quick.app.toolbox.photo_tool
    open_photo(robot, photo)
    pin(robot, 2)
    third = tool.place
    robot.key("Tab")
    fourth = tool.place
    assert fourth not in (third, None)
    robot.click(at(robot, (50.0, 60.0)))
    fifth = tool.place
    assert app.session.document.photos[0].pins[-1].place == fourth
    robot.key("Ctrl+Z")
    robot.frames(2)
    assert tool.place == fourth
    robot.key("Ctrl+Z")
    robot.frames(2)
    assert tool.place == third, "the skipped one"
    assert len(app.session.document.photos[0].pins) == 2
    robot.key("Ctrl+Z")
    robot.frames(2)
    assert tool.place == GUIDED[1]
    assert len(app.session.document.photos[0].pins) == 1
    robot.key("Ctrl+Shift+Z")
    robot.frames(2)
    assert tool.place == third
    assert fifth != fourth
