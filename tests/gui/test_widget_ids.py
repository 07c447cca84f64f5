"""No two widgets share an id, in any panel, tab, dialog or state of the window, and no widget stays unvisited.

Dear ImGui tells widgets apart by ids; of two with the same one, a drag moves the wrong one. The walk below has to visit
every line of the package that draws a widget: a new panel that it does not know fails the test.
"""

import threading
import time
from collections.abc import Collection, Iterator
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from imgui_bundle import imgui
from PIL import Image

from faceposer.animation.keyframes import Keyframes
from faceposer.film.expression import FilmExpression
from faceposer.film.shots import Shot
from faceposer.film.tracking import Track
from faceposer.gui.app import App
from faceposer.gui.events import Drop
from faceposer.gui.features.export.feature import ExportFeature
from faceposer.gui.features.film.feature import FilmFeature
from faceposer.gui.features.film.state import MadeKeys
from faceposer.gui.features.film.stills import Stills
from faceposer.gui.features.head.feature import HeadFeature
from faceposer.gui.features.head_making.contents import Compared, MadeHead
from faceposer.gui.features.head_making.feature import HeadMakingFeature
from faceposer.gui.features.import_character.feature import ImportCharacterFeature
from faceposer.gui.features.keys.feature import KeysFeature
from faceposer.gui.features.photo_head.feature import PhotoHeadFeature
from faceposer.gui.features.scan.feature import ScanFeature
from faceposer.gui.features.timeline.feature import TimelineFeature
from faceposer.gui.features.trajectories.feature import TrajectoriesFeature
from faceposer.gui.settings import Settings
from faceposer.gui.testing.few_pixels import draw_few_pixels
from faceposer.gui.testing.scripted_user import Robot
from faceposer.gui.widgets.dialogs import Question
from faceposer.interchange.formats import FORMATS
from faceposer.model.character_file import load_character, save_character
from faceposer.model.performance import Performance
from faceposer.poses.pose_file import Pose, write_pose
from faceposer.progress import Progress
from faceposer.session.jobs import ThreadJob
from faceposer.session.key_proposals import create_keys
from tests.gui.test_constraint_tools import make_all
from tests.gui.widget_ids import WidgetIds, hovered_conflicts, widget_lines

pytestmark = [pytest.mark.gl, pytest.mark.usefixtures("small_textures")]

CORNER = "8.3"
CTRL = frozenset({"ctrl"})


@pytest.fixture
def ids(monkeypatch: pytest.MonkeyPatch) -> WidgetIds:
    return WidgetIds(monkeypatch)


@pytest.fixture
def robot(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, ids: WidgetIds) -> Iterator[Robot]:
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path / "data"))
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    settings = Settings(window_size=(1360, 1000), folder=str(tmp_path), poses_folder=str(tmp_path / "poses"))
    app = App("man", hidden=True, threaded=False, settings=settings)
    draw_few_pixels(app)
    vars(app.scene)["portrait"] = lambda _, camera, __: np.zeros((*camera.size, 3), dtype=np.uint8)
    yield Robot(app)
    if app._window is not None:
        app.close()


def pull(robot: Robot) -> None:
    x, y = robot.at(CORNER)
    robot.drag((x, y), (x + 12, y - 14))


def open_menus(robot: Robot) -> None:
    """Open each menu, and each menu inside it."""
    for menu in robot.app.actions.menus:
        robot.click_widget(f"menu:{menu}")
        titles = {f"menu:{title}" for title in robot.app.actions.menus}
        for name in [name for name in robot.app.widget_rects if name.startswith("menu:") and name not in titles]:
            robot.move(robot.app.widget_rects.center(name))
            robot.frames(2)
        robot.key("Esc")
        robot.frames(2)


def visit_constraints(robot: Robot) -> None:
    """Show the list without a constraint, with one of each kind selected, with several, locked and disabled."""
    app = robot.app
    robot.click_widget("tab:Pose")
    robot.click_widget("advanced")
    robot.click_widget("mode:1")
    robot.click_widget("mode:0")
    for tool in app.toolbox.tools:
        app.toolbox.choose(tool)
        robot.frames(2)
    robot.key("H")
    robot.click_widget("fix:1")
    robot.click_widget("fix:0")
    robot.key("K")
    x, y = robot.at("8.4")
    for dx in (0, 20):
        robot.click((x + dx, y - 60))
    robot.key("Esc")
    robot.key("Q")
    make_all(robot)
    robot.click_widget("tab:Pose")
    count = len(app.session.document.constraints)
    for index in range(count):
        app.toolbox.select(index)
        robot.frames(2)
        robot.click_widget(f"point:{index}:lock")
        robot.click_widget(f"point:{index}:on")
    for index in range(count):
        app.toolbox.select(index, extend=True)
        robot.frames(2)
    app.toolbox.select(0)
    robot.key("1")
    app.viewport.look("left")
    robot.frames(2)
    # From another side, what was drawn has a button that leads back to its view.
    assert "its-view" in app.widget_rects
    app.viewport.look("front")
    app.session.set_spread(0.9)
    robot.frames(2)


def visit_sketch(robot: Robot) -> None:
    """Draw what is no feature, and open its list of features."""
    robot.key("E")
    x, y = robot.at("9.3")
    robot.move((x - 40, y - 90))
    robot.press()
    for i in range(24):
        robot.move((x - 40 + 3 * i, y - 90 + 60 * (i % 2)))
    robot.release()
    robot.click_widget("sketch-name")
    robot.frames(2)
    assert "feature:jaw line" in robot.app.widget_rects
    robot.key("Esc")
    robot.key("Esc")
    robot.key("Q")


def visit_tabs(robot: Robot) -> None:
    for name in [name for name in robot.app.widget_rects if name.startswith("tab:")]:
        robot.click_widget(name)
        robot.frames(2)
    robot.click_widget("tab:Pose")


def visit_poses(robot: Robot, folder: Path) -> None:
    folder.mkdir(exist_ok=True)
    for name in ("First", "Second"):
        write_pose(folder / f"{name.lower()}.json", Pose(name, {"jawOpen": 0.5}, "man"))
    robot.click_widget("tab:Poses")
    robot.click_widget("pose:Happiness")
    robot.click_widget("poses:region:mouth")
    left, top, right, bottom = robot.app.widget_rects["poses:strength"]
    robot.drag((left + 0.7 * (right - left), 0.5 * (top + bottom)), (left + 0.8 * (right - left), top + 4))
    robot.click_widget("poses:category:3")
    robot.click(robot.app.widget_rects.center("pose:First"), "right")
    robot.frames(2)
    assert "pose-menu:delete" in robot.app.widget_rects
    robot.click_widget("pose-menu:rename")
    robot.frames(2)
    robot.key("Esc")
    robot.click_widget("pose-save")
    robot.frames(2)
    robot.key("Esc")
    robot.click_widget("tab:Pose")


def visit_photo(robot: Robot, folder: Path) -> None:
    app = robot.app
    for name in ("one", "two"):
        Image.fromarray(np.full((60, 80, 3), 90, dtype=np.uint8)).save(folder / f"{name}.png")
        app.window.play_event(Drop((str(folder / f"{name}.png"),)))
        robot.frames(5)
        robot.key("Enter")
        robot.frames(3)
    robot.key("Shift+W")
    robot.frames(2)
    assert "photo-wipe-line" in app.widget_rects
    robot.key("O")
    robot.click_widget("tab:Photo")
    left, top, right, bottom = app.widget_rects["view"]
    for share in (0.4, 0.5):
        robot.click((left + share * (right - left), top + 0.5 * (bottom - top)))
    robot.click_widget("tab:Photo")
    robot.frames(2)
    for _ in range(2):
        robot.click_widget("photo:0:delete")
    robot.key("Q")
    robot.click_widget("tab:Pose")


def visit_timeline(robot: Robot) -> None:
    app = robot.app
    robot.key("I")
    robot.frames(2)
    app.features[TimelineFeature].go_to(9)
    robot.key("R")
    robot.key("I")
    robot.frames(2)
    robot.click_widget("rate")
    robot.frames(2)
    robot.key("Esc")
    robot.click_widget("inbetweens-shown")
    robot.frames(2)
    robot.key("Esc")
    robot.key("J")
    robot.click_widget("timing:1")
    pull(robot)
    robot.frames(2)
    assert app.toolbox.trajectory_tool.drawn
    feature = app.features[TrajectoriesFeature]
    feature.solve_drawn()
    deadline = time.monotonic() + 30.0
    while feature.job is not None and time.monotonic() < deadline:
        robot.frames(1)
        time.sleep(0.01)
    robot.key("Q")
    assert len(app.features[TimelineFeature].keyframes.keys) > 1


def visit_files(robot: Robot, folder: Path) -> None:
    app = robot.app
    (folder / "inside").mkdir(exist_ok=True)
    for action in ("open", "save-as", "export-as"):
        app.actions[action].run()
        robot.frames(3)
        assert app.file_dialogs.browsing
        robot.key("Esc")
    app.settings.recent = [str(folder / "one.json")]
    exchange = app.features[ExportFeature]
    app.actions["export-other"].run()
    for suffix in FORMATS:
        exchange.form.suffix = suffix
        for animated in (False, True):
            exchange.form.animated = animated
            robot.frames(2)
    robot.key("Esc")
    robot.frames(2)


def visit_dialogs(robot: Robot) -> None:
    app = robot.app
    robot.key("F1")
    robot.frames(2)
    robot.key("Esc")
    robot.frames(2)
    robot.key("Ctrl+P")
    robot.type("s")
    robot.frames(2)
    robot.key("Esc")
    robot.frames(2)
    app.actions["about"].run()
    robot.frames(2)
    robot.key("Esc")
    app.dialogs.ask(Question("Broken", "It failed.", details="Traceback\nmore"))
    robot.frames(3)
    robot.key("Esc")
    robot.frames(2)
    app.window.set_size((1800, 900))
    app.actions["guide"].run()
    robot.frames(3)
    assert "guide:skip" in app.widget_rects
    app.window.set_size((520, 420))
    robot.frames(3)
    app.window.set_size((1360, 1000))
    robot.frames(2)
    app.dismiss_guide()
    robot.frames(2)


def visit_transfer(robot: Robot) -> None:
    robot.app.actions["transfer"].run()
    robot.frames(6)
    for name, entry in (("transfer:to", "woman"), ("transfer:end:0", "9.3"), ("transfer:end:1", "8.3")):
        robot.click_widget(name)
        robot.frames(2)
        robot.click_widget(f"{name}:{entry}")
        robot.frames(2)
    robot.click_widget("transfer:method:1")
    robot.frames(2)
    robot.key("Esc")
    robot.frames(2)


def visit_keys(robot: Robot, folder: Path) -> None:
    """Show the strip of key poses empty and full, its menus and dialogs, and the method "examples" of the transfer."""
    app = robot.app
    keys = app.features[KeysFeature]

    def finish() -> None:
        for _ in range(3):
            keys.join()
            robot.frames(3)

    app.actions["key-poses"].run()
    robot.frames(2)
    robot.click_widget("keys:menu")
    robot.click_widget("menu:keys-new")
    robot.click_widget("keys-new:to")
    robot.click_widget("keys-new:to:low")
    robot.key("Esc")
    app.actions["transfer"].run()
    robot.frames(4)
    robot.click_widget("transfer:method:2")
    robot.frames(2)
    keys.opened.open(create_keys(folder / "pairs", "man", "woman").folder)
    finish()
    robot.key("Esc")
    poses = np.zeros((3, app.session.model.n_coefficients))
    poses[1, 0] = 0.1
    app.feature(TimelineFeature).change(Keyframes.of_performance(Performance(poses, 30.0)), "Take")
    robot.frames(2)
    robot.click(app.widget_rects.center("key:anger:target"), "right")
    robot.frames(2)
    robot.key("Esc")
    app.actions["keys-importance-source"].run()
    finish()
    robot.key("Esc")
    app.actions["keys-add"].run()
    robot.frames(4)
    robot.key("Esc")
    robot.frames(2)
    robot.click_widget("key:anger:source")
    robot.frames(2)
    robot.click_widget("keys-back")
    robot.frames(2)
    robot.key("Ctrl+Z")
    # A key that cannot be read is left out.
    (folder / "pairs" / "target" / "ah.json").write_text("{")
    keys.opened.read()
    finish()
    robot.click_widget("keys:left-out")
    robot.click_widget("keys:close")
    robot.frames(2)


def visit_import(robot: Robot, folder: Path) -> None:
    app = robot.app
    importing = app.features[ImportCharacterFeature]
    importing.show()
    robot.frames(4)
    importing.form.captures = ["/a/take.csv", "/b/take.csv"]
    # The dialog is in the middle once it knows how high it is.
    robot.frames(4)
    robot.click_widget("import:advanced")
    robot.frames(4)
    assert "import:components" in app.widget_rects
    for kind in range(3):
        robot.click_widget(f"import:kind:{kind}")
        robot.frames(3)
        if kind:
            robot.click_widget("import:regions:2")
            robot.frames(3)
    importing.close_dialog()
    robot.frames(3)
    curves = {"components": [1, 2, 3], "compactness": [0.5, 0.7, 1.0]}
    curves |= {"generalization_cm": [0.3, 0.2, 0.1], "specificity_cm": [0.1, 0.2, 0.3], "neutral_cm": 0.4}
    summary = {
        "kind": "rig",
        "source": "head.glb",
        "shapes": 51,
        "dimensions": 40,
        "missing": ["tongueOut"],
        "empty": [],
        "not_arkit": [],
        "eyes_turned": [],
        "kept_energy": 0.99,
        "worst": {"shape": "jawOpen", "unreached": 0.1},
        "prior": {"from": "the shipped statistics"},
        "warnings": ["Left and right were exchanged."],
        "curves": curves,
    }
    importing.about = {
        "title": "Head",
        "path": str(folder / "head.npz"),
        "file_vertices": 10,
        "polygons": 5,
        "parts": [{"name": "head"}],
        "summary": summary,
    }
    importing.open = True
    robot.frames(6)
    robot.click_widget("import:details")
    robot.frames(4)
    importing.close_dialog()
    robot.frames(3)


def visit_head(robot: Robot) -> None:
    """Show the tab of the head with all groups, variations, another character and an edited skin."""
    app = robot.app
    feature = app.features[HeadFeature]
    editor = feature.require_editor()
    app.toolbox.choose("head")
    robot.click_widget("tab:Pose")
    robot.frames(2)
    robot.click_widget("tab:Head")
    robot.frames(2)
    robot.click_widget("head:other")
    robot.frames(2)
    robot.click_widget("head:other:woman")
    robot.frames(2)
    robot.click_widget("head:variations")
    robot.frames(2)
    for group in {attribute.group for attribute in editor.attributes.attributes} - {"Person"}:
        if f"head:group:{group}" in app.widget_rects:
            robot.click_widget(f"head:group:{group}")
            robot.frames(1)
    feature.set_identity(replace(editor.own, texture=editor.own_texture()), "Edit the skin")
    robot.frames(2)
    robot.move(app.widget_rects.center("head:other"))
    robot.wheel(-60.0)
    robot.frames(3)
    for combo in ("hair", "eyes"):
        robot.click_widget(f"head:{combo}")
        robot.frames(2)
        robot.key("Esc")
    feature.restore_original()
    robot.frames(2)
    robot.key("Q")
    robot.click_widget("tab:Pose")


@dataclass(frozen=True)
class Face:
    """A face in a picture, for the pages of landmarks."""

    name: str
    image: np.ndarray
    pixels: dict[str, tuple[float, float]]
    moved: frozenset[str] = frozenset()
    note: str = "Another face was found."

    @property
    def found_pixels(self) -> dict[str, tuple[float, float]]:
        return self.pixels

    def with_moved(self, name: str, pixel: tuple[float, float]) -> "Face":
        return replace(self, pixels={name: pixel}, moved=frozenset({name}))

    def with_reset(self, names: Collection[str]) -> "Face":
        return replace(self, moved=self.moved - frozenset(names))


@dataclass(frozen=True, eq=False)
class ComparedHead(MadeHead):
    """A head that was compared with two pictures."""

    @property
    def views(self) -> tuple[Compared, ...]:
        return (Compared("a", self.picture, self.picture), Compared("b", self.picture))


def visit_head_making(robot: Robot, folder: Path) -> None:
    """Show all pages of the dialogs that make heads."""
    image = np.zeros((40, 40, 3), dtype=np.uint8)
    features: list[HeadMakingFeature[Any, Any]] = [
        robot.app.features[ScanFeature],
        robot.app.features[PhotoHeadFeature],
    ]
    for feature in features:
        feature.show()
        feature.files = [str(folder / "a"), str(folder / "b")]
        feature.error = "It failed."
        robot.frames(3)
        faces = [Face("a", image, {"8.3": (5.0, 5.0), "8.4": (9.0, 5.0)}), Face("b", image, {})]
        feature.landmarks.show(faces)
        robot.frames(3)
        ended = threading.Event()
        feature.fitting = ThreadJob(partial(wait_for, ended), lambda: None, "Waiting")
        feature.preview = image
        robot.frames(3)
        assert f"{feature.words.action[0]}:progress" in robot.app.widget_rects
        ended.set()
        feature.fitting.join()
        feature.fitting = None
        feature.result = ComparedHead(load_character("low"), "It fits.", image, doubt="Check it.")
        robot.frames(3)
        feature.close_dialog()
        robot.frames(3)


def wait_for(ended: threading.Event, _: Progress) -> None:
    ended.wait(10.0)


def visit_film(robot: Robot, folder: Path) -> None:
    """Show the pages of the dialog of films: the form with an error, the work with a picture, the choice of keys."""
    image = Image.new("RGB", (40, 40))
    image.save(folder / "film.gif", save_all=True, append_images=[Image.new("RGB", (40, 40), (9, 9, 9))], duration=100)
    feature = robot.app.features[FilmFeature]
    feature.open_film(folder / "film.gif")
    feature.error = "It failed."
    robot.frames(3)
    assert feature.film is not None
    vars(feature.film)["notes"] = ("A rate was assumed.",)
    robot.frames(2)
    feature.stills = Stills()
    feature.stills.preview = np.zeros((40, 40, 3), dtype=np.uint8)
    ended = threading.Event()
    feature.job = ThreadJob(lambda _: ended.wait(10.0) and None, lambda: None, "Waiting")
    robot.frames(3)
    assert "film:progress" in robot.app.widget_rects
    ended.set()
    feature.job.join()
    model = robot.app.session.model
    dense = Keyframes.of_performance(Performance(np.zeros((3, model.n_coefficients)), 10.0))
    track = Track((40, 40), np.arange(3), (None,) * 3, Shot(0, 2))
    found = FilmExpression(
        dense.performance(model),
        feature.film,
        0,
        track,
        ("The film cuts.",),
        {},
        np.full(len(model.character.shape_names), 0.02),
    )
    robot.frames(1)
    feature.result = MadeKeys(found, dense, dense.reduced(model, 0.1))
    robot.frames(3)
    assert "film:few" in robot.app.widget_rects
    robot.key("Esc")
    robot.frames(3)
    robot.click_widget("choice:0")
    robot.frames(3)
    assert not feature.open


def visit_preferences(robot: Robot) -> None:
    robot.app.actions["preferences"].run()
    robot.frames(6)
    robot.click_widget("preferences:keymap")
    robot.frames(4)
    # The key of another action, which can be taken from it.
    robot.click_widget("keymap:new")
    robot.key("Ctrl+O")
    robot.frames(2)
    assert "preferences:reassign" in robot.app.widget_rects
    robot.key("Esc")
    robot.frames(3)


def visit_characters(robot: Robot, folder: Path) -> None:
    """Open the list with two characters of the same name in the library and one elsewhere, and the rename dialog."""
    app = robot.app
    app.characters.make_folder()
    character = replace(load_character("low"), title="Head")
    paths = [app.characters.folder / "one.npz", app.characters.folder / "two.npz", folder / "three.npz"]
    for path in paths:
        save_character(path, character)
    app.settings.characters = [str(paths[2])]
    robot.click_widget("character")
    robot.frames(3)
    robot.click_widget(f"character:{paths[0]}:rename")
    robot.frames(3)
    assert app.dialogs.open
    robot.key("Esc")
    robot.frames(3)
    robot.click_widget("menu:File")
    robot.move(app.widget_rects.center("menu:new-with"))
    robot.frames(30)
    robot.key("Esc")
    robot.key("Esc")
    robot.frames(3)


def test_every_widget_of_every_state_has_an_id_of_its_own(robot: Robot, ids: WidgetIds, tmp_path: Path) -> None:
    app = robot.app
    open_menus(robot)
    visit_tabs(robot)
    visit_constraints(robot)
    visit_sketch(robot)
    visit_tabs(robot)
    open_menus(robot)
    visit_poses(robot, tmp_path / "poses")
    visit_photo(robot, tmp_path)
    visit_timeline(robot)
    visit_tabs(robot)
    visit_files(robot, tmp_path)
    visit_dialogs(robot)
    visit_transfer(robot)
    visit_keys(robot, tmp_path)
    visit_import(robot, tmp_path)
    visit_head(robot)
    visit_head_making(robot, tmp_path)
    visit_film(robot, tmp_path)
    visit_preferences(robot)
    visit_characters(robot, tmp_path)
    assert not app.dialogs.open
    assert not ids.conflicts
    unvisited = [
        f"{file}:{line}"
        for (file, line), lines in widget_lines().items()
        if not ids.visited & {(file, number) for number in lines}
    ]
    assert not unvisited


def test_a_shared_id_is_found(robot: Robot, ids: WidgetIds, monkeypatch: pytest.MonkeyPatch) -> None:
    pull(robot)
    assert not ids.conflicts
    draw = robot.app.pose_panel.draw

    def draw_twice(context: App) -> None:
        draw(context)
        draw(context)

    monkeypatch.setattr(robot.app.pose_panel, "draw", draw_twice)
    robot.frames(2)
    assert any("pose:weight" in label for labels in ids.conflicts for label in labels)


def test_the_weight_of_a_constraint_moves_by_its_slider_in_one_step(robot: Robot) -> None:
    """Its slider and that of the prior were once mistaken for each other."""
    app = robot.app
    imgui.get_io().config_debug_highlight_id_conflicts = True
    pull(robot)
    for name in ("weight", "detail:weight"):
        robot.move(app.widget_rects.center(name))
        robot.frames(3)
        assert hovered_conflicts() == 0
    before, label = app.session.document, app.session.undo_label
    left, top, right, bottom = app.widget_rects["detail:weight"]
    middle = 0.5 * (top + bottom)
    robot.move((left + 0.7 * (right - left), middle))
    robot.press()
    robot.move((left + 0.9 * (right - left), middle), 4)
    robot.release()
    after = app.session.document
    assert after.constraints[0].weight > 5.0
    assert after.prior_weight == before.prior_weight
    robot.key("Ctrl+Z")
    assert app.session.document.constraints == before.constraints
    assert app.session.undo_label == label


def test_a_weight_can_be_typed(robot: Robot) -> None:
    app = robot.app
    pull(robot)
    label = app.session.undo_label
    robot.click(app.widget_rects.center("detail:weight"), modifiers=CTRL)
    robot.frames(2)
    robot.key("Ctrl+A")
    robot.type("2.5")
    robot.key("Enter")
    robot.frames(2)
    assert app.session.document.constraints[0].weight == pytest.approx(2.5)
    assert app.session.document.prior_weight == 1.0
    robot.key("Ctrl+Z")
    assert app.session.undo_label == label


def test_users_see_no_debug_boxes_of_the_library(robot: Robot) -> None:
    io = imgui.get_io()
    assert not io.config_debug_highlight_id_conflicts
    assert not io.config_debug_highlight_id_conflicts_show_item_picker
    assert not io.config_error_recovery_enable_tooltip
