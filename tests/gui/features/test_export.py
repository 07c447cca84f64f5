"""Files of other programs in the window: the export dialog, films with progress, and poses that are opened."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from faceposer.geometry.mesh_io import read_mesh
from faceposer.gui.app import App
from faceposer.gui.events import Drop
from faceposer.gui.features.export.feature import ExportFeature
from faceposer.gui.features.import_character.feature import ImportCharacterFeature
from faceposer.gui.testing.scripted_user import Robot
from faceposer.interchange.formats import write
from faceposer.model.performance import Performance
from faceposer.render.options import OutputOptions
from faceposer.training.capture import read_capture
from tests.windows import OpenWindow


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
    robot.frames(2)
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
        robot.frames(2)
        assert exchange_of(app).open
        way()
        assert not exchange_of(app).open
        assert not app.is_modal
    assert not app.session.can_undo
    assert not [*tmp_path.iterdir()]


def test_keys_do_nothing_beneath_the_dialog(robot: Robot) -> None:
    app = robot.app
    app.actions["export-other"].run()
    robot.frames(2)
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
    exchange.form.suffix = ".gif"
    app.actions["export-other"].run()
    robot.frames(2)
    assert "export:seconds" in app.widget_rects
    robot.click_widget("export:animation")
    robot.click_widget("export:obj")
    robot.click_widget("export:accept")
    choose(robot, "yawn")
    robot.frames(8)
    assert app.notice == "Saved yawn"
    meshes = sorted((tmp_path / "yawn").iterdir())
    assert [mesh.name for mesh in meshes] == [f"yawn.000{i}.obj" for i in range(1, 6)]
    np.testing.assert_allclose(read_mesh(meshes[4]).vertices, model.surface(take.coefficients[4]), atol=1e-4)


def test_what_goes_wrong_is_told_and_nothing_is_lost(
    robot: Robot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
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
    assert app.notice.startswith("Opened smile.obj. The pose is that of the mesh.")
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
    assert not app.session.coefficients.any(), "the import dialog is above"


def test_a_pose_of_another_face_is_refused(robot: Robot, tmp_path: Path) -> None:
    app, pose = robot.app, posed(robot)
    (tmp_path / "a.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    exchange_of(app).open_pose(tmp_path / "a.obj")
    count = len(app.session.model.subject.vertices)
    assert f"has 3 vertices, and Low-poly head has {count}" in app.dialogs.waiting[0].text
    np.testing.assert_array_equal(app.session.coefficients, pose)


def test_weights_are_opened_as_a_pose(robot: Robot, tmp_path: Path) -> None:
    app = robot.app
    model = app.session.model
    pose = model.coefficients_of({"jawOpen": 0.5})
    write(tmp_path / "a.csv", model, Performance(np.stack([pose, 0 * pose]), 30.0))
    exchange_of(app).open_pose(tmp_path / "a.csv")
    assert "Frame 1 of 2" in app.notice
    np.testing.assert_allclose(model.instance(app.session.coefficients), model.instance(pose), atol=0.15)
