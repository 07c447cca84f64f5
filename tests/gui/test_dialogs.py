"""Dialogs: buttons are always in reach, nothing jumps, and Esc does one thing at a time."""

from pathlib import Path
from typing import Any

import pytest
from imgui_bundle import imgui

from faceposer.gui.features.import_character.feature import ImportCharacterFeature
from faceposer.gui.features.scan import marked_scan
from faceposer.gui.features.scan.feature import ScanFeature
from faceposer.gui.testing.scripted_user import Robot
from faceposer.gui.widgets.dialogs import Choice, Question
from faceposer.progress import Progress
from tests.windows import OpenWindow

SIZES = [((1360, 860), 1.0), ((1000, 700), 1.5), ((900, 600), 2.0), ((480, 360), 2.0)]
DIALOGS = {
    "import": ("import:start", "import:cancel"),
    "transfer": ("transfer:open", "transfer:cancel"),
    "export-other": ("export:accept", "export:cancel"),
    "preferences": ("preferences:close",),
    "scan": ("scan:find", "scan:cancel"),
    "pose-save": ("pose-name:accept", "pose-name:cancel"),
}


def window(name: str) -> Any:
    return next(w for w in imgui.get_current_context().windows if w.name == name and w.active)


def assert_visible(robot: Robot, names: tuple[str, ...]) -> None:
    width, height = robot.app.window.size
    rects = robot.app.widget_rects
    for name in names:
        left, top, right, bottom = rects[name]
        assert left >= 0.0, name
        assert top >= 0.0, name
        assert right <= width, name
        assert bottom <= height, name
        assert rects._visible[name][1] == rects[name], name


@pytest.mark.parametrize(("size", "scale"), SIZES)
@pytest.mark.parametrize("dialog", DIALOGS)
def test_the_buttons_are_in_the_window(
    dialog: str, size: tuple[int, int], scale: float, open_window: OpenWindow
) -> None:
    robot = open_window("low", size, ui_scale=scale)
    robot.app.actions[dialog].run()
    robot.frames(8)
    assert_visible(robot, DIALOGS[dialog])
    robot.key("Esc")
    robot.frames(4)
    assert not robot.app.is_modal, "one Esc closes it"


@pytest.mark.parametrize(("size", "scale"), SIZES)
def test_the_buttons_of_long_questions_are_in_the_window(
    size: tuple[int, int], scale: float, open_window: OpenWindow
) -> None:
    robot = open_window("low", size, ui_scale=scale)
    choices = (Choice("Restore the autosave"), Choice("Continue without it"), Choice("Cancel"))
    robot.app.dialogs.ask(Question("A long one", "Many words that need many lines. " * 30, choices, details="a\n" * 30))
    robot.frames(8)
    assert_visible(robot, ("choice:0", "choice:1", "choice:2"))


def test_a_question_disappears_with_its_object(open_window: OpenWindow, monkeypatch: pytest.MonkeyPatch) -> None:
    robot = open_window("low", (900, 600))
    app, working = robot.app, [True]
    question = Question("Cancel the work and quit?", "A head is being made.", (Choice("Quit"), Choice("Continue")))
    monkeypatch.setattr(app.files, "_quit_question", lambda: question if working else None)
    app.files.quit()
    robot.frames(4)
    assert "choice:0" in app.widget_rects
    working.clear()
    robot.frames(4)
    assert not app.dialogs.open
    assert not app.is_modal
    assert "choice:0" not in app.widget_rects
    app.dialogs.ask(Question("Another", "It is shown as usual."))
    robot.frames(4)
    assert "choice:0" in app.widget_rects


@pytest.mark.parametrize("scale", [0.75, 1.0, 1.25, 1.5, 2.0])
def test_a_question_that_fits_has_no_scroll_bar(scale: float, open_window: OpenWindow) -> None:
    robot = open_window("low", (1200, 800), ui_scale=scale)
    x, y = robot.at("8.3")
    robot.drag((x, y), (x + 8, y - 10))
    robot.app.files.guard(lambda: None)
    robot.frames(8)
    for shown in imgui.get_current_context().windows:
        if shown.active and shown.name.startswith("##question"):
            assert not shown.scrollbar_y
            assert shown.scroll_max.y == 0.0


def test_the_import_dialog_stays_where_it_is(open_window: OpenWindow) -> None:
    robot = open_window("low", (1200, 860))
    app = robot.app
    importing = app.features[ImportCharacterFeature]
    importing.show()
    robot.frames(6)
    before = {name: app.widget_rects[name] for name in ("import:source", "import:kind:0", "import:start")}
    importing.error = "The file cannot be read, because it is not what it says and so needs a line or two."
    robot.frames(6)
    assert {name: app.widget_rects[name] for name in before} == before
    importing.error = ""
    robot.frames(4)
    advanced = app.widget_rects["import:advanced"]
    robot.click_widget("import:advanced")
    robot.frames(6)
    assert "import:components" in app.widget_rects
    assert app.widget_rects["import:advanced"] == advanced
    assert app.widget_rects["import:source"] == before["import:source"]
    importing.error = "A long error. " * 8
    for kind in range(3):
        robot.click_widget(f"import:kind:{kind}")
        robot.frames(6)
        assert app.widget_rects["import:source"] == before["import:source"]
        assert_visible(robot, DIALOGS["import"])
        assert not window("##import").scroll_max.y


def test_nothing_can_be_imported_without_a_source(open_window: OpenWindow) -> None:
    robot = open_window("low", (1200, 860))
    importing = robot.app.features[ImportCharacterFeature]
    importing.show()
    robot.frames(6)
    robot.click_widget("import:start")
    robot.key("Enter")
    assert importing.page == "form"
    assert importing.error == ""
    importing.form.source, importing.form.output = "/a/head.glb", "/nowhere/head.npz"
    robot.frames(2)
    robot.click_widget("import:start")
    assert "nowhere" in importing.error


def test_esc_closes_a_list_and_then_the_dialog(open_window: OpenWindow) -> None:
    robot = open_window("low", (1200, 860))
    app = robot.app
    app.actions["transfer"].run()
    robot.frames(6)
    robot.click_widget("transfer:to")
    robot.frames(2)
    assert "transfer:to:woman" in app.widget_rects
    robot.key("Esc")
    robot.frames(3)
    assert "transfer:to:woman" not in app.widget_rects
    assert "transfer:to" in app.widget_rects, "the dialog is still open"
    robot.key("Esc")
    robot.frames(3)
    assert not app.is_modal


def test_esc_closes_a_dialog_with_a_focused_field(open_window: OpenWindow) -> None:
    robot = open_window("low", (1200, 860))
    robot.app.features[ImportCharacterFeature].show()
    robot.frames(6)
    robot.click_widget("import:title")
    robot.type("Somebody")
    robot.key("Esc")
    robot.frames(3)
    assert not robot.app.is_modal


def test_a_dialog_appears_where_it_stays(open_window: OpenWindow, monkeypatch: pytest.MonkeyPatch) -> None:
    """In its first frames Dear ImGui finds out how high a window is; meanwhile it is invisible and drawn again."""
    robot = open_window("low", (1100, 860))
    app = robot.app
    alphas: list[float] = []
    begin = imgui.begin_popup_modal
    monkeypatch.setattr(
        imgui, "begin_popup_modal", lambda *given: (alphas.append(imgui.get_style().alpha), begin(*given))[1]
    )
    for name, buttons in DIALOGS.items():
        app.actions[name].run()
        seen = set()
        for _ in range(8):
            app.pacing.take_frame()
            robot.frames(1)
            if alphas[-1] > 0.5:
                seen.add(app.widget_rects[buttons[0]])
            else:
                assert app.pacing.due
        assert len(seen) == 1, name
        robot.key("Esc")
        robot.frames(3)


def test_a_tiny_window_still_has_a_panel_and_all_tools(open_window: OpenWindow) -> None:
    robot = open_window("low", (480, 360), ui_scale=2.0)
    app = robot.app
    robot.frames(3)
    assert "save" not in app.widget_rects
    _, top, _, bottom = app.widget_rects._visible["mode:0"][1]
    assert bottom - top == pytest.approx(app.widget_rects["mode:0"][3] - app.widget_rects["mode:0"][1])
    robot.move(app.widget_rects.center("tool-point"))
    for _ in range(12):
        robot.wheel(-1.0)
    assert "symmetry" in app.widget_rects._visible


def test_a_dialog_of_heads_keeps_its_size_while_it_works(
    open_window: OpenWindow, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def wait(files: list[str], progress: Progress) -> list[object]:
        while True:
            progress.at(f"Waiting {'for a very long stage ' * (files is not None)}")

    monkeypatch.setattr(marked_scan, "find_landmarks", wait)
    robot = open_window("low", (1000, 800))
    robot.app.actions["scan"].run()
    robot.frames(6)
    robot.app.features[ScanFeature].add(tmp_path / "scan.obj")
    robot.frames(3)
    before, button = window("##scan").size, robot.app.widget_rects["scan:cancel"]
    robot.click_widget("scan:find")
    robot.frames(4)
    assert window("##scan").size == before
    assert robot.app.widget_rects["scan:cancel"][3] == button[3], "its button stays at the bottom"
    robot.app.features[ScanFeature].stop()


def test_the_menu_of_files_is_in_groups(open_window: OpenWindow) -> None:
    groups: list[list[str]] = []
    for item in open_window("low").app.actions.items("File"):
        if item.separated or not groups:
            groups.append([])
        groups[-1].append(item.label)
    assert groups[0] == ["New", "New with"]
    assert groups[1][:2] == ["Open...", "Open recent"]
    assert all(label.startswith("Open") for label in groups[1])
    assert groups[2] == ["Import character...", "Head from scan...", "Head from photos..."]
    assert groups[3] == ["Save", "Save as..."]
    assert groups[4][:2] == ["Save OBJ", "Save OBJ as..."]
    assert "Export as..." in groups[4]
    assert groups[5] == ["Quit"]
