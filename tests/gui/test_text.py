"""Text that has to fit: pure functions, and the list of constraints and the dialogs that use them."""

from collections.abc import Iterator
from pathlib import Path

import pytest
from imgui_bundle import imgui

from faceposer.gui.app import App
from faceposer.gui.commands import about_text
from faceposer.gui.features.export.feature import ExportFeature
from faceposer.gui.features.import_character.feature import ImportCharacterFeature
from faceposer.gui.settings import Settings
from faceposer.gui.testing.few_pixels import draw_few_pixels
from faceposer.gui.testing.scripted_user import Robot
from faceposer.gui.widgets.text import shortened, wrapped
from faceposer.interchange.formats import FORMATS

pytestmark = [pytest.mark.gl, pytest.mark.usefixtures("small_textures")]


def letters(text: str) -> float:
    return float(len(text))


@pytest.fixture
def robot(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Robot]:
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path / "data"))
    app = App("man", hidden=True, threaded=False, settings=Settings(window_size=(1100, 900), folder=str(tmp_path)))
    draw_few_pixels(app)
    yield Robot(app)
    app.close()


@pytest.mark.parametrize("width", [5, 9, 12, 26, 27, 40])
def test_what_is_too_long_loses_its_middle(width: int) -> None:
    text = "inner end of the left brow"
    found = shortened(text, width, letters)
    assert len(found) <= width
    if len(text) <= width:
        assert found == text
    elif width >= 9:
        head, tail = found.split("...")
        assert text.startswith(head)
        assert text.endswith(tail)
        assert head
        assert tail


def test_lines_hold_all_words_where_there_is_room() -> None:
    text = "inner end of the left brow"
    assert wrapped(text, 30, measure=letters) == [text]
    assert wrapped(text, 14, measure=letters) == ["inner end of", "the left brow"]
    lines = wrapped(f"{text} to the middle of the outer upper lip", 14, measure=letters)
    assert len(lines) == 2
    assert "..." in lines[1]
    assert all(len(line) <= 14 for line in lines)
    assert wrapped("", 14, measure=letters) == [""]


def test_every_name_of_a_place_is_whole_in_the_list(robot: Robot, monkeypatch: pytest.MonkeyPatch) -> None:
    app = robot.app
    x, y = robot.at("8.3")
    robot.drag((x, y), (x + 12, y - 14))
    panel = app.constraints_panel
    drawn: list[list[str]] = []
    rows = panel._rows
    monkeypatch.setattr(panel, "_rows", lambda *given: (found := rows(*given), drawn.append(found[0].lines))[0])
    for title in app.session.model.character.feature_titles.values():
        monkeypatch.setattr(app, "point_name", lambda index, title=title: title)
        robot.frames(1)
        assert " ".join(drawn[-1]) == title


@pytest.mark.parametrize("scale", [1.0, 1.5])
def test_tooltips_cover_nothing_of_the_window_that_they_explain(
    scale: float, robot: Robot, monkeypatch: pytest.MonkeyPatch
) -> None:
    app = robot.app
    app.set_ui_scale(scale)
    x, y = robot.at("8.3")
    robot.drag((x, y), (x + 12, y - 14))
    style = imgui.get_style()
    style.hover_stationary_delay = style.hover_delay_normal = 0.0
    placed: list[tuple[float, float]] = []
    set_pos, begin = imgui.set_next_window_pos, imgui.begin_tooltip
    last: list[imgui.ImVec2] = []
    monkeypatch.setattr(imgui, "set_next_window_pos", lambda pos, *rest: (last.append(pos), set_pos(pos, *rest))[1])
    monkeypatch.setattr(imgui, "begin_tooltip", lambda: (placed.append((last[-1][0], last[-1][1])), begin())[1])
    panel = app.widget_rects["character"][0]
    view = app.widget_rects["view"]
    for name in ("tab:Pose", "tab:View", "character", "spread", "reset", "point:0:lock", "export", "save"):
        robot.move(app.widget_rects.center(name))
        placed.clear()
        robot.frames(3)
        assert placed, name
        # Over the view, at the left of the panel.
        assert placed[-1][0] < panel - 20.0, name
    robot.move(app.widget_rects.center("tool-stroke"))
    placed.clear()
    robot.frames(3)
    assert placed[-1][0] >= view[0]


def test_tooltips_of_tools_carry_name_and_key(robot: Robot) -> None:
    actions = robot.app.actions
    for tool in robot.app.toolbox.tools:
        action = actions[f"tool-{tool}"]
        first, second = action.tooltip.split("\n")
        assert first == f"{action.label}  ({action.shortcut})"
        assert second == action.help


def test_the_empty_list_speaks_of_the_tool(robot: Robot, monkeypatch: pytest.MonkeyPatch) -> None:
    app = robot.app
    said: list[str] = []
    wrapped = imgui.text_wrapped
    monkeypatch.setattr(imgui, "text_wrapped", lambda text: (said.append(text), wrapped(text))[1])
    texts = {name: tool.empty_text for name, tool in app.toolbox.tools.items()}
    assert all(texts.values())
    assert len({*texts.values(), app.toolbox.photo_tool.empty_text}) == len(texts) + 1
    for tool in app.toolbox.tools:
        app.toolbox.choose(tool)
        said.clear()
        robot.frames(1)
        assert texts[tool] in said


def test_about_has_version_and_licence() -> None:
    text = about_text("Man", "Made by many.")
    assert "Version " in text
    assert "Licence: MIT" in text
    assert "Man: Made by many." in text


def test_the_export_dialog_stays_where_it_is_whatever_format(robot: Robot) -> None:
    app = robot.app
    app.actions["export-other"].run()
    robot.frames(6)
    places = set()
    for suffix in FORMATS:
        app.features[ExportFeature].form.suffix = suffix
        robot.frames(4)
        places.add((app.widget_rects["export:accept"], app.widget_rects["export:obj"]))
    assert len(places) == 1


def test_the_import_dialog_stays_where_it_is_whatever_kind(robot: Robot) -> None:
    app = robot.app
    app.features[ImportCharacterFeature].show()
    robot.frames(6)
    places = set()
    for kind in range(3):
        robot.click_widget(f"import:kind:{kind}")
        robot.frames(6)
        places.add((app.widget_rects["import:start"], app.widget_rects["import:kind:0"]))
    assert len(places) == 1


def test_a_constraint_is_hidden_in_the_view_and_counts_as_before(robot: Robot) -> None:
    app = robot.app
    for name, (dx, dy) in (("8.3", (12, -14)), ("4.1", (0, -10))):
        x, y = robot.at(name)
        robot.drag((x, y), (x + dx, y + dy))
    document, hidden = app.session.document, app.drawn_constraints.hidden
    robot.click_widget("point:0:visible")
    assert app.session.document is document
    assert hidden.indices(document.constraints) == {0}
    x, y = robot.at("8.4")
    robot.drag((x, y), (x - 4, y + 4))
    assert hidden.indices(app.session.document.constraints) == {0}
    robot.click_widget("point:1:delete")
    assert hidden.indices(app.session.document.constraints) == {0}
    robot.click_widget("point:0:on")
    assert not app.session.document.constraints[0].enabled
    assert app.session.undo_label == "Disable a constraint"
    assert hidden.indices(app.session.document.constraints) == {0}
    robot.click_widget("point:0:delete")
    assert hidden.indices(app.session.document.constraints) == frozenset()


def test_the_mark_of_a_hidden_constraint_is_not_drawn(robot: Robot, monkeypatch: pytest.MonkeyPatch) -> None:
    app = robot.app
    x, y = robot.at("8.3")
    robot.drag((x, y), (x + 12, y - 14))
    robot.move((x - 100, y + 200))
    drawn: list[int] = []
    from faceposer.gui import layout

    overlay = layout.draw_overlay
    monkeypatch.setattr(layout, "draw_overlay", lambda *given: (drawn.append(len(given[3])), overlay(*given))[1])
    robot.frames(1)
    assert drawn[-1] == 1
    app.drawn_constraints.hidden.toggle(0, app.session.document.constraints)
    robot.frames(1)
    assert drawn[-1] == 0
    robot.move(app.widget_rects.center("point:0"))
    robot.frames(2)
    assert drawn[-1] == 1, "pointed at in the list, it is shown"


def test_the_window_reopens_where_and_as_large_as_it_was(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    app = draw_few_pixels(App("low", hidden=True, threaded=False))
    robot = Robot(app)
    import glfw

    app.window.set_size((900, 700))
    glfw.set_window_pos(app.window._handle, 37, 53)
    robot.frames(2)
    glfw.maximize_window(app.window._handle)
    robot.frames(2)
    maximized = app.window.maximized
    app.close()
    app = draw_few_pixels(App("low", hidden=True, threaded=False))
    try:
        assert app.settings.window_size == (900, 700)
        assert app.settings.window_position == (37, 53)
        assert app.window.maximized == maximized
        glfw.restore_window(app.window._handle)
        Robot(app).frames(2)
        assert app.window.size == (900, 700)
        assert glfw.get_window_pos(app.window._handle) == (37, 53)
    finally:
        app.close()


def test_a_place_that_no_monitor_shows_is_not_taken(tmp_path: Path) -> None:
    settings = Settings(window_size=(640, 480), window_position=(-40_000, 90_000))
    app = App("low", hidden=True, threaded=False, settings=settings)
    try:
        assert app.window.normal_position != (-40_000, 90_000)
    finally:
        app.close()


def test_a_slider_ends_where_the_pointer_did_however_few_frames_there_were(robot: Robot) -> None:
    app = robot.app
    left, top, right, bottom = app.widget_rects["spread"]
    middle = 0.5 * (top + bottom)
    robot.move((left + 0.5 * (right - left), middle))
    robot.press()
    for share in (0.6, 0.9):
        app.window.play_move(left + share * (right - left), middle)
    app.window.play_button("left", False)
    robot.frames(4)
    assert app.session.document.spread == pytest.approx(0.92, abs=0.04)
    assert not app.session.editing
    robot.key("Ctrl+Z")
    assert app.session.document.spread == pytest.approx(0.5)
