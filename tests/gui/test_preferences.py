"""Preferences: every choice holds at once, is remembered, and keys never get two actions."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from faceposer.errors import FacePoserError
from faceposer.gui.app import App
from faceposer.gui.features.preferences.feature import PreferencesFeature
from faceposer.gui.features.recovery.feature import RecoveryFeature
from faceposer.gui.settings import LIMITS, Settings, load_settings, save_settings
from faceposer.gui.testing.few_pixels import draw_few_pixels
from faceposer.gui.testing.scripted_user import Robot
from faceposer.render.options import Look
from tests.windows import OpenWindow

pytestmark = [pytest.mark.gl, pytest.mark.usefixtures("small_textures")]


@pytest.fixture
def robot(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Robot]:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    app = App("low", hidden=True, threaded=False, settings=Settings(window_size=(1000, 760), folder=str(tmp_path)))
    yield Robot(draw_few_pixels(app))
    app.close()


def open_dialog(robot: Robot) -> PreferencesFeature:
    robot.key("Ctrl+,")
    robot.frames(6)
    feature = robot.app.features[PreferencesFeature]
    assert feature.open
    return feature


def test_navigation_and_size_hold_at_once(robot: Robot) -> None:
    app = robot.app
    open_dialog(robot)
    robot.click_widget("preferences:navigation:1")
    assert app.viewport.navigation == app.settings.navigation == "maya"
    size = app.window.ui_scale
    robot.click_widget("preferences:scale:3")
    robot.frames(4)
    assert app.window.ui_scale == pytest.approx(1.5 * size)
    assert app.settings.ui_scale == 1.5
    robot.key("Esc")
    robot.frames(2)
    assert not app.is_modal


def test_background_and_light_change_the_view_and_no_file(open_window: OpenWindow) -> None:
    robot = open_window("low", (1000, 760), pictures=True)
    app = robot.app
    robot.frames(2)
    usual = app.screenshot().astype(int)
    left, top, right, bottom = (int(value) for value in app.widget_rects["view"])
    feature = app.features[PreferencesFeature]
    feature.set_look(Look("light"))
    robot.frames(2)
    light = app.screenshot().astype(int)
    corner = (slice(top + 4, top + 30), slice(left + 4, left + 30))
    assert light[corner].mean() > usual[corner].mean() + 60
    feature.set_look(Look("dark", 0.2, 0.2))
    robot.frames(2)
    dark = app.screenshot().astype(int)
    middle = (
        slice((top + bottom) // 2 - 20, (top + bottom) // 2),
        slice((left + right) // 2 - 20, (left + right) // 2),
    )
    assert dark[corner].mean() < usual[corner].mean() - 10
    assert dark[middle].mean() < usual[middle].mean() - 20
    assert (app.settings.backdrop, app.settings.key_light, app.settings.ambient_light) == ("dark", 0.2, 0.2)
    portrait = app.scene.portrait(app.session.coefficients, app.viewport.view.camera((64, 64)), 0).astype(int)
    feature.set_look(Look())
    again = app.scene.portrait(app.session.coefficients, app.viewport.view.camera((64, 64)), 0).astype(int)
    np.testing.assert_array_equal(portrait, again)


def test_light_by_its_sliders(robot: Robot) -> None:
    open_dialog(robot)
    left, top, right, bottom = robot.app.widget_rects["preferences:key"]
    middle = 0.5 * (top + bottom)
    robot.move((left + 0.5 * (right - left), middle))
    robot.press()
    robot.move((right - 4, middle), 3)
    robot.release()
    assert robot.app.scene.look.key == LIMITS["key_light"][1]
    robot.click_widget("preferences:reset-light")
    assert robot.app.scene.look == Look()


def test_a_key_is_changed_by_pressing_it(robot: Robot) -> None:
    app = robot.app
    feature = open_dialog(robot)
    robot.click_widget("preferences:keymap")
    robot.click_widget("preferences:filter")
    robot.type("wireframe")
    robot.frames(4)
    robot.click_widget("keymap:wireframe")
    assert feature.capturing == "wireframe"
    robot.key("Ctrl+Shift+W")
    assert feature.capturing == ""
    assert app.actions["wireframe"].keys == ("Ctrl+Shift+W",)
    assert app.settings.keys == {"wireframe": ["Ctrl+Shift+W"]}
    robot.key("Esc")
    robot.frames(2)
    assert not feature.open
    robot.key("W")
    assert not app.wireframe
    robot.key("Ctrl+Shift+W")
    assert app.wireframe
    assert "Ctrl+Shift+W" in app.actions["wireframe"].tooltip


def test_hints_name_the_keys_of_the_keymap(robot: Robot) -> None:
    actions = robot.app.actions
    hint = "Click: a point   ·   Enter: accept   ·   Ctrl: release   ·   [ ]: brush width   ·   Esc: cancel"
    assert actions.with_current_keys(hint) == hint
    actions.change_keys("apply", ("F9",))
    actions.change_keys("brush-wider", ("F10",))
    actions.change_keys("cancel", ())
    changed = "Click: a point   ·   F9: accept   ·   Ctrl: release   ·   [ F10: brush width"
    assert actions.with_current_keys(hint) == changed


def test_a_key_that_another_action_has_is_refused_with_its_name(robot: Robot) -> None:
    app = robot.app
    feature = open_dialog(robot)
    feature.capture("wireframe")
    robot.key("S")
    assert feature.problem == "S is already the key of Stroke."
    assert app.actions["wireframe"].keys == ("W",)
    assert app.toolbox.chosen.name == "point", "a captured key does nothing else"
    feature.capture("wireframe")
    robot.key("Esc")
    assert feature.open
    assert app.actions["wireframe"].keys == ("W",)
    feature.change_keys("tool-stroke", ())
    feature.capture("wireframe")
    robot.key("S")
    assert app.actions["wireframe"].keys == ("S",)
    feature.reset_keys()
    assert app.settings.keys == {}
    assert app.actions["tool-stroke"].keys == ("S",)
    assert app.actions.for_key("W", frozenset()) is app.actions["wireframe"]


def test_comparing_by_holding_follows_its_key(robot: Robot) -> None:
    app = robot.app
    app.actions.change_keys("compare", ("F5",))
    robot.key_down("F5")
    robot.frames(30)
    assert app.comparing
    robot.key_up("F5")
    assert not app.comparing


@pytest.mark.parametrize("key", ["", "Meta+K", "Ctrl+"])
def test_what_is_no_key_is_refused(robot: Robot, key: str) -> None:
    with pytest.raises(FacePoserError, match="not a key"):
        robot.app.actions.change_keys("wireframe", (key,))


def test_all_of_it_is_kept_for_the_next_start(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    kept = Settings(
        navigation="maya",
        ui_scale=1.25,
        backdrop="light",
        key_light=0.5,
        ambient_light=2.0,
        keys={"wireframe": ["F7"], "no-such-action": ["F8"], "clay": ["S"]},
        autosave_folder=str(tmp_path / "journals"),
    )
    save_settings(kept)
    app = draw_few_pixels(App("low", hidden=True, threaded=False))
    try:
        assert app.window.zoom == 1.25
        assert app.scene.look == Look("light", 0.5, 2.0)
        assert app.viewport.navigation == "maya"
        assert app.actions["wireframe"].keys == ("F7",)
        assert app.actions["clay"].keys == ("T",), "a key that another has is not taken"
        robot = Robot(app)
        x, y = robot.at("8.3")
        robot.drag((x, y), (x + 10, y - 10))
        robot.frames(40)
        journal = app.features[RecoveryFeature]._journal
        assert journal is not None
        assert journal.path is not None
        assert journal.path.parent == tmp_path / "journals"
    finally:
        app.closing = True
        app.close()


@pytest.mark.parametrize(
    "text",
    [
        '{"ui_scale": "large", "key_light": true, "backdrop": "pink", "keys": {"a": "b"}, "window_position": [1]}',
        '{"ui_scale": 1e999, "keys": [1], "characters": ["relative.npz", 3], "window_maximized": 1}',
    ],
)
def test_damaged_settings_are_the_usual_ones(text: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    (tmp_path / "faceposer").mkdir()
    (tmp_path / "faceposer" / "window.json").write_text(text)
    assert load_settings() == Settings(welcome_done=True)
