"""Key poses in the window, driven by pointer and keys."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from faceposer.animation.keyframes import Keyframes
from faceposer.geometry.obj_io import write_obj
from faceposer.geometry.picture_view import PictureView
from faceposer.gui.features.keys.feature import KeysFeature
from faceposer.gui.features.photo.feature import PhotoFeature
from faceposer.gui.features.timeline.feature import TimelineFeature
from faceposer.gui.features.transfer.feature import TransferFeature
from faceposer.gui.testing.scripted_user import Robot
from faceposer.model.performance import Performance
from faceposer.poses.pose_file import read_pose
from faceposer.session.key_proposals import PROPOSED, create_keys
from faceposer.session.key_set import KeySet
from tests.windows import OpenWindow

pytestmark = pytest.mark.gl


@pytest.fixture(scope="module")
def original(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Keys of the low head and the goblin: its feelings, and three visemes."""
    folder = tmp_path_factory.mktemp("keys") / "low-creature"
    keys = create_keys(folder, "low", "creature")
    for entry in keys.entries():
        if keys.kinds().get(entry.name) == "viseme" and entry.name not in ("ah", "oh", "m-b-p"):
            keys.remove(entry.name)
    return folder


@pytest.fixture
def folder(original: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(original, tmp_path / "keys"))


@pytest.fixture
def robot(open_window: OpenWindow, folder: Path) -> Robot:
    robot = open_window("low", (1300, 900), keys_folder=str(folder))
    robot.click_widget("menu:Animate")
    robot.click_widget("menu:key-poses")
    finish(robot)
    return robot


def feature(robot: Robot) -> KeysFeature:
    return robot.app.features[KeysFeature]


def finish(robot: Robot) -> None:
    """Wait for the work in the background, and for its effects."""
    state = feature(robot)
    for _ in range(3):
        state.join()
        robot.frames(3)


def keys_of(robot: Robot) -> KeySet:
    keys = feature(robot).opened.keys
    assert keys is not None
    assert keys.transfer is not None
    return keys


def pose(robot: Robot, **weights: float) -> None:
    session = robot.app.session
    with session.edit("Pose"):
        session.set_start(session.model.coefficients_of(weights))
    robot.frames(2)


def clone_of(robot: Robot, name: str) -> "np.ndarray":
    """Return the clone of the source's side of the key ``name``."""
    keys = keys_of(robot)
    key = keys.key(name)
    assert keys.transfer is not None
    assert key is not None
    assert key.poses["source"] is not None
    return keys.transfer.pose(key.poses["source"])


def choose_from_menu(robot: Robot, widget: str, item: str) -> None:
    robot.click(robot.app.widget_rects.center(widget), "right")
    robot.frames(2)
    robot.click_widget(f"key-menu:{item}")


def test_an_edited_key_changes_the_clone_and_the_session_comes_back(robot: Robot, folder: Path) -> None:
    pose(robot, mouthSmileLeft=0.5, mouthSmileRight=0.5)
    before, pair = robot.app.session, folder / "target" / "happiness.json"
    old, clone = read_pose(pair), clone_of(robot, "happiness")
    view = robot.app.viewport.view = robot.app.viewport.view.looking("three-quarter")
    robot.click_widget("key:happiness:target")
    robot.frames(2)
    app = robot.app
    assert not app.dialogs.open, "the session is put aside, and nothing is lost"
    assert app.session.model.character.name == "creature"
    edited = feature(robot).editing.edited
    assert edited is not None
    assert (edited.name, edited.side) == ("happiness", "target")
    np.testing.assert_allclose(app.session.coefficients, clone, atol=1e-6)

    x, y = robot.at("8.3")
    robot.drag((x, y), (x + 8, y - 22))
    assert feature(robot).editing.changed
    robot.key("Ctrl+S")
    finish(robot)
    assert not robot.app.session.dirty
    assert not robot.app.dialogs.open, "the key is saved, not a session"
    assert read_pose(pair).name == old.name
    assert read_pose(pair).tags == old.tags
    changed = clone_of(robot, "happiness")
    np.testing.assert_allclose(changed, app.session.coefficients, atol=1e-4)
    assert np.abs(changed - clone).max() > 0.01

    robot.click_widget("keys-back")
    robot.frames(2)
    assert app.session is before
    assert app.session.dirty
    assert app.viewport.view == view
    robot.key("Ctrl+Z")
    np.testing.assert_array_equal(app.session.coefficients, app.session.model.neutral())


def test_changes_of_a_key_are_not_lost_without_a_question(robot: Robot, folder: Path) -> None:
    pair = folder / "target" / "anger.json"
    written = pair.read_bytes()
    robot.click_widget("key:anger:target")
    x, y = robot.at("8.3")
    robot.drag((x, y), (x + 8, y - 22))
    robot.click_widget("key:fear:target")
    assert "Save the key" in robot.app.dialogs.waiting[0].title
    robot.key("Esc")
    robot.frames(2)
    assert feature(robot).editing.edited is not None
    assert pair.read_bytes() == written
    robot.click_widget("key:fear:target")
    robot.click_widget("choice:0")
    finish(robot)
    edited = feature(robot).editing.edited
    assert edited is not None
    assert edited.name == "fear"
    assert pair.read_bytes() != written


def test_the_present_pose_becomes_a_key_with_a_proposal(robot: Robot, folder: Path) -> None:
    pose(robot, jawOpen=0.6, mouthSmileLeft=0.7)
    robot.click_widget("keys-add")
    robot.key("Ctrl+A")
    robot.type("Crooked")
    robot.click_widget("keys-add:kind:1")
    robot.click_widget("keys-add:accept")
    finish(robot)
    assert read_pose(folder / "source" / "crooked.json").weights["jawOpen"] == pytest.approx(0.6, abs=0.05)
    assert PROPOSED in read_pose(folder / "target" / "crooked.json").tags
    key = keys_of(robot).key("crooked")
    assert key is not None
    assert key.proposed
    assert key.kind == "viseme"


def test_a_taken_name_is_told_before_it_replaces_a_key(robot: Robot, folder: Path) -> None:
    before = (folder / "source" / "fear.json").read_bytes()
    pose(robot, jawOpen=0.6, mouthSmileLeft=0.7)
    robot.click_widget("keys-add")
    robot.key("Ctrl+A")
    robot.type("fear")
    robot.frames(2)
    assert feature(robot).adding.replaced == "Fear"
    robot.key("Esc")
    robot.frames(2)
    assert not robot.app.is_modal
    assert (folder / "source" / "fear.json").read_bytes() == before
    robot.click_widget("keys-add")
    robot.key("Ctrl+A")
    robot.type("fear")
    robot.key("Enter")
    finish(robot)
    assert read_pose(folder / "source" / "fear.json").weights["jawOpen"] == pytest.approx(0.6, abs=0.05)
    assert keys_of(robot).key("fear").kind == "expression"  # type: ignore[union-attr]


def test_the_list_scrolls_to_an_added_key_and_its_kind_can_change(robot: Robot) -> None:
    robot.click_widget("keys-compose")
    finish(robot)
    assert keys_of(robot).key("anger+ah").title == "Anger + AH"  # type: ignore[union-attr]
    pose(robot, jawOpen=0.2, cheekPuff=0.7)
    robot.click_widget("keys-add")
    robot.key("Ctrl+A")
    robot.type("Puffed")
    robot.click_widget("keys-add:kind:2")
    robot.click_widget("keys-add:accept")
    finish(robot)
    robot.frames(3)
    _, top, _, bottom = robot.app.widget_rects["key:puffed:target"]
    _, _, _, last = robot.app.widget_rects["view"]
    assert top > last - 1.0, "in the strip below the view"
    assert bottom < robot.app.window.size[1]
    choose_from_menu(robot, "key:puffed:target", "kind:viseme")
    finish(robot)
    assert keys_of(robot).key("puffed").kind == "viseme"  # type: ignore[union-attr]


def test_leaving_a_key_for_another_session_asks_about_both(robot: Robot, folder: Path) -> None:
    app = robot.app
    pose(robot, mouthSmileLeft=0.5, mouthSmileRight=0.5)
    before, written = app.session, (folder / "target" / "anger.json").read_bytes()
    robot.click_widget("key:anger:target")
    robot.frames(2)
    x, y = robot.at("8.3")
    robot.drag((x, y), (x + 8, y - 22))
    app.files.open("low")
    robot.frames(2)
    assert "Save the key pose" in app.dialogs.waiting[0].title
    robot.click_widget("choice:1")
    robot.frames(2)
    assert app.session is before
    assert app.dialogs.waiting[0].title == "Save the session?"
    robot.key("Esc")
    robot.frames(2)
    assert app.session is before
    assert app.session.dirty
    assert (folder / "target" / "anger.json").read_bytes() == written


def test_sides_are_replaced_proposed_and_removed_by_the_menu(robot: Robot, folder: Path) -> None:
    pose(robot, jawOpen=0.3, browInnerUp=0.9)
    choose_from_menu(robot, "key:surprise:source", "replace-source")
    robot.click_widget("choice:0")
    finish(robot)
    assert read_pose(folder / "source" / "surprise.json").weights["jawOpen"] == pytest.approx(0.3, abs=0.05)
    before = clone_of(robot, "surprise")
    choose_from_menu(robot, "key:surprise:target", "propose")
    robot.click_widget("choice:0")
    finish(robot)
    assert np.abs(clone_of(robot, "surprise") - before).max() > 0.01
    assert PROPOSED in read_pose(folder / "target" / "surprise.json").tags
    choose_from_menu(robot, "key:surprise:target", "remove")
    robot.click_widget("choice:1")
    assert keys_of(robot).key("surprise") is not None
    choose_from_menu(robot, "key:surprise:target", "remove")
    robot.click_widget("choice:0")
    finish(robot)
    assert keys_of(robot).key("surprise") is None
    assert not (folder / "source" / "surprise.json").exists()


def test_a_key_is_renamed_by_the_menu_while_it_is_edited(robot: Robot, folder: Path) -> None:
    robot.click_widget("key:surprise:target")
    finish(robot)
    choose_from_menu(robot, "key:surprise:source", "rename")
    robot.key("Ctrl+A")
    robot.type("anger")
    robot.key("Enter")
    robot.frames(2)
    assert feature(robot).naming.open, "the name is taken, and can be corrected"
    robot.key("Ctrl+A")
    robot.type("Astonished")
    robot.key("Enter")
    finish(robot)
    assert not feature(robot).naming.open
    assert read_pose(folder / "source" / "astonished.json").name == "Astonished"
    assert keys_of(robot).key("surprise") is None
    shape = robot.app.session.model.character.shape_names[0]
    pose(robot, **{shape: 0.2})
    robot.key("Ctrl+S")
    finish(robot)
    saved = read_pose(folder / "target" / "astonished.json")
    assert (saved.name, saved.weights[shape]) == ("Astonished", pytest.approx(0.2, abs=0.05))


def test_all_combinations_are_composed(robot: Robot) -> None:
    robot.click_widget("keys-compose")
    finish(robot)
    keys = keys_of(robot)
    assert len(keys.keys) == 5 + 3 + 15
    robot.click_widget("keys:menu")
    robot.click_widget("keys:kind:composed")
    assert {key.kind for key in feature(robot).listed()} == {"composed"}
    robot.frames(2)
    assert "key:anger+ah:target" in robot.app.widget_rects


def test_the_animation_is_covered_and_the_best_frame_shown(robot: Robot) -> None:
    app, model = robot.app, robot.app.session.model
    poses = np.zeros((40, model.n_coefficients))
    smile = keys_of(robot).key("happiness")
    assert smile is not None
    assert smile.poses["source"] is not None
    poses[:] = np.linspace(0.0, 1.0, 40)[:, None] * smile.poses["source"]
    poses[27] = model.coefficients_of({"cheekPuff": 1.0, "noseSneerLeft": 1.0})
    app.feature(TimelineFeature).change(Keyframes.of_performance(Performance(poses, 30.0)), "Take")
    robot.frames(2)
    covered = feature(robot).covering.of_animation(keys_of(robot))
    assert covered is not None
    assert covered.best == 27
    assert covered.distances[27] > covered.limit
    assert np.delete(covered.distances, 27).max() < 0.1 * covered.limit
    robot.click_widget("keys:best")
    assert app.session.animation.frame == 27
    # The frames are below those of the timeline.
    _, top, _, bottom = app.widget_rects["keys:coverage"]
    track = app.features[TimelineFeature].track
    robot.click((track.x_of(10), 0.5 * (top + bottom)))
    assert app.session.animation.frame == 10
    track._set_visible_range(5.0, 20.0, 0.0)
    robot.frames(2)
    robot.click((track.x_of(18), 0.5 * (top + bottom)))
    assert app.session.animation.frame == 18

    # As a key, the frame is covered.
    robot.click_widget("keys:best")
    robot.click_widget("keys-add")
    robot.click_widget("keys-add:accept")
    finish(robot)
    covered = feature(robot).covering.of_animation(keys_of(robot))
    assert covered is not None
    assert covered.distances[27] < 0.1 * covered.limit


def test_a_folder_that_is_gone_is_told_with_a_remedy(robot: Robot, folder: Path) -> None:
    robot.click_widget("key:anger:target")
    robot.frames(2)
    shutil.rmtree(folder)
    robot.key("Ctrl+S")
    finish(robot)
    assert "put it back, or choose another folder" in robot.app.dialogs.waiting[0].text
    robot.key("Enter")
    feature(robot).opened.read()
    finish(robot)
    error = feature(robot).opened.error
    assert "choose or create another folder of key poses" in error
    assert "keys init" not in error


def test_keys_that_are_meshes_are_not_edited_here(robot: Robot, folder: Path) -> None:
    model = keys_of(robot).models["target"]
    assert model is not None
    (folder / "target" / "fear.json").unlink()
    write_obj(folder / "target" / "fear.obj", model.character.vertices * 1.01, model.character.polygons)
    feature(robot).opened.read()
    finish(robot)
    robot.click_widget("key:fear:target")
    assert "change it in the program in which it was sculpted" in robot.app.dialogs.waiting[0].text
    robot.key("Enter")
    assert robot.app.session.model.character.name == "low"


def test_the_status_bar_names_the_edited_key_while_the_strip_is_hidden(robot: Robot) -> None:
    robot.click_widget("key:anger:target")
    robot.frames(2)
    assert robot.app.edited_instead == "", "the strip says it"
    robot.click_widget("keys:close")
    robot.frames(2)
    assert robot.app.edited_instead == "Editing the target of Anger"
    assert "status:edited" in robot.app.widget_rects
    robot.click_widget("menu:Animate")
    robot.click_widget("menu:key-poses")
    robot.click_widget("keys-back")
    robot.click_widget("keys:close")
    robot.frames(2)
    assert "status:edited" not in robot.app.widget_rects


def test_an_edited_key_keeps_its_head(open_window: OpenWindow, tmp_path: Path) -> None:
    poses = tmp_path / "poses"
    poses.mkdir()
    data = {"format": "faceposer.pose", "version": 1, "name": "Open", "weights": {"jawOpen": 0.8}}
    (poses / "open.json").write_text(json.dumps(data))
    create_keys(tmp_path / "keys", "man", "low", poses)
    robot = open_window("man", (1300, 900), keys_folder=str(tmp_path / "keys"))
    app = robot.app
    assert app.actions["head-random"].enabled()
    robot.click_widget("menu:Animate")
    robot.click_widget("menu:key-poses")
    finish(robot)
    robot.click_widget("key:open:source")
    robot.frames(2)
    assert feature(robot).editing.edited is not None
    for name in ("head-random", "head-average", "head-original", "head-variations", "head-save", "tool-head"):
        assert not app.actions[name].enabled(), name
    robot.click_widget("tab:Head")
    robot.frames(3)
    assert not [name for name in app.widget_rects if name.startswith("head:")]
    app.toolbox.choose("head")
    x, y = robot.at("8.3")
    robot.drag((x, y), (x + 20, y + 20))
    assert app.session.document.identity is None
    assert "cannot be changed while a key pose is edited" in app.notice
    robot.click_widget("keys-back")
    robot.frames(2)
    assert app.actions["head-random"].enabled()
    assert app.actions["tool-head"].enabled()


def test_importance_is_shown_on_the_face(robot: Robot) -> None:
    robot.click_widget("keys:menu")
    robot.click_widget("menu:keys-importance-source")
    finish(robot)
    picture = feature(robot).importance.picture
    assert picture is not None
    assert "keys-importance:picture" in robot.app.widget_rects
    # By the verbal keys, the mouth is brighter than the brows.
    size = len(picture)
    assert picture[int(0.7 * size), size // 2].mean() > picture[int(0.25 * size), size // 2].mean() + 40.0
    robot.key("Esc")
    assert not robot.app.is_modal


def test_files_changed_by_others_change_the_clone_and_broken_ones_are_told(robot: Robot, folder: Path) -> None:
    path = folder / "target" / "fear.json"
    before = clone_of(robot, "fear")
    data = json.loads(path.read_text())
    data["weights"] = {name: 0.5 * value for name, value in data["weights"].items()}
    path.write_text(json.dumps(data))
    robot.frames(70)
    finish(robot)
    assert np.abs(clone_of(robot, "fear") - before).max() > 0.05
    path.write_text("{")
    robot.frames(70)
    finish(robot)
    keys = feature(robot).opened.keys
    assert keys is not None
    assert keys.transfer is not None
    assert "fear" not in {pair.name for pair in keys.transfer.pairs}
    assert str(path) in keys.left_out[0].problem
    assert feature(robot).kind == ""
    feature(robot).kind = "viseme"
    robot.click_widget("keys:left-out")
    robot.frames(4)
    assert (feature(robot).kind, feature(robot).latest) == ("", "fear")
    assert "key:fear:target" in robot.app.widget_rects
    shutil.rmtree(folder)
    robot.frames(70)
    finish(robot)
    assert "There is no folder" in feature(robot).opened.error


def test_a_new_folder_is_made_for_the_chosen_target(robot: Robot, tmp_path: Path) -> None:
    robot.click_widget("keys:menu")
    robot.click_widget("menu:keys-new")
    robot.click_widget("keys-new:to")
    robot.click_widget("keys-new:to:creature")
    robot.click_widget("keys-new:create")
    assert robot.app.file_dialogs.open
    robot.key("Enter")
    finish(robot)
    assert feature(robot).opened.folder == tmp_path / "low-poly-head-goblin-keys"
    assert len(keys_of(robot).keys) == 18


def test_an_expression_is_transferred_by_examples(robot: Robot) -> None:
    app = robot.app
    pose(robot, mouthSmileLeft=0.6, mouthSmileRight=0.6)
    robot.click_widget("menu:Edit")
    robot.click_widget("menu:transfer")
    state = app.features[TransferFeature]
    robot.click_widget("transfer:to")
    robot.click_widget("transfer:to:creature")
    robot.click_widget("transfer:method:2")
    robot.frames(2)
    assert state.error == ""
    assert "mm from the key poses" in state.reach[0]
    whole = state.result
    transfer = keys_of(robot).transfer
    assert transfer is not None
    assert whole is not None
    np.testing.assert_allclose(whole, transfer.pose(app.session.coefficients), atol=1e-9)
    robot.click_widget("transfer:regions:1")
    finish(robot)
    assert keys_of(robot).folder.regions == "halves"
    assert state.result is not None
    assert np.abs(state.result - whole).max() > 1e-3
    robot.click_widget("transfer:open")
    robot.click_widget("choice:1")
    robot.frames(2)
    assert app.session.model.character.name == "creature"


def test_keys_of_another_target_are_refused_and_poses_outside_told(robot: Robot) -> None:
    pose(robot, cheekPuff=1.0, noseSneerLeft=1.0, mouthLeft=1.0)
    state = robot.app.features[TransferFeature]
    robot.app.actions["transfer"].run()
    assert state.to != "creature"
    # That of the open key poses is chosen, until the user chooses one.
    state.choose_method("examples")
    robot.frames(3)
    assert state.to == "creature"
    assert state.error == ""
    assert "outside the keys" in state.reach[1]
    state.choose_target("woman")
    robot.frames(3)
    assert state.to == "woman", "the target does not change by itself"
    assert state.error == "These key poses are for Goblin, not for Woman."
    assert state.result is None
    robot.click_widget("transfer:keys:target")
    robot.frames(3)
    assert state.to == "creature"
    assert state.result is not None
    robot.click_widget("transfer:open")
    robot.frames(2)
    robot.key("Esc")
    robot.frames(3)
    assert state.open, "a question that is cancelled leaves the dialog"
    assert robot.app.session.model.character.name == "low"
    robot.key("Esc")


def test_back_returns_to_the_photo_as_it_was_shown(robot: Robot, tmp_path: Path) -> None:
    app = robot.app
    photos, path = app.features[PhotoFeature], tmp_path / "face.png"
    Image.fromarray(np.full((300, 400, 3), 120, dtype=np.uint8)).save(path)
    photos.open(path)
    robot.frames(2)
    app.viewport.view = view = app.viewport.view.zoomed(2.0)
    robot.frames(2)
    robot.click_widget("key:anger:target")
    robot.frames(3)
    assert not isinstance(app.viewport.view, PictureView)
    robot.click_widget("keys-back")
    robot.frames(3)
    assert app.viewport.view == view
    assert photos.aligned


def test_the_session_that_is_put_aside_outlives_the_program(
    open_window: OpenWindow, folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    robot = open_window("low", (1300, 900), journal=True, keys_folder=str(folder))
    robot.app.actions["key-poses"].run()
    finish(robot)
    pose(robot, mouthSmileLeft=0.5, mouthSmileRight=0.5)
    before = robot.app.session.coefficients
    robot.click_widget("key:anger:target")
    robot.frames(40)
    robot.app.close()

    other = open_window("low", journal=True)
    other.frames(2)
    assert other.app.dialogs.waiting[0].title == "Recover the unsaved session with 'low'?"
    other.click_widget("choice:0")
    other.frames(2)
    np.testing.assert_allclose(other.app.session.coefficients, before, atol=1e-9)


def test_narrow_strips_show_the_clone_beside_two_pairs(open_window: OpenWindow, folder: Path) -> None:
    robot = open_window("low", (1280, 720), keys_folder=str(folder), ui_scale=1.5)
    robot.app.actions["key-poses"].run()
    finish(robot)
    pose(robot, jawOpen=0.4)
    robot.frames(3)
    rects, panel = robot.app.widget_rects, feature(robot)
    (left, top), (_, beside) = (rects.center(f"key:{name}:source") for name in ("anger", "fear"))
    assert top == beside
    assert rects.center("keys:present")[0] < rects.center("keys:clone")[0] < left
    assert rects.center("keys:distance")[1] < robot.app.window.size[1]
    assert "keys-compose" not in rects
    take = np.outer(
        np.linspace(0.0, 1.0, 20), robot.app.session.model.coefficients_of({"cheekPuff": 1.0, "mouthLeft": 1.0})
    )
    robot.app.feature(TimelineFeature).change(Keyframes.of_performance(Performance(take, 30.0)), "Take")
    finish(robot)
    covered = panel.covering.of_animation(keys_of(robot))
    assert covered is not None
    assert panel.covering.summary(covered).endswith(" % missed")
    robot.click_widget("keys:best")
    robot.frames(2)
    assert robot.app.session.animation.frame == covered.best


def test_a_replacement_that_is_another_key_is_refused(robot: Robot, folder: Path) -> None:
    written = (folder / "source" / "fear.json").read_bytes()
    choose_from_menu(robot, "key:fear:source", "replace-source")
    robot.click_widget("choice:0")
    finish(robot)
    assert "is the neutral face of the source" in robot.app.dialogs.waiting[0].text
    assert (folder / "source" / "fear.json").read_bytes() == written
    assert not keys_of(robot).left_out
