"""The tab of the head and its tool, driven by pointer and keys alone."""

import io
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from faceposer.errors import FacePoserError
from faceposer.geometry.alignment import rigid_alignment
from faceposer.gui.features.head.feature import HeadFeature
from faceposer.gui.testing.scripted_user import Robot
from faceposer.model.character_file import load_character, save_character
from tests.windows import OpenWindow

pytestmark = pytest.mark.gl


@pytest.fixture
def robot(open_window: OpenWindow) -> Robot:
    robot = open_window("man", (1000, 1400), pictures=False)
    # The pictures of variations do not matter here.
    vars(robot.app.scene)["portrait_of"] = lambda _, camera, __: np.zeros((*camera.size, 3), dtype=np.uint8)
    feature(robot).require_editor()
    robot.click_widget("tab:Head")
    robot.frames(3)
    return robot


def feature(robot: Robot) -> HeadFeature:
    return robot.app.features[HeadFeature]


def slide(robot: Robot, name: str, share: float) -> None:
    left, top, right, bottom = robot.app.widget_rects[name]
    y = 0.5 * (top + bottom)
    robot.drag((0.5 * (left + right), y), (left + share * (right - left), y))
    robot.frames(2)


def previewing(robot: Robot) -> bool:
    return robot.app.session.preview is not None


def skin(robot: Robot) -> np.ndarray:
    return robot.app.session.model.character.vertices[:17259].copy()


def test_attribute_sliders_set_what_they_say(robot: Robot) -> None:
    before, age = skin(robot), feature(robot).values["age"]
    slide(robot, "head:age", 0.97)
    assert feature(robot).values["age"] > age + 0.5
    assert np.abs(skin(robot) - before).max() > 0.05
    assert robot.app.session.undo_label == "Set age"
    assert robot.app.scene.model is robot.app.session.model
    robot.click_widget("head:age:reset")
    robot.frames(2)
    assert feature(robot).values["age"] == pytest.approx(feature(robot).original_values["age"], abs=1e-2)
    robot.key("Ctrl+Z")
    robot.key("Ctrl+Z")
    robot.frames(2)
    np.testing.assert_array_equal(skin(robot), before)


def test_caricature_moves_away_from_the_average(robot: Robot) -> None:
    distance = feature(robot).require_editor().distance
    before = distance(feature(robot).identity)
    slide(robot, "head:caricature", 0.8)
    assert distance(feature(robot).identity) == pytest.approx(2.0 * before, rel=0.1)
    slide(robot, "head:caricature", 0.0)
    assert distance(feature(robot).identity) == pytest.approx(0.0, abs=0.05)


def test_undo_and_redo_show_the_place_of_each_head_on_its_line(robot: Robot) -> None:
    robot.click_widget("head-random")
    robot.frames(2)
    plain = feature(robot).identity
    slide(robot, "head:caricature", 0.6)
    slide(robot, "head:caricature", 1.0)
    lines, first = feature(robot).caricatures, feature(robot).identity

    def place() -> float | None:
        line = lines.of(feature(robot).identity)
        assert line is None or line.start is plain
        return None if line is None else line.value

    assert place() == pytest.approx(2.5)
    robot.key("Ctrl+Z")
    assert place() == pytest.approx(1.5, abs=0.1)
    robot.key("Ctrl+Z")
    assert place() is None
    robot.key("Ctrl+Y")
    robot.key("Ctrl+Y")
    assert place() == pytest.approx(2.5)
    # Continued, the slider is absolute: it does not exaggerate the exaggerated head.
    slide(robot, "head:caricature", 0.0)
    slide(robot, "head:caricature", 1.0)
    np.testing.assert_allclose(feature(robot).identity.shape, first.shape)


def test_a_drag_that_is_cancelled_leaves_no_line_and_caricatures_are_not_exaggerated(robot: Robot) -> None:
    head = feature(robot)
    left, top, right, bottom = robot.app.widget_rects["head:caricature"]
    robot.move((0.5 * (left + right), 0.5 * (top + bottom)))
    robot.press()
    robot.move((right - 5.0, 0.5 * (top + bottom)))
    robot.frames(2)
    robot.key("Esc")
    robot.release()
    robot.frames(2)
    assert head.caricatures.of(head.identity) is None
    slide(robot, "head:caricature", 1.0)
    distance = head.require_editor().distance
    assert distance(head.identity) > 2.5
    # As after the session is opened again: the line is not known.
    robot.app.session.set_identity(replace(head.identity), "Reopened")
    robot.frames(2)
    slide(robot, "head:caricature", 1.0)
    assert distance(head.identity) < 3.2


def test_random_average_and_original(robot: Robot) -> None:
    original = skin(robot)
    robot.click_widget("head-random")
    robot.frames(2)
    first = skin(robot)
    assert np.abs(first - original).max() > 0.3
    robot.click_widget("head-random")
    robot.frames(2)
    assert np.abs(skin(robot) - first).max() > 0.3
    robot.click_widget("head-average")
    robot.frames(2)
    assert feature(robot).require_editor().distance(feature(robot).identity) == 0.0
    robot.click_widget("head-original")
    robot.frames(2)
    np.testing.assert_array_equal(skin(robot), original)


def test_locked_parts_stay(robot: Robot) -> None:
    for name in ("eyes", "nose", "rest", "skin"):
        robot.click_widget(f"head:free:{name}")
    before, ids = skin(robot), robot.app.session.model.character.regions["forehead"]
    robot.click_widget("head-random")
    robot.frames(2)
    moved = np.linalg.norm(skin(robot) - before, axis=1)
    assert moved.max() > 0.2
    assert moved[ids].max() < 0.01
    assert feature(robot).identity.texture is None


def test_variations_are_chosen_from_a_grid(robot: Robot) -> None:
    before = skin(robot)
    robot.click_widget("tab:View")
    robot.click_widget("menu:Head")
    robot.click_widget("menu:head-variations")
    robot.frames(12)
    robot.click_widget("head:variation:4")
    robot.frames(2)
    chosen = skin(robot)
    assert np.abs(chosen - before).max() > 0.1
    robot.click_widget("head:variation:0")
    robot.frames(2)
    np.testing.assert_allclose(skin(robot), before, atol=1e-3)
    # The others can still be chosen after undo, back to the character's own head, too.
    for _ in range(2):
        robot.key("Ctrl+Z")
        robot.frames(2)
    np.testing.assert_array_equal(skin(robot), before)
    robot.click_widget("head:variation:4")
    robot.frames(2)
    np.testing.assert_array_equal(skin(robot), chosen)


def test_variations_scroll_no_farther_than_needed(robot: Robot) -> None:
    place = robot.app.widget_rects["head:variations"]
    robot.click_widget("head:variations")
    robot.frames(12)
    rects = robot.app.widget_rects
    # The grid is in sight, and the button under the pointer did not move if there was room for both.
    assert rects["head:variation:8"][3] <= rects["head-save"][1]
    assert rects["head:variations"][1] == pytest.approx(place[1])
    before = rects["head:variation:4"]
    robot.click_widget("head:variation:4")
    robot.frames(12)
    assert rects["head:variation:4"] == before
    robot.click_widget("head:variations")
    robot.frames(12)
    assert rects["head:variation:4"] == before


def test_heads_are_mixed(robot: Robot) -> None:
    before = skin(robot)
    woman = load_character("woman").vertices[:17259]
    robot.click_widget("head:other")
    robot.frames(2)
    robot.click_widget("head:other:woman")
    robot.frames(2)
    slide(robot, "head:share", 1.0)
    # The woman's head is laid on the frame of the man.
    face = np.unique(np.concatenate([load_character("man").regions[name] for name in ("nose", "mouth", "cheek_left")]))
    face = face[face < len(before)]
    mixed = skin(robot)[face]

    def distance(other: np.ndarray) -> float:
        laid = rigid_alignment(other[face], mixed).apply(other[face])
        return float(np.linalg.norm(laid - mixed, axis=1).mean())

    assert distance(woman) < 0.1 * distance(before)
    head = feature(robot)
    line = head.mixtures.of(head.identity, head.other_head())
    assert line is not None
    assert line.value == 1.0
    robot.key("Ctrl+Z")
    assert head.mixtures.of(head.identity, head.other_head()) is None
    robot.key("Ctrl+Y")
    assert head.mixtures.of(head.identity, head.other_head()) is line
    head.other = ""
    assert head.mixtures.of(head.identity, head.other_head()) is None, "the share is that of the character chosen"


def test_the_skin_is_edited(robot: Robot) -> None:
    own = robot.app.session.model.character.textures["skin"]
    robot.move(robot.app.widget_rects.center("head:age"))
    robot.wheel(-60.0)
    robot.frames(3)
    robot.click_widget("head:edit-skin")
    robot.frames(3)
    texture = feature(robot).identity.texture
    assert texture is not None
    edited = robot.app.session.model.character.textures["skin"]
    assert edited != own
    slide(robot, "head:tone", 0.9)
    after = feature(robot).identity.texture
    assert after is not None
    assert after.coefficients[0] > texture.coefficients[0] + 0.5
    assert robot.app.session.undo_label == "Set tone"
    darker = robot.app.session.model.character.textures["skin"]
    assert _brightness(darker) < 0.9 * _brightness(edited)
    robot.click_widget("head:tone:reset")
    robot.frames(2)
    assert feature(robot).identity.texture == texture
    for _ in range(3):
        robot.key("Ctrl+Z")
    assert robot.app.session.model.character.textures["skin"] == own


def _brightness(encoded: bytes) -> float:
    return float(np.asarray(Image.open(io.BytesIO(encoded)).convert("L").resize((64, 64)))[20:44, 20:44].mean())


def test_dragging_changes_the_head_and_not_the_pose(robot: Robot) -> None:
    session = robot.app.session
    session.rebase_pose(session.model.coefficients_of({"jawOpen": 0.4}), "Open")
    robot.frames(2)
    before, pose = skin(robot), session.coefficients
    robot.key("B")
    vertex = session.model.character.feature_points["9.3"]
    position = robot.app.viewport.camera.project(session.vertices[vertex][None])[0]
    origin = robot.app.viewport.origin
    begin = (float(position[0] + origin[0]), float(position[1] + origin[1]))
    robot.drag(begin, (begin[0], begin[1] - 15.0))
    robot.frames(2)
    moved = np.linalg.norm(skin(robot) - before, axis=1)
    assert moved[vertex] > 0.1
    np.testing.assert_array_equal(session.coefficients, pose)
    assert session.undo_label == "Shape the head"
    # Esc leaves the head as it was.
    shaped = skin(robot)
    robot.move(begin)
    robot.press()
    robot.move((begin[0] + 30.0, begin[1]))
    assert previewing(robot)
    robot.key("Esc")
    robot.release()
    robot.frames(2)
    assert not previewing(robot)
    np.testing.assert_array_equal(skin(robot), shaped)


def test_heads_are_saved_as_characters(robot: Robot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    robot.click_widget("head-random")
    robot.frames(2)
    feature(robot).save("Ann Other")
    with pytest.raises(FacePoserError, match="There is a character ann other already"):
        feature(robot).save("ann other")
    entry = next(one for one in robot.app.characters.all(()) if one.title == "Ann Other")
    saved = load_character(entry.name)
    np.testing.assert_array_equal(saved.vertices, robot.app.session.model.character.vertices)
    assert saved.name == Path(entry.name).stem
    for source in ("ICT-FaceKit", "Skins: MakeHuman", "Face Units 01"):
        assert saved.credits.count(source) == 1, source


def test_characters_without_the_model_have_no_tab(open_window: OpenWindow) -> None:
    robot = open_window("low", pictures=False)
    assert "tab:Head" not in robot.app.widget_rects
    assert not robot.app.actions["head-random"].enabled()
    assert "head" not in [tool.name for tool in robot.app.toolbox.usable_tools]


def test_trained_characters_on_the_mans_mesh_have_no_tab(open_window: OpenWindow, tmp_path: Path) -> None:
    man = load_character("man")
    names = man.shape_names[:20]
    limits = man.shape_limits[:20]
    trained = replace(man, shapes=man.shapes[:20], shape_names=names, shape_limits=limits, name="t", title="T")
    save_character(tmp_path / "t.npz", trained)
    robot = open_window(str(tmp_path / "t.npz"), pictures=False)
    robot.frames(3)
    assert "tab:Head" not in robot.app.widget_rects
    assert "head" not in [tool.name for tool in robot.app.toolbox.usable_tools]


def test_a_head_that_cannot_be_measured_says_why_once(open_window: OpenWindow, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(_: object) -> None:
        raise FacePoserError("The model is damaged.")

    monkeypatch.setattr("faceposer.identity.editing.head_editor", fail)
    robot = open_window("man", pictures=False)
    robot.click_widget("tab:Head")
    robot.frames(10)
    assert feature(robot).failure == "The model is damaged."
    assert not robot.app.dialogs.open
