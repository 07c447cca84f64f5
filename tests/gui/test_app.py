"""The window, driven by pointer and key events alone: a hidden one, on GLFW's null platform."""

import ctypes
import os
from collections.abc import Callable
from pathlib import Path

import moderngl
import numpy as np
import pytest

from faceposer.errors import FacePoserError
from faceposer.geometry.mesh_io import read_mesh
from faceposer.gui import editor
from faceposer.gui.app import App
from faceposer.gui.events import CloseRequest, Drop, FocusLost
from faceposer.gui.settings import Settings
from faceposer.gui.testing.few_pixels import draw_few_pixels
from faceposer.gui.testing.scripted_user import Robot
from faceposer.session.document import Document, write_document
from tests.windows import OpenWindow

pytestmark = pytest.mark.gl

LEFT_CORNER, RIGHT_CORNER = "8.3", "8.4"


@pytest.fixture
def robot(open_window: OpenWindow) -> Robot:
    return open_window("man")


def count(robot: Robot) -> int:
    return len(robot.app.session.document.constraints)


def smile(robot: Robot) -> None:
    x, y = robot.at(LEFT_CORNER)
    robot.drag((x, y), (x + 12, y - 14))


def beside(robot: Robot) -> tuple[float, float]:
    left, top, _, bottom = robot.app.widget_rects["view"]
    return (left + 30.0, 0.5 * (top + bottom))


def answer(robot: Robot, choice: int) -> None:
    robot.frames(2)
    robot.click_widget(f"choice:{choice}")


def moved(robot: Robot) -> float:
    """How far the corner of the mouth is from where it is on the neutral face, in pixels of the view."""
    app = robot.app
    vertex = app.session.model.character.feature_points[LEFT_CORNER]
    rest, now = app.viewport.camera.project(
        np.stack([app.session.model.character.vertices[vertex], app.scene.vertices[vertex]])
    )
    return float(np.hypot(*(now - rest)))


def save_by_dialog(robot: Robot, key: str, path: Path) -> None:
    robot.key(key)
    robot.key("Ctrl+A")
    robot.type(str(path))
    robot.click_widget("files:accept")


def test_starts_neutral_and_draws_nothing_while_nothing_happens(robot: Robot) -> None:
    app = robot.app
    robot.frames(4)
    np.testing.assert_allclose(app.scene.vertices, app.session.model.character.vertices, atol=1e-4)
    drawn = app.frames_drawn
    for _ in range(50):
        app.step()
    assert app.frames_drawn == drawn
    app.window.play_move(*beside(robot))
    app.step()
    assert app.frames_drawn > drawn


def test_the_point_sticks_under_the_pointer_and_the_rest_follows(robot: Robot) -> None:
    app = robot.app
    x, y = robot.at(LEFT_CORNER)
    robot.drag((x, y), (x + 12, y - 14))
    seen = robot.at(LEFT_CORNER)
    assert np.hypot(seen[0] - (x + 12), seen[1] - (y - 14)) < 2.0
    names = app.session.model.character.shape_names
    weights = dict(zip(names, app.session.model.weights_of(app.session.coefficients), strict=True))
    assert weights["mouthSmileLeft"] > 0.2
    assert weights["mouthSmileRight"] > 0.08
    assert "left mouth corner" in app.point_name(0)


def test_nothing_jumps(robot: Robot) -> None:
    app = robot.app
    x, y = robot.at(LEFT_CORNER)
    robot.click((x, y))
    assert count(robot) == 1
    assert moved(robot) < 0.1
    robot.key("Ctrl+Z")
    pixels = []
    robot.move((x, y))
    robot.press()
    for step in range(1, 9):
        robot.move((x + step, y))
        pixels.append(moved(robot))
    robot.release()
    steps = np.diff([0.0, *pixels])
    assert steps.max() < 2.5
    assert steps.min() > -0.5
    assert pixels[-1] > 5.0
    assert not app.dialogs.open


@pytest.mark.slow
def test_undo_redo_escape_and_removal(robot: Robot) -> None:
    app = robot.app
    smile(robot)
    posed = app.session.coefficients.copy()
    x, y = robot.at(RIGHT_CORNER)
    robot.drag((x, y), (x - 4, y + 8))
    assert count(robot) == 2
    robot.key("Ctrl+Z")
    assert count(robot) == 1
    np.testing.assert_array_equal(app.session.coefficients, posed)
    robot.key("Ctrl+Z")
    assert count(robot) == 0
    assert moved(robot) == 0.0
    robot.key("Ctrl+Y")
    robot.key("Ctrl+Shift+Z")
    assert count(robot) == 2

    pin = robot.at(LEFT_CORNER)
    before = app.session.document
    robot.move(pin)
    robot.press()
    robot.move((pin[0] + 20, pin[1] + 20), 4)
    robot.key("Esc")
    robot.release()
    assert app.session.document == before

    robot.click(robot.at(LEFT_CORNER), "right")
    assert count(robot) == 1
    robot.click(robot.at(RIGHT_CORNER))
    assert app.toolbox.selection == {0}
    robot.key("Delete")
    assert count(robot) == 0
    assert moved(robot) == 0.0


def test_compare_by_tap_and_by_holding(robot: Robot) -> None:
    app = robot.app
    smile(robot)
    robot.key("C")
    assert app.comparing
    assert moved(robot) == 0.0
    robot.key("C")
    assert not app.comparing
    assert moved(robot) > 5.0
    robot.key_down("C")
    robot.frames(30)
    assert app.comparing
    robot.key_up("C")
    assert not app.comparing
    robot.key("C")
    robot.click(robot.at(LEFT_CORNER))
    assert not app.comparing


def test_on_apply_waits(robot: Robot) -> None:
    app = robot.app
    robot.click_widget("mode:1")
    smile(robot)
    assert app.session.pending
    assert moved(robot) == 0.0
    assert "apply" in app.hint().lower()
    robot.key("Enter")
    assert not app.session.pending
    assert moved(robot) > 5.0


def test_prior_weight_by_its_slider(robot: Robot) -> None:
    app = robot.app
    x, y = robot.at(LEFT_CORNER)
    robot.drag((x, y), (x + 14, y - 12))
    residual = app.session.residuals_px[0]
    left, top, right, bottom = app.widget_rects["weight"]
    middle = 0.5 * (top + bottom)
    robot.move((right - 12, middle))
    robot.drag((right - 12, middle), (left - 5, middle), steps=6)
    assert app.session.document.prior_weight == 0.0
    assert app.session.residuals_px[0] < 0.5 * residual
    robot.key("Ctrl+Z")
    assert app.session.document.prior_weight == 1.0
    assert app.session.residuals_px[0] == pytest.approx(residual, abs=1e-6)


def test_views_orbit_and_zoom_do_not_edit(robot: Robot) -> None:
    app = robot.app
    view = app.viewport.view
    begin = beside(robot)
    robot.drag(begin, (begin[0] + 60, begin[1] + 10))
    assert app.viewport.view != view
    robot.move(robot.at(LEFT_CORNER))
    distance = app.viewport.view.distance
    robot.wheel(2.0)
    assert app.viewport.view.distance < distance
    robot.key("Ctrl+3")
    right = app.viewport.camera.center
    robot.key("3")
    left = app.viewport.camera.center
    assert left[0] * right[0] < 0
    assert abs(left[0]) > abs(left[2])
    robot.drag(begin, (begin[0] + 10, begin[1] + 10), button="middle", modifiers=frozenset({"shift"}))
    robot.key("F")
    assert not app.session.can_undo


def test_keys_sheet_takes_the_keys_while_it_is_open(robot: Robot) -> None:
    app = robot.app
    smile(robot)
    robot.key("F1")
    assert app.dialogs.open
    robot.key("R")
    assert count(robot) == 1
    robot.key("Esc")
    assert not app.dialogs.open
    robot.key("R")
    assert count(robot) == 0


def test_the_saved_obj_is_the_solved_face(robot: Robot, tmp_path: Path) -> None:
    app = robot.app
    smile(robot)
    save_by_dialog(robot, "Ctrl+E", tmp_path / "posed")
    mesh = read_mesh(tmp_path / "posed.obj")
    character = app.session.model.character
    solved = app.session.vertices
    height = float(np.ptp(character.vertices[:, 1]))
    assert np.abs(mesh.vertices - solved).max() < 1e-5 * height
    assert np.abs(solved - character.vertices).max() > 0.3
    smile(robot)
    robot.key("Ctrl+E")
    assert not app.file_dialogs.open
    again = read_mesh(tmp_path / "posed.obj")
    assert np.abs(again.vertices - mesh.vertices).max() > 1e-3


def test_session_saved_and_opened_again(robot: Robot, tmp_path: Path) -> None:
    app = robot.app
    smile(robot)
    begin = beside(robot)
    robot.drag(begin, (begin[0] + 40, begin[1]))
    view, pose = app.viewport.view, app.session.coefficients.copy()
    path = tmp_path / "smile.json"
    assert app.session.dirty
    assert app.window.title.startswith("Man (not saved)*")
    save_by_dialog(robot, "Ctrl+S", path)
    assert not app.session.dirty
    assert app.window.title == "smile.json - Face Poser"
    robot.key("R")
    app.window.play_event(Drop((str(path),)))
    robot.frames(1)
    assert app.dialogs.waiting[0].title == "Revert to the saved smile.json?"
    answer(robot, 0)
    np.testing.assert_allclose(app.session.coefficients, pose, atol=1e-9)
    assert app.viewport.view.yaw == pytest.approx(view.yaw, abs=1e-6)


def test_unsaved_changes_are_asked_about(robot: Robot, tmp_path: Path) -> None:
    app = robot.app
    smile(robot)
    robot.click_widget("character")
    robot.click_widget("character:woman")
    answer(robot, 2)
    assert app.session.document.character == "man"
    assert count(robot) == 1
    app.window.play_event(CloseRequest())
    robot.frames(2)
    assert app.dialogs.open
    assert not app.closing
    answer(robot, 0)
    robot.key("Ctrl+A")
    robot.type(str(tmp_path / "kept.json"))
    robot.click_widget("files:accept")
    assert (tmp_path / "kept.json").is_file()
    assert app.closing


def test_another_character_opens(robot: Robot) -> None:
    app = robot.app
    robot.click_widget("character")
    robot.click_widget("character:woman")
    assert app.session.model.character.name == "woman"
    smile(robot)
    assert moved(robot) > 5.0


def test_a_file_that_cannot_be_opened_is_told_and_changes_nothing(robot: Robot, tmp_path: Path) -> None:
    app = robot.app
    smile(robot)
    before = app.session
    bad = tmp_path / "bad.json"
    bad.write_text('{"format": "faceposer.session", "version": 1, "subject": "man", "mood": "good"}')
    app.window.play_event(Drop((str(bad),)))
    answer(robot, 1)
    assert app.session is before
    assert "mood" in app.dialogs.waiting[0].text
    answer(robot, 0)
    assert not app.dialogs.open


def test_frames_that_nobody_sees_do_not_queue_up_in_the_driver(robot: Robot, monkeypatch: pytest.MonkeyPatch) -> None:
    finished = []
    monkeypatch.setattr(moderngl.Context, "finish", lambda _context: finished.append(robot.app.frames_drawn))
    drawn = robot.app.frames_drawn
    robot.frames(5)
    assert finished == list(range(drawn, drawn + 5))


def test_resizing_minimising_and_a_dense_display(open_window: OpenWindow, monkeypatch: pytest.MonkeyPatch) -> None:
    robot = open_window("man", pictures=True)
    app = robot.app
    smile(robot)
    for size in ((1300, 500), (481, 361), (1500, 1000)):
        app.window.set_size(size)
        robot.frames(2)
        assert app.screenshot().shape == (size[1], size[0], 3)
        corner = robot.at(LEFT_CORNER)
        assert app.viewport.contains(corner)
    pictures = []
    monkeypatch.setattr(type(app.window), "pixels", property(lambda window: (3000, 2000)))
    original = app.scene.draw
    monkeypatch.setattr(
        app.scene, "draw", lambda camera, *rest: (pictures.append(camera.size), original(camera, *rest))[1]
    )
    robot.frames(1)
    assert pictures[-1] == (2 * app.viewport.size[0], 2 * app.viewport.size[1])
    monkeypatch.undo()
    drawn = app.frames_drawn
    monkeypatch.setattr(type(app.window), "drawable", property(lambda window: False))
    robot.frames(3)
    assert app.frames_drawn == drawn
    monkeypatch.undo()
    robot.frames(1)
    assert app.frames_drawn > drawn


def test_losing_the_focus_ends_a_drag_where_it_is(robot: Robot) -> None:
    app = robot.app
    x, y = robot.at(LEFT_CORNER)
    robot.move((x, y))
    robot.press()
    robot.move((x + 10, y - 10), 4)
    app.window.play_event(FocusLost())
    robot.frames(2)
    assert not app.toolbox.active
    assert count(robot) == 1
    robot.move((x + 80, y + 80), 2)
    assert moved(robot) < 25.0


def test_an_error_inside_a_frame_is_told_and_the_window_goes_on(
    robot: Robot, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    app = robot.app
    smile(robot)
    monkeypatch.setattr(app.constraints_panel, "draw", lambda app: 1 / 0)
    robot.frames(2)
    monkeypatch.undo()
    assert "ZeroDivisionError" in app.dialogs.waiting[0].text
    assert "ZeroDivisionError" in capsys.readouterr().err
    answer(robot, 0)
    smile(robot)
    assert count(robot) >= 1


def test_menus_do_what_they_say(robot: Robot) -> None:
    app = robot.app
    robot.click_widget("menu:View")
    robot.click_widget("menu:wireframe")
    assert app.wireframe
    robot.click_widget("menu:View")
    robot.click_widget("menu:maya")
    assert app.viewport.navigation == "maya"
    smile(robot)
    robot.click_widget("menu:Edit")
    robot.click_widget("menu:undo")
    assert count(robot) == 0


def test_points_panel_switches_and_removes(robot: Robot) -> None:
    app = robot.app
    smile(robot)
    robot.click_widget("point:0:on")
    assert not app.session.document.constraints[0].enabled
    assert moved(robot) < 0.1
    robot.click_widget("point:0:on")
    assert moved(robot) > 5.0
    robot.click_widget("point:0:delete")
    assert count(robot) == 0


@pytest.mark.gl
def test_a_session_opens_from_the_command_line(tmp_path: Path) -> None:
    path = tmp_path / "one.json"
    write_document(path, Document("woman", prior_weight=2.0))
    app = App(str(path), hidden=True, threaded=False, settings=Settings(window_size=(640, 480)))
    try:
        assert app.session.path == path
        assert app.session.document.prior_weight == 2.0
        Robot(app).frames(1)
    finally:
        app.close()


@pytest.mark.gl
def test_solving_beside_the_frames(tmp_path: Path) -> None:
    app = App("man", hidden=True, threaded=True, settings=Settings(window_size=(700, 560)))
    try:
        robot = Robot(draw_few_pixels(app))
        smile(robot)
        app.session.wait()
        robot.frames(1)
        assert moved(robot) > 5.0
        assert not app.session.solving
    finally:
        app.close()


@pytest.mark.gl
def test_closing_releases_everything_whatever_fails(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    app = App("low", hidden=True, threaded=False, settings=Settings(window_size=(640, 480)))
    app.remembers = True
    closed: list[str] = []

    def failing(name: str) -> Callable[[], None]:
        def fail() -> None:
            closed.append(name)
            raise ZeroDivisionError(name)

        return fail

    def unwritable(_: Settings) -> None:
        raise FacePoserError("The settings cannot be written: No space left on device.")

    monkeypatch.setattr(editor, "save_settings", unwritable)
    for part in ("features", "files", "session", "scene"):
        monkeypatch.setattr(getattr(app, part), "close" if part != "scene" else "release", failing(part))
    with pytest.raises(ZeroDivisionError):
        app.close()
    assert closed == ["features", "files", "session", "scene"]
    assert app._window is None
    assert capsys.readouterr().err.count("The settings cannot be written") == 1
    # The window and Dear ImGui are released, so that another can open, also after one that could not be set up.
    monkeypatch.setattr(editor, "SessionFiles", failing("files of a new window"))
    with pytest.raises(TypeError):
        App("low", hidden=True, threaded=False, settings=Settings(window_size=(640, 480)))
    monkeypatch.undo()
    again = App("low", hidden=True, threaded=False, settings=Settings(window_size=(640, 480)))
    again.close()


@pytest.mark.gl
def test_dropped_names_that_are_not_utf8_arrive(open_window: OpenWindow, tmp_path: Path) -> None:
    app = open_window().app
    drop = next(callback for callback in app.window._callbacks if hasattr(callback, "argtypes"))
    names = (ctypes.c_char_p * 2)(os.fsencode(tmp_path) + b"/caf\xe9.json", "ü.json".encode())
    drop(None, 2, names)
    assert Drop((f"{tmp_path}/caf\udce9.json", "ü.json")) in app.window.take_events()


@pytest.mark.gl
def test_long_notices_are_wrapped_and_stay_longer(open_window: OpenWindow, monkeypatch: pytest.MonkeyPatch) -> None:
    app = open_window("low", (700, 560), pictures=True).app
    app.step()
    before = app.screenshot().astype(int)
    monkeypatch.setattr("faceposer.gui.editor.time.perf_counter", lambda: 100.0)
    app.notify("It does not state times; 30 frames per second were assumed. " * 4)
    assert app._notice_until > 110.0
    app.step()
    rows = np.flatnonzero(np.abs(app.screenshot().astype(int) - before).max(axis=(1, 2)) > 40)
    line = 20
    assert np.ptp(rows) > 3 * line
