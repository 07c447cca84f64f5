"""Files of other programs in the window: the export dialog, films with progress, and poses that are opened."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from faceposer.animation.keyframes import Keyframes
from faceposer.geometry.mesh_io import read_mesh
from faceposer.gui.app import App
from faceposer.gui.events import Drop
from faceposer.gui.features.export.feature import ExportFeature
from faceposer.gui.features.import_character.feature import ImportCharacterFeature
from faceposer.gui.testing.scripted_user import Robot
from faceposer.gui.widgets.file_dialogs import FileDialogs
from faceposer.gui.widgets.file_request import FileRequest
from faceposer.interchange.formats import write
from faceposer.model.performance import Performance
from faceposer.render.options import OutputOptions
from faceposer.render.shots import usual_rate
from faceposer.training.capture import read_capture
from tests.windows import OpenWindow

pytestmark = pytest.mark.gl


@pytest.fixture
def robot(open_window: OpenWindow) -> Robot:
    return open_window()


def exchange_of(app: App) -> ExportFeature:
    return next(feature for feature in app.features._features if isinstance(feature, ExportFeature))


def choose(robot: Robot, name: str) -> None:
    """Give ``name`` to the file dialog."""
    robot.key("Ctrl+A")
    robot.type(name)
    robot.click_widget("files:accept")


def posed(robot: Robot) -> np.ndarray:
    """Open the jaw and return the pose."""
    session = robot.app.session
    pose = session.model.coefficients_of({"jawOpen": 0.8})
    with session.edit("Pose"):
        session.set_start(pose)
    robot.frames(2)
    return pose


@pytest.mark.parametrize("suffix", ["obj", "ply", "csv", "json", "glb"])
def test_the_dialog_exports_the_pose(suffix: str, robot: Robot, tmp_path: Path) -> None:
    app, pose = robot.app, posed(robot)
    app.actions["export-other"].run()
    robot.frames(6)
    assert app.is_modal
    robot.click_widget(f"export:{suffix}")
    robot.click_widget("export:accept")
    assert not exchange_of(app).open
    choose(robot, "face")
    path = tmp_path / f"face.{suffix}"
    assert app.notice == f"Saved face.{suffix}"
    assert not app.is_modal
    if suffix in ("obj", "ply"):
        np.testing.assert_allclose(read_mesh(path).vertices, app.session.model.surface(pose), atol=1e-4)
    if suffix == "csv":
        assert read_capture(path).weights[0].max() == pytest.approx(0.8, abs=0.02)
    assert path.stat().st_size > 500
    app.actions["export-other"].run()
    assert exchange_of(app).form.suffix == f".{suffix}", "what was chosen is there the next time"


def test_escape_and_cancel_put_the_dialog_away(robot: Robot, tmp_path: Path) -> None:
    app = robot.app
    for way in (lambda: robot.key("Esc"), lambda: robot.click_widget("export:cancel")):
        app.actions["export-other"].run()
        robot.frames(6)
        assert exchange_of(app).open
        way()
        assert not exchange_of(app).open
        assert not app.is_modal
    assert not app.session.can_undo
    assert not [*tmp_path.iterdir()]


def test_keys_do_nothing_beneath_the_dialog(robot: Robot) -> None:
    app = robot.app
    app.actions["export-other"].run()
    robot.frames(6)
    before = app.wireframe
    robot.key("W")
    assert app.wireframe == before
    robot.key("Esc")
    robot.key("W")
    assert app.wireframe != before


def test_a_picture_is_what_the_view_shows(robot: Robot, tmp_path: Path) -> None:
    app = robot.app
    exchange = exchange_of(app)
    exchange.form.suffix, exchange.form.width, exchange.form.height = ".png", 120, 100
    for name in ("front", "left"):
        app.viewport.look(name)
        exchange.export(tmp_path / f"{name}.png")
        robot.frames(2)
    pictures = [np.asarray(Image.open(tmp_path / f"{name}.png"), dtype=float) for name in ("front", "left")]
    assert pictures[0].shape == (100, 120, 3)
    assert np.abs(pictures[0] - pictures[1]).max() > 30


def test_a_film_is_drawn_between_frames(robot: Robot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("faceposer.gui.features.export.feature._DRAW_SECONDS", 1e-9)
    app = robot.app
    exchange = exchange_of(app)
    form = exchange.form
    form.suffix, form.width, form.height, form.seconds, form.rate = ".gif", 64, 48, 1.0, 8
    exchange.export(tmp_path / "a.gif")
    robot.frames(3)
    assert exchange.job is not None
    assert 0.1 < exchange.job.share < 0.9
    assert app.is_modal
    assert exchange.patience == 0.0
    assert "export:progress" in app.widget_rects
    robot.frames(10)
    assert exchange.job is None
    assert app.notice == "Saved a.gif"
    with Image.open(tmp_path / "a.gif") as film:
        assert film.n_frames == 8
        assert film.size == (64, 48)


def test_a_film_can_be_stopped(robot: Robot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("faceposer.gui.features.export.feature._DRAW_SECONDS", 1e-9)
    exchange = exchange_of(robot.app)
    form = exchange.form
    form.suffix, form.width, form.height = ".gif", 64, 48
    exchange.export(tmp_path / "a.gif")
    robot.frames(3)
    robot.click_widget("export:cancel")
    assert exchange.job is None
    assert not robot.app.is_modal
    assert not [*tmp_path.iterdir()]


def test_an_image_too_large_for_the_memory_is_told(
    robot: Robot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_args: object) -> None:
        raise MemoryError

    monkeypatch.setattr("faceposer.render.film.with_palette", full)
    exchange = exchange_of(robot.app)
    exchange.form.suffix, exchange.form.width, exchange.form.height = ".gif", 64, 48
    exchange.export(tmp_path / "a.gif")
    while exchange.job is not None:
        robot.frames()
    assert robot.app.dialogs.waiting[0].text == "There is not enough memory; choose a smaller image or a lower rate."
    assert not [*tmp_path.iterdir()]


def test_the_animation_of_the_window_is_what_moves(robot: Robot, tmp_path: Path) -> None:
    app = robot.app
    exchange, model = exchange_of(app), app.session.model
    take = Performance(np.linspace(0, 1, 5)[:, None] * model.coefficients_of({"jawOpen": 1.0}), 30.0)
    exchange.performance = lambda: take
    exchange.form.suffix = ".csv"
    exchange.export(tmp_path / "a.csv")
    assert len(read_capture(tmp_path / "a.csv").weights) == 5
    exchange.form.animated = False
    exchange.export(tmp_path / "b.csv")
    assert len(read_capture(tmp_path / "b.csv").weights) == 1
    exchange.form.suffix = ".obj"
    exchange.export(tmp_path / "a.obj")
    assert (tmp_path / "a.obj").is_file()
    assert (tmp_path / "a.mtl").is_file()
    exchange.form.suffix = ".gif"
    app.actions["export-other"].run()
    robot.frames(6)
    assert "export:seconds" in app.widget_rects
    robot.click_widget("export:animation")
    robot.click_widget("export:obj")
    robot.click_widget("export:accept")
    choose(robot, "yawn")
    robot.frames(8)
    assert app.notice == "Saved yawn"
    meshes = sorted((tmp_path / "yawn").glob("*.obj"))
    assert [mesh.name for mesh in meshes] == [f"yawn.000{i}.obj" for i in range(1, 6)]
    np.testing.assert_allclose(read_mesh(meshes[4]).vertices, model.surface(take.coefficients[4]), atol=1e-4)


@pytest.mark.usefixtures("no_ffmpeg")
def test_what_goes_wrong_is_told_and_nothing_is_lost(robot: Robot, tmp_path: Path) -> None:
    app, pose = robot.app, posed(robot)
    exchange = exchange_of(app)
    exchange.form.suffix = ".mp4"
    exchange.export(tmp_path / "a.mp4")
    robot.frames(2)
    assert "ffmpeg" in app.dialogs.waiting[0].text
    robot.key("Enter")
    exchange.form.suffix = ".glb"
    exchange.export(tmp_path / "none" / "a.glb")
    assert "cannot be written" in app.dialogs.waiting[0].text
    robot.frames(2)
    robot.key("Enter")
    assert not app.is_modal
    np.testing.assert_array_equal(app.session.coefficients, pose)


def test_a_pose_is_opened_and_can_be_undone(robot: Robot, tmp_path: Path) -> None:
    app = robot.app
    pose = app.session.model.coefficients_of({"mouthSmileLeft": 1.0, "browInnerUp": 0.7})
    write(tmp_path / "smile.obj", app.session.model, pose, OutputOptions(contact=False))
    robot.drag(robot.at("8.3"), (robot.at("8.3")[0] + 20, robot.at("8.3")[1] - 30))
    dragged = app.session.coefficients
    assert app.session.document.constraints
    app.actions["open-pose"].run()
    robot.frames(2)
    choose(robot, "smile.obj")
    robot.frames(2)
    assert app.notice.startswith("Opened smile.obj. The pose matches the mesh exactly.")
    assert not app.session.document.constraints
    np.testing.assert_allclose(app.session.coefficients, pose, atol=1e-3)
    np.testing.assert_allclose(app.scene.vertices, app.session.model.surface(pose), atol=1e-3)
    assert app.session.dirty
    assert app.session.undo_label == "Open a pose"
    robot.key("Ctrl+Z")
    assert app.session.document.constraints
    np.testing.assert_array_equal(app.session.coefficients, dragged)
    robot.key("Ctrl+Shift+Z")
    np.testing.assert_allclose(app.session.coefficients, pose, atol=1e-3)


def test_a_mesh_that_is_dropped_is_a_pose(robot: Robot, tmp_path: Path) -> None:
    app = robot.app
    pose = app.session.model.coefficients_of({"jawOpen": 0.6})
    write(tmp_path / "a.ply", app.session.model, pose)
    app.router.route([Drop((str(tmp_path / "a.ply"),))])
    np.testing.assert_allclose(app.session.coefficients, pose, atol=1e-3)
    app.session.undo()
    app.features[ImportCharacterFeature].show()
    app.router.route([Drop((str(tmp_path / "a.ply"),))])
    assert not app.features[ImportCharacterFeature].open, "a single mesh is no source of an import"
    np.testing.assert_allclose(app.session.coefficients, pose, atol=1e-3)


def test_a_pose_of_another_face_is_refused(robot: Robot, tmp_path: Path) -> None:
    app, pose = robot.app, posed(robot)
    (tmp_path / "a.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    exchange_of(app).open_pose(tmp_path / "a.obj")
    count = len(app.session.model.character.vertices)
    assert f"has 3 vertices, but Low-poly head has {count}" in app.dialogs.waiting[0].text
    np.testing.assert_array_equal(app.session.coefficients, pose)


def test_weights_are_opened_as_a_pose(robot: Robot, tmp_path: Path) -> None:
    app = robot.app
    model = app.session.model
    pose = model.coefficients_of({"jawOpen": 0.5})
    write(tmp_path / "a.csv", model, Performance(np.stack([pose, 0 * pose]), 30.0))
    exchange_of(app).open_pose(tmp_path / "a.csv")
    assert "Frame 1 of 2" in app.notice
    np.testing.assert_allclose(model.instance(app.session.coefficients), model.instance(pose), atol=0.15)


def open_export(robot: Robot, suffix: str) -> None:
    """Open the export dialog, choose a format and go on to the name of the file."""
    robot.app.actions["export-other"].run()
    robot.frames(6)
    robot.click_widget(f"export:{suffix}")
    robot.click_widget("export:accept")
    robot.frames(1)


def test_the_suffix_typed_decides_or_is_replaced(robot: Robot, tmp_path: Path) -> None:
    app = robot.app
    open_export(robot, "glb")
    choose(robot, "face.ply")
    assert app.notice == "Saved face.ply"
    assert exchange_of(app).form.suffix == ".ply"
    for typed, saved in (
        ("other.stl", "other.glb"),
        ("double.glb.glb", "double.glb"),
        ("v1.2 smile", "v1.2 smile.glb"),
    ):
        open_export(robot, "glb")
        robot.key("Ctrl+A")
        robot.type(typed)
        robot.frames(2)
        browser = app.file_dialogs._browser
        assert browser is not None
        assert browser.advice() == (f"Will be saved as {saved}", typed != "v1.2 smile")
        robot.click_widget("files:accept")
        expected = f"'{typed}' was saved as '{saved}'" if typed != "v1.2 smile" else f"Saved {saved}"
        assert app.notice == expected
    names = sorted(path.name for path in tmp_path.iterdir())
    assert names == ["double.glb", "face.ply", "other.glb", "v1.2 smile.glb"]


def test_what_cannot_hold_the_animation_is_not_taken_for_it(robot: Robot, tmp_path: Path) -> None:
    app = robot.app
    exchange, model = exchange_of(app), app.session.model
    take = Performance(np.linspace(0, 1, 3)[:, None] * model.coefficients_of({"jawOpen": 1.0}), 30.0)
    exchange.performance = lambda: take
    open_export(robot, "csv")
    choose(robot, "a.ply")
    assert app.notice == "'a.ply' was saved as 'a.csv'"
    assert len(read_capture(tmp_path / "a.csv").weights) == 3


def test_sessions_and_meshes_are_named_once(robot: Robot, tmp_path: Path) -> None:
    app = robot.app
    posed(robot)
    for action, typed, saved in (
        ("save-as", "v1.2 smile", "v1.2 smile.json"),
        ("save-as", "smile.gif", "smile.json"),
        ("save-as", "smile.json.json", "smile.json"),
        ("export-as", "face.obj.obj", "face.obj"),
        ("export-as", "face.json", "face.obj"),
    ):
        app.actions[action].run()
        robot.frames(2)
        choose(robot, typed)
        robot.frames(1)
        if app.file_dialogs.open:
            robot.click_widget("files:accept")
        assert not app.file_dialogs.open
        assert (tmp_path / saved).is_file()
    names = {path.name for path in tmp_path.iterdir() if path.suffix in (".json", ".obj", ".gif")}
    assert names == {"v1.2 smile.json", "smile.json", "face.obj"}


def test_a_sequence_of_pictures_without_background(robot: Robot, tmp_path: Path) -> None:
    app = robot.app
    exchange, model = exchange_of(app), app.session.model
    take = Performance(np.linspace(0, 1, 3)[:, None] * model.coefficients_of({"jawOpen": 1.0}), 30.0)
    exchange.performance = lambda: take
    exchange.form.width, exchange.form.height = 64, 48
    (tmp_path / "taken").mkdir()
    (tmp_path / "taken" / "notes.txt").touch()
    app.actions["export-other"].run()
    robot.frames(6)
    robot.click_widget("export:png")
    robot.click_widget("export:transparent")
    robot.click_widget("export:accept")
    choose(robot, "taken")
    assert app.file_dialogs.open
    assert "not an empty folder" in app.file_dialogs._browser.message
    robot.click_widget("files:name")
    choose(robot, "v1.2 take.png")
    robot.frames(8)
    assert app.notice == "Saved v1.2 take"
    frames = sorted((tmp_path / "v1.2 take").iterdir())
    assert [frame.name for frame in frames] == [f"v1.2 take.000{i}.png" for i in (1, 2, 3)]
    with Image.open(frames[0]) as picture:
        assert (picture.mode, picture.size) == ("RGBA", (64, 48))
        assert picture.getextrema()[3] == (0, 255)
    exchange.form.animated = False
    open_export(robot, "png")
    choose(robot, "one")
    robot.frames(4)
    with Image.open(tmp_path / "one.png") as picture:
        assert picture.mode == "RGBA"
    exchange.form.suffix = ".gif"
    exchange.export(tmp_path / "a.gif")
    robot.frames(2)
    assert not app.dialogs.waiting, "a film takes no notice of the switch of pictures"


def test_materials_can_be_left_out_and_foreign_ones_are_asked_about(robot: Robot, tmp_path: Path) -> None:
    app = robot.app
    (tmp_path / "a.mtl").write_text("newmtl theirs\n")
    open_export(robot, "obj")
    choose(robot, "a")
    assert app.file_dialogs.open
    assert app.file_dialogs._browser.message == "'a.mtl' already exists; press Replace to overwrite it."
    robot.click_widget("files:accept")
    assert app.notice == "Saved a.obj"
    assert (tmp_path / "a_skin.jpg").is_file()
    open_export(robot, "obj")
    choose(robot, "a")
    assert app.file_dialogs._browser.message == "'a.obj' already exists; press Replace to overwrite it."
    robot.click_widget("files:accept")
    app.actions["export-other"].run()
    robot.frames(6)
    robot.click_widget("export:materials")
    robot.click_widget("export:accept")
    choose(robot, "b")
    assert app.notice == "Saved b.obj"
    app.actions["export-as"].run()
    robot.frames(2)
    choose(robot, "c")
    assert sorted(path.name for path in tmp_path.glob("[bc]*")) == ["b.obj", "c.obj"]
    assert not app.settings.materials


@pytest.mark.usefixtures("no_ffmpeg")
def test_mp4_is_not_offered_without_ffmpeg(robot: Robot, tmp_path: Path) -> None:
    app = robot.app
    exchange = exchange_of(app)
    exchange.form.suffix = ".mp4"
    app.actions["export-other"].run()
    robot.frames(6)
    assert exchange.form.suffix == ".glb"
    robot.click_widget("export:mp4")
    assert exchange.form.suffix == ".glb"
    robot.click_widget("export:gif")
    robot.click_widget("export:accept")
    robot.key("Ctrl+A")
    robot.type("a.mp4")
    robot.frames(1)
    assert app.file_dialogs._browser.advice() == ("Will be saved as a.gif", True)


def test_the_dialog_stays_where_it_is_when_the_format_changes(robot: Robot) -> None:
    robot.app.actions["export-other"].run()
    robot.frames(6)
    places = set()
    for suffix in ("glb", "obj", "png", "gif", "csv"):
        robot.click_widget(f"export:{suffix}")
        robot.frames(3)
        places.add((robot.app.widget_rects["export:accept"], robot.app.widget_rects["export:glb"]))
    assert len(places) == 1


def test_an_answer_of_the_systems_dialog_follows_the_same_rule(robot: Robot, tmp_path: Path) -> None:
    class Answer:
        def __init__(self, name: str) -> None:
            self.name = name

        def ready(self, _timeout: int) -> bool:
            return True

        def result(self) -> str:
            return str(tmp_path / self.name)

    saved: list[str] = []
    notices: list[str] = []
    dialogs = FileDialogs(robot.app.gui.fonts, robot.app.widget_rects, True, notices.append)
    request = FileRequest("save", "Save", "Meshes", (".obj",), tmp_path, lambda path: saved.append(path.name))
    (tmp_path / "old.obj").touch()
    for answer in ("face", "v1.2 smile.obj", "face.gif", "old.obj"):
        dialogs._native = (request, Answer(answer))
        dialogs.poll()
        assert not dialogs.open
    assert saved == ["face.obj", "v1.2 smile.obj", "face.obj", "old.obj"], "the system has asked about old.obj"
    assert notices == ["'face.gif' was saved as 'face.obj'"]
    dialogs._native = (request, Answer("old.stl"))
    dialogs.poll()
    assert dialogs.browsing, "nobody has been asked about old.obj"
    assert dialogs._browser.message == "'old.obj' already exists; press Replace to overwrite it."
    assert len(saved) == 4


def test_a_video_has_the_rate_of_the_animation_unless_one_is_typed(robot: Robot, tmp_path: Path) -> None:
    app = robot.app
    model = app.session.model
    keyframes = Keyframes(rate=30.0, length=12).with_key(0, model.neutral())
    app.session.animation.load(keyframes.with_key(11, model.coefficients_of({"jawOpen": 0.5})), "Animation")
    exchange = exchange_of(app)
    exchange.form.suffix, exchange.form.width, exchange.form.height = ".gif", 64, 48
    assert exchange.form.rate is None
    exchange.export(tmp_path / "a.gif")
    while exchange.job is not None:
        robot.frames()
    assert usual_rate(".gif", 30.0) == 25.0
    assert usual_rate(".mp4", 30.0) == 30.0
    with Image.open(tmp_path / "a.gif") as video:
        assert video.info["duration"] == 40
