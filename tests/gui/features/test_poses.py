"""The tab of poses, driven by pointer and keys alone."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from faceposer.gui.app import App
from faceposer.gui.feature import Feature
from faceposer.gui.features.poses.feature import PosesFeature
from faceposer.gui.testing.scripted_user import Robot
from faceposer.poses.applying import Array
from faceposer.poses.pose_file import Pose, read_pose, write_pose
from tests.windows import OpenWindow

pytestmark = pytest.mark.gl

LEFT_CORNER, RIGHT_CORNER = "8.3", "8.4"


@pytest.fixture
def robot(open_window: OpenWindow, tmp_path: Path) -> Robot:
    robot = open_window("man", (1000, 900), poses_folder=str(tmp_path / "poses"))
    # The pictures of poses do not matter, either, but to the tests that take this back.
    vars(robot.app.scene)["portrait"] = lambda _, camera, __: np.zeros((*camera.size, 3), dtype=np.uint8)
    robot.click_widget("tab:Poses")
    return robot


def feature(robot: Robot) -> PosesFeature:
    found: list[Feature] = [one for one in robot.app.features.with_tab if isinstance(one, PosesFeature)]
    assert isinstance(found[0], PosesFeature)
    return found[0]


def weights(robot: Robot) -> dict[str, float]:
    session = robot.app.session
    values = session.model.weights_of(session.coefficients).tolist()
    return dict(zip(session.model.character.shape_names, values, strict=True))


def slide(robot: Robot, percent: float) -> None:
    left, top, right, bottom = robot.app.widget_rects["poses:strength"]
    y = 0.5 * (top + bottom)
    robot.drag((left + 0.5 * (right - left), y), (left + (percent + 100.0) / 300.0 * (right - left), y))


def choose_from_menu(robot: Robot, pose: str, item: str) -> None:
    robot.click(robot.app.widget_rects.center(f"pose:{pose}"), "right")
    robot.frames(2)
    robot.click_widget(f"pose-menu:{item}")


def type_name(robot: Robot, name: str) -> None:
    robot.key("Ctrl+A")
    robot.type(name)
    robot.click_widget("pose-name:accept")


def test_a_click_applies_a_pose_and_undo_takes_it_back(robot: Robot) -> None:
    session = robot.app.session
    robot.click_widget("pose:Happiness")
    assert weights(robot)["mouthSmileLeft"] > 0.9
    assert session.undo_label == "Apply Happiness"
    robot.key("Ctrl+Z")
    np.testing.assert_array_equal(session.coefficients, session.model.neutral())
    assert feature(robot).applied_pose is None
    robot.key("Ctrl+Shift+Z")
    assert feature(robot).applied_pose is not None, "the slider goes on where it was"


def test_strength_is_live_and_one_step_with_the_click(robot: Robot) -> None:
    session = robot.app.session
    robot.click_widget("pose:Surprise")
    full = session.coefficients
    slide(robot, 40.0)
    applied = feature(robot).applied_pose
    assert applied is not None
    assert 0.3 < applied.strength < 0.5
    np.testing.assert_allclose(session.coefficients, applied.strength * full, atol=1e-9)
    slide(robot, -100.0)
    assert feature(robot).applied_pose.strength == pytest.approx(-1.0, abs=0.05)  # type: ignore[union-attr]
    robot.click_widget("poses:strength:reset")
    np.testing.assert_allclose(session.coefficients, full, atol=1e-9)
    robot.key("Ctrl+Z")
    np.testing.assert_array_equal(session.coefficients, session.model.neutral())
    assert not session.can_undo


def test_escape_takes_a_drag_of_the_strength_back(robot: Robot) -> None:
    session = robot.app.session
    robot.click_widget("pose:Anger")
    full = session.coefficients
    left, top, right, bottom = robot.app.widget_rects["poses:strength"]
    robot.move((0.5 * (left + right), 0.5 * (top + bottom)))
    robot.press()
    robot.move((left + 5.0, 0.5 * (top + bottom)), 4)
    assert np.abs(session.coefficients - full).max() > 0.05
    robot.key("Esc")
    robot.release()
    np.testing.assert_allclose(session.coefficients, full, atol=1e-9)


def test_regions_and_sides_reach_only_theirs(robot: Robot) -> None:
    robot.click_widget("poses:region:mouth")
    robot.click_widget("poses:side:1")
    robot.click_widget("pose:Happiness")
    assert weights(robot)["mouthSmileLeft"] > 0.9
    assert abs(weights(robot)["mouthSmileRight"]) < 0.05
    assert abs(weights(robot)["cheekSquintLeft"]) < 0.05
    robot.click_widget("poses:region:all")
    robot.click_widget("poses:side:0")
    assert abs(weights(robot)["mouthSmileRight"]) < 0.05, "what is there stays until it is clicked again"
    slide(robot, 50.0)
    assert abs(weights(robot)["mouthSmileRight"]) < 0.05
    robot.click_widget("pose:Happiness")
    assert weights(robot)["cheekSquintLeft"] > 0.5
    assert weights(robot)["mouthSmileRight"] > 0.9
    robot.key("Ctrl+Z")
    assert not robot.app.session.can_undo


def test_poses_by_region_make_one_face_and_add_comes_on_top(robot: Robot) -> None:
    robot.click_widget("pose:Anger")
    robot.click_widget("poses:region:mouth")
    robot.click_widget("pose:Surprise")
    assert weights(robot)["jawOpen"] > 0.4
    assert weights(robot)["browDownLeft"] > 0.8
    robot.key("Ctrl+Z")
    robot.click_widget("poses:region:all")
    robot.click_widget("pose:Surprise")
    assert abs(weights(robot)["browDownLeft"]) < 0.1
    robot.key("Ctrl+Z")
    assert weights(robot)["browDownLeft"] > 0.8
    robot.click_widget("poses:blend:1")
    robot.click_widget("pose:Surprise")
    assert weights(robot)["browInnerUpLeft"] > 0.6
    assert weights(robot)["browDownLeft"] > 0.8


def test_constraints_keep_pulling_while_a_pose_comes(robot: Robot) -> None:
    x, y = robot.at(LEFT_CORNER)
    robot.drag((x, y), (x + 8, y - 10))
    target = robot.at(LEFT_CORNER)
    robot.click_widget("pose:Surprise")
    seen = robot.at(LEFT_CORNER)
    assert np.hypot(seen[0] - target[0], seen[1] - target[1]) < 3.0
    assert weights(robot)["browInnerUpRight"] > 0.5
    assert len(robot.app.session.document.constraints) == 1


def test_mirror_and_flip_settle_the_face(robot: Robot) -> None:
    session = robot.app.session
    robot.click_widget("poses:side:1")
    robot.click_widget("pose:Happiness")
    robot.click_widget("pose-flip")
    assert weights(robot)["mouthSmileRight"] > 0.9
    assert abs(weights(robot)["mouthSmileLeft"]) < 0.1
    assert session.undo_label == "Flip the face"
    robot.click_widget("poses:side:2")
    robot.click_widget("pose-mirror-right")
    assert weights(robot)["mouthSmileLeft"] > 0.9
    robot.key("Ctrl+Z")
    robot.key("Ctrl+Z")
    assert weights(robot)["mouthSmileLeft"] > 0.9
    assert abs(weights(robot)["mouthSmileRight"]) < 0.1


def test_saving_writes_the_pose_with_a_picture_that_frames_the_face(robot: Robot, tmp_path: Path) -> None:
    del vars(robot.app.scene)["portrait"]
    robot.click_widget("pose:Surprise")
    robot.app.viewport.look("back")
    robot.click_widget("pose-save")
    type_name(robot, "My own")
    folder = tmp_path / "poses"
    assert sorted(p.name for p in folder.iterdir()) == ["my-own.json", "my-own.png"]
    kept = read_pose(folder / "my-own.json")
    assert kept.name == "My own"
    assert kept.weights["jawOpen"] > 0.4
    with Image.open(folder / "my-own.png") as image:
        pixels = np.asarray(image.convert("RGB")).astype(float)
    assert pixels.shape == (256, 256, 3)
    middle = pixels[96:160, 96:160].reshape(-1, 3).mean(axis=0)
    assert middle[0] > 1.3 * middle[2], "skin, though the window looks at the back of the head"
    robot.key("Ctrl+Z")
    robot.click_widget("poses:category:3")
    robot.click_widget("pose:My own")
    assert weights(robot)["jawOpen"] == pytest.approx(kept.weights["jawOpen"], abs=1e-3)


def test_a_taken_name_asks_and_escape_leaves_everything(robot: Robot, tmp_path: Path) -> None:
    folder = tmp_path / "poses"
    folder.mkdir()
    write_pose(folder / "mine.json", Pose("Mine", {"jawOpen": 0.5}, "man"))
    robot.click_widget("pose-save")
    type_name(robot, "Mine")
    assert read_pose(folder / "mine.json").weights["jawOpen"] == 0.5, "nothing is replaced without asking"
    robot.key("Esc")
    assert "pose-name:accept" not in robot.app.widget_rects
    robot.click_widget("pose-save")
    type_name(robot, "Mine")
    robot.click_widget("pose-name:accept")
    assert "jawOpen" not in read_pose(folder / "mine.json").weights


def test_poses_are_renamed_replaced_and_deleted_by_their_menu(robot: Robot, tmp_path: Path) -> None:
    folder = tmp_path / "poses"
    folder.mkdir()
    write_pose(folder / "a.json", Pose("First", {"jawOpen": 0.5}, "man"))
    robot.click_widget("poses:category:3")
    choose_from_menu(robot, "First", "rename")
    type_name(robot, "Second")
    assert [p.name for p in folder.iterdir()] == ["second.json"]
    choose_from_menu(robot, "Second", "update")
    robot.click_widget("choice:0")
    assert "jawOpen" not in read_pose(folder / "second.json").weights
    choose_from_menu(robot, "Second", "delete")
    robot.click_widget("choice:1")
    assert (folder / "second.json").exists()
    choose_from_menu(robot, "Second", "delete")
    robot.click_widget("choice:0")
    assert list(folder.iterdir()) == []


def test_what_comes_with_the_program_stays(robot: Robot) -> None:
    robot.click(robot.app.widget_rects.center("pose:Happiness"), "right")
    robot.frames(2)
    assert "pose-menu:flip" in robot.app.widget_rects
    assert "pose-menu:delete" not in robot.app.widget_rects


def test_the_filter_and_the_categories_choose_what_is_shown(robot: Robot) -> None:
    poses = feature(robot)
    assert len(poses.shown()) == 20
    robot.click_widget("poses:category:1")
    assert poses.shown()[0].title == "Happiness"
    assert len(poses.shown()) == 7
    robot.click_widget("poses:category:2")
    assert len(poses.shown()) == 13
    robot.click_widget("poses:filter")
    robot.type("lips closed")
    assert [entry.title for entry in poses.shown()] == ["M B P"]


def test_files_that_cannot_be_used_are_shown_and_harm_nothing(robot: Robot, tmp_path: Path) -> None:
    folder = tmp_path / "poses"
    folder.mkdir()
    (folder / "broken.json").write_text("{")
    write_pose(folder / "goblin.json", Pose("Goblin's", {"mouth 1": 1.0}, "creature"))
    (folder / "goblin.png").write_bytes(b"no picture")
    robot.click_widget("poses:category:3")
    robot.frames(4)
    for name in ("broken.json", "Goblin's"):
        robot.click_widget(f"pose:{name}")
        assert not robot.app.session.can_undo
    assert not robot.app.dialogs.open
    choose_from_menu(robot, "broken.json", "delete")
    robot.click_widget("choice:0")
    assert not (folder / "broken.json").exists()


def test_pictures_come_one_by_one_and_are_of_the_face_that_is_shown(robot: Robot) -> None:
    portraits = feature(robot).portraits
    app = robot.app
    del vars(app.scene)["portrait"]
    app.features.session_changed()
    robot.frames(1)
    assert portraits.waiting
    before = app.scene.vertices.copy()
    robot.frames(20)
    assert not portraits.waiting
    np.testing.assert_array_equal(app.scene.vertices, before)
    smile, neutral = (portraits.draw(p, 64).astype(float) for p in (_smile(app), _neutral(app)))
    assert np.abs(smile - neutral).max() > 40.0
    assert smile.mean() > 30.0


def _smile(app: App) -> Array:
    return app.session.model.coefficients_of({"mouthSmileLeft": 1.0, "mouthSmileRight": 1.0})


def _neutral(app: App) -> Array:
    return app.session.model.neutral()


def test_another_face_has_its_own_poses(robot: Robot) -> None:
    robot.click_widget("pose:Happiness")
    robot.key("Ctrl+Z")
    robot.app.files.open("creature")
    robot.frames(3)
    assert feature(robot).applied_pose is None
    robot.click_widget("pose:Happiness")
    vertex = robot.app.session.model.character.feature_points[LEFT_CORNER]
    risen = robot.app.scene.vertices[vertex, 1] - robot.app.session.model.character.vertices[vertex, 1]
    assert risen > 0.3
