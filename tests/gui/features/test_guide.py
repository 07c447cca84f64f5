"""The guided pose: its steps are done by what the user really does, and it keeps out of the way."""

import math
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from imgui_bundle import imgui

# The bundle tells glfw which GLFW library to load, so that both share one; it must come first.
# isort: split
import glfw

from faceposer.gui.app import App
from faceposer.gui.cursors import shape_of
from faceposer.gui.features.guide.feature import GuideFeature
from faceposer.gui.features.guide.steps import STEPS, Guide, Observation
from faceposer.gui.settings import Settings, load_settings, save_settings
from faceposer.gui.testing.few_pixels import draw_few_pixels
from faceposer.gui.testing.scripted_user import Robot

pytestmark = [pytest.mark.gl, pytest.mark.usefixtures("small_textures")]

SESSION = object()
REST = Observation(SESSION, {"8.3": -0.23, "8.4": -0.23, "4.3": 0.19}, frozenset(), (0.0, 0.0), False, 0)


def risen(seen: Observation, place: str, by: float, held: bool = True) -> Observation:
    heights = {**seen.heights, place: seen.heights[place] + by}
    return replace(seen, heights=heights, held=seen.held | {place} if held else seen.held)


def begun() -> Guide:
    guide = Guide()
    assert not guide.update(REST)
    return guide


def test_steps_are_done_in_order() -> None:
    guide = begun()
    seen = REST
    for name, change in (
        ("smile", lambda seen: risen(seen, "8.4", 0.02)),
        ("brow", lambda seen: risen(seen, "4.3", 0.02)),
        ("orbit", lambda seen: replace(seen, direction=(0.4, 0.1))),
        ("undo", lambda seen: replace(seen, can_redo=True)),
        ("save", lambda seen: replace(seen, meshes_saved=1)),
    ):
        assert guide.current is not None
        assert guide.current.name == name
        assert not guide.update(seen)
        seen = change(seen)
        assert guide.update(seen)
        assert name in guide.done
    assert guide.current is None


def test_a_step_out_of_order_counts() -> None:
    guide = begun()
    guide.update(replace(REST, meshes_saved=1))
    assert guide.done == {"save"}
    assert guide.current is STEPS[0]


def test_what_is_no_pull_does_not_count() -> None:
    guide = begun()
    guide.update(risen(REST, "8.3", 0.02, held=False))
    guide.update(replace(REST, held=frozenset({"8.3", "4.3"})))
    guide.update(risen(REST, "8.3", -0.03))
    assert not guide.done
    # From lower down the way back up is a pull upwards.
    guide.update(risen(REST, "8.3", -0.01))
    assert guide.done == {"smile"}


def test_keys_that_turn_the_view_are_no_orbit() -> None:
    guide = begun()
    side = (math.radians(90.0), 0.0)
    for direction in (side, (0.0, 0.0), (math.radians(35.0), math.radians(4.0)), side):
        assert not guide.update(replace(REST, direction=direction))
    assert not guide.update(replace(REST, direction=(side[0] + math.radians(3.0), 0.0)))
    assert guide.update(replace(REST, direction=(side[0] + math.radians(8.0), 0.0)))


def test_what_another_session_brings_along_does_not_count() -> None:
    guide = begun()
    other = replace(risen(REST, "8.3", 0.05), session=object(), direction=(0.5, 0.2), can_redo=True, meshes_saved=0)
    assert not guide.update(other)
    assert not guide.update(other)
    assert guide.update(risen(other, "8.3", 0.02))
    assert guide.done == {"smile"}


def opened(folder: Path, done: bool = False, size: tuple[int, int] = (1360, 860)) -> Robot:
    settings = Settings(window_size=size, folder=str(folder), welcome_done=done)
    return Robot(draw_few_pixels(App("man", hidden=True, threaded=False, settings=settings)))


@pytest.fixture
def robot(tmp_path: Path) -> Iterator[Robot]:
    robot = opened(tmp_path)
    yield robot
    robot.app.close()


def current(robot: Robot) -> str:
    step = robot.app.features[GuideFeature].step
    return step.name if step is not None else ""


def pull(robot: Robot, place: str, across: float, down: float) -> None:
    x, y = robot.at(place)
    robot.drag((x, y), (x + across, y + down))


def orbit(robot: Robot) -> None:
    _, top, right, bottom = robot.app.widget_rects["view"]
    begin = (right - 30.0, 0.5 * (top + bottom))
    robot.drag(begin, (begin[0] - 90.0, begin[1]))


@pytest.mark.slow
def test_a_user_goes_through_all_steps(robot: Robot, tmp_path: Path) -> None:
    app = robot.app
    assert app.features[GuideFeature].shown
    assert current(robot) == "smile"
    pull(robot, "8.3", 2.0, 16.0)
    assert current(robot) == "smile"
    robot.key("Ctrl+Z")
    assert "undo" in app.features[GuideFeature]._guide.done  # type: ignore[union-attr]
    pull(robot, "8.3", 12.0, -14.0)
    assert current(robot) == "brow"
    pull(robot, "4.3", 0.0, -14.0)
    assert current(robot) == "orbit"
    robot.key("3")
    robot.key("1")
    assert current(robot) == "orbit"
    orbit(robot)
    assert current(robot) == "save"
    robot.key("Ctrl+E")
    assert current(robot) == "save"
    robot.key("Ctrl+A")
    robot.type("smile.obj")
    robot.click_widget("files:accept")
    robot.frames(2)
    assert (tmp_path / "smile.obj").is_file()
    assert app.features[GuideFeature].shown
    assert current(robot) == ""
    # Turned, the head may lie where the card is; from the front it does not.
    robot.key("1")
    robot.click_widget("guide:skip")
    assert not app.features[GuideFeature].shown


def test_a_drag_that_is_taken_back_does_not_count(robot: Robot) -> None:
    x, y = robot.at("8.3")
    robot.move((x, y))
    robot.press()
    robot.move((x + 12.0, y - 14.0), 5)
    assert current(robot) == "smile"
    robot.key("Esc")
    robot.release()
    assert current(robot) == "smile"
    assert robot.app.features[GuideFeature].shown


def test_it_can_be_put_away_and_brought_back(robot: Robot) -> None:
    app = robot.app
    for widget in ("guide:close", "guide:skip"):
        assert app.features[GuideFeature].shown
        robot.click_widget(widget)
        assert not app.features[GuideFeature].shown
        assert not app.session.can_undo
        robot.click_widget("menu:Help")
        robot.click_widget("menu:guide")
    pull(robot, "8.3", 12.0, -14.0)
    assert app.toolbox.selection
    robot.key("Esc")
    assert app.features[GuideFeature].shown
    robot.key("Esc")
    assert not app.features[GuideFeature].shown


def test_the_card_takes_presses_and_covers_no_face(robot: Robot) -> None:
    app = robot.app
    view = app.viewport.view
    left, top, _, _ = app.widget_rects["view"]
    robot.drag((left + 60.0, top + 60.0), (left + 160.0, top + 90.0))
    assert app.viewport.view == view
    for place in app.session.model.character.feature_points:
        assert not app.features[GuideFeature].contains(robot.at(place))
    robot.wheel(0.0)
    robot.move(robot.at("9.3"))
    for _ in range(6):
        robot.wheel(1.0)
    assert "guide:skip" not in app.widget_rects
    assert "guide:close" in app.widget_rects


def test_the_ring_goes_while_the_user_presses(robot: Robot, monkeypatch: pytest.MonkeyPatch) -> None:
    rings = []
    guide = type(robot.app.features[GuideFeature])
    original = guide._draw_ring
    monkeypatch.setattr(guide, "_draw_ring", lambda card, head: (rings.append(1), original(card, head)))
    robot.frames(2)
    assert rings
    robot.move(robot.at("8.3"))
    robot.press()
    rings.clear()
    robot.frames(2)
    robot.move((robot.position[0] + 1.0, robot.position[1]), 2)
    assert not rings
    robot.release()
    assert rings


@pytest.mark.gl
@pytest.mark.parametrize("size", [(480, 360), (640, 480)])
def test_a_small_window_shows_the_step_as_a_line(tmp_path: Path, size: tuple[int, int]) -> None:
    robot = opened(tmp_path, size=size)
    app = robot.app
    try:
        assert "guide:skip" not in app.widget_rects
        left, top, right, bottom = app.widget_rects["guide:close"]
        assert app.viewport.contains((left, top))
        assert app.viewport.contains((right, bottom))
        assert not app.features[GuideFeature].contains(robot.at("8.3"))
        robot.click_widget("guide:close")
        assert not app.features[GuideFeature].shown
    finally:
        app.close()


@pytest.mark.gl
def test_only_the_first_start_shows_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    monkeypatch.setattr("faceposer.gui.settings.state_folder", lambda: tmp_path / "faceposer")
    first, written = load_settings(), []
    assert not first.welcome_done
    monkeypatch.setattr(App, "save_settings", lambda app: written.append(app.settings.welcome_done))
    assert Settings().welcome_done
    app = draw_few_pixels(App("man", hidden=True, threaded=False, settings=first))
    try:
        Robot(app)
        assert app.features[GuideFeature].shown
        # At once, not only when the window closes.
        assert written == [True]
    finally:
        app.close()
    assert first.welcome_done
    save_settings(first)
    assert load_settings().welcome_done


@pytest.mark.gl
def test_who_has_seen_it_is_left_alone(tmp_path: Path) -> None:
    robot = opened(tmp_path, done=True)
    try:
        assert not robot.app.features[GuideFeature].shown
        assert "guide:skip" not in robot.app.widget_rects
        robot.key("Esc")
        robot.app.actions["guide"].run()
        robot.frames(2)
        assert "guide:skip" in robot.app.widget_rects
    finally:
        robot.app.close()


def test_the_pointer_tells_the_tool(robot: Robot) -> None:
    app = robot.app
    shown = app.gui.cursors
    place = robot.at("8.3")
    robot.move(place)
    assert shown.shown == "press"
    robot.press()
    assert shown.shown == "grab"
    robot.release()
    assert shown.shown == "grab"
    _, top, right, bottom = app.widget_rects["view"]
    beside = (right - 30.0, 0.5 * (top + bottom))
    robot.move(beside)
    assert shown.shown == "arrow"
    robot.press()
    robot.move((beside[0] - 20.0, beside[1]), 2)
    assert shown.shown == "orbit"
    robot.release()
    robot.move((right + 40.0, top + 5.0))
    assert shown.shown == "arrow"
    robot.key("Ctrl+P")
    robot.move(app.widget_rects.center("palette:query"))
    robot.frames(1)
    assert shown.shown == "text_input"


def test_names_have_shapes() -> None:
    assert shape_of("press") == glfw.CROSSHAIR_CURSOR
    assert shape_of("orbit") == glfw.RESIZE_ALL_CURSOR
    assert shape_of("a tool of tomorrow") == glfw.ARROW_CURSOR
    for cursor in imgui.MouseCursor_:
        if cursor.name in ("hand", "resize_ew", "text_input"):
            assert shape_of(cursor.name) != glfw.ARROW_CURSOR


def test_widgets_of_the_panel_have_tooltips(robot: Robot, monkeypatch: pytest.MonkeyPatch) -> None:
    app = robot.app
    pull(robot, "8.3", 12.0, -14.0)
    style = imgui.get_style()
    style.hover_stationary_delay = style.hover_delay_normal = style.hover_delay_short = 0.0
    told: list[int] = []
    begin = imgui.begin_tooltip
    monkeypatch.setattr(imgui, "begin_tooltip", lambda: (told.append(1), begin())[1])
    left = app.widget_rects["view"][2]
    seen: set[str] = set()
    for tab in ("Pose", "View"):
        robot.click_widget(f"tab:{tab}")
        widgets = [name for name in list_of_marks(app) if app.widget_rects[name][0] >= left and name != "point:0"]
        seen |= set(widgets)
        for name in widgets:
            robot.move(app.widget_rects.center(name))
            told.clear()
            robot.frames(3)
            assert told, name
    assert {"character", "mode:0", "weight", "reset", "shading:1", "wireframe", "export", "detail:weight"} <= seen


def list_of_marks(app: App) -> list[str]:
    return [name for name in app.widget_rects._rectangles if not name.startswith("menu:")]
