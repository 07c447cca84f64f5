"""Key poses in the window while their files change, fail or are too many."""

import shutil
from pathlib import Path

import numpy as np
import pytest

from faceposer.animation.keyframes import Keyframes
from faceposer.geometry.obj_io import write_obj
from faceposer.gui.features.keys import commands, covering, open_keys
from faceposer.gui.features.keys.feature import KeysFeature
from faceposer.gui.features.keys.work import TOO_LARGE
from faceposer.gui.features.timeline.feature import TimelineFeature
from faceposer.gui.features.transfer import feature as transfer_feature
from faceposer.gui.features.transfer.feature import TransferFeature
from faceposer.gui.testing.scripted_user import Robot
from faceposer.model.character_file import save_character
from faceposer.model.face_model import FaceModel
from faceposer.model.performance import Performance
from faceposer.poses.pose_file import Pose, read_pose, write_pose
from faceposer.session.key_folder import KeyFolder
from faceposer.session.key_proposals import PROPOSED
from tests.rigs import with_fewer_shapes
from tests.windows import OpenWindow

pytestmark = pytest.mark.gl

OPEN, SMILE = {"jawOpen": 0.8}, {"eyeBlinkLeft": 0.9, "browDownLeft": 0.9}


def make_keys(folder: Path, source: str, target: str) -> KeyFolder:
    keys = KeyFolder(folder, source, target)
    keys.write()
    for name, weights in (("Open", OPEN), ("Wink", SMILE)):
        keys.add(Pose(name, weights), Pose(name, weights))
    return keys


@pytest.fixture
def keys(tmp_path: Path) -> KeyFolder:
    return make_keys(tmp_path / "keys", "low", "low")


def show(open_window: OpenWindow, keys: KeyFolder, what: str = "low") -> Robot:
    robot = open_window(what, (1300, 900), keys_folder=str(keys.folder))
    robot.app.actions["key-poses"].run()
    finish(robot)
    return robot


def feature(robot: Robot) -> KeysFeature:
    return robot.app.features[KeysFeature]


def finish(robot: Robot) -> None:
    """Wait for the work in the background, and for its effects."""
    for _ in range(3):
        feature(robot).join()
        robot.frames(3)


def choose_from_menu(robot: Robot, widget: str, item: str) -> None:
    robot.click(robot.app.widget_rects.center(widget), "right")
    robot.frames(2)
    robot.click_widget(f"key-menu:{item}")
    robot.frames(2)


def test_keys_of_another_character_of_the_same_name_are_not_those_of_the_open_one(
    open_window: OpenWindow, tmp_path: Path, low: FaceModel
) -> None:
    for name, count in (("a", 54), ("b", 30)):
        (tmp_path / name).mkdir()
        save_character(tmp_path / name / "me.npz", with_fewer_shapes(low.character, count))
    keys = make_keys(tmp_path / "keys", "../a/me.npz", "../a/me.npz")
    robot = show(open_window, keys, str(tmp_path / "b" / "me.npz"))
    state = feature(robot)
    assert state.opened.transferable is not None
    assert state.present_pose() is None
    assert not robot.app.actions["keys-add"].enabled()
    robot.app.actions["transfer"].run()
    transfer = robot.app.features[TransferFeature]
    transfer.choose_file(tmp_path / "a" / "me.npz")
    transfer.choose_method("examples")
    robot.frames(3)
    assert transfer.result is None
    assert "me" in transfer.error.lower()


def test_a_character_made_anew_is_read_anew(open_window: OpenWindow, tmp_path: Path, low: FaceModel) -> None:
    mine = tmp_path / "me.npz"
    save_character(mine, with_fewer_shapes(low.character, 54))
    keys = make_keys(tmp_path / "keys", "low", "../me.npz")
    robot = show(open_window, keys)
    app = robot.app
    app.actions["transfer"].run()
    transfer = app.features[TransferFeature]
    transfer.choose_file(mine)
    transfer.choose_method("examples")
    robot.frames(3)
    assert transfer.result is not None
    first = transfer.target
    save_character(mine, with_fewer_shapes(low.character, 30))
    # The pose changes before the keys are read again.
    session = app.session
    with session.edit("Pose"):
        session.set_start(session.model.coefficients_of(OPEN))
    robot.frames(3)
    assert transfer.result is not None
    assert transfer.target is first
    robot.frames(70)
    finish(robot)
    assert transfer.target is not None
    assert len(transfer.target.character.shape_names) == 30
    # And once more, before the result is opened.
    save_character(mine, with_fewer_shapes(low.character, 40))
    transfer.accept()
    robot.frames(2)
    robot.click_widget("choice:1")
    robot.frames(2)
    model = app.session.model
    assert len(model.character.shape_names) == 40
    jaw = model.weights_of(app.session.coefficients)[model.character.shape_names.index("jawOpen")]
    assert jaw == pytest.approx(0.8, abs=0.05)


def test_a_key_opens_on_its_character_as_it_is_now(open_window: OpenWindow, tmp_path: Path, low: FaceModel) -> None:
    mine = tmp_path / "me.npz"
    save_character(mine, with_fewer_shapes(low.character, 54))
    robot = show(open_window, make_keys(tmp_path / "keys", "low", "../me.npz"))
    save_character(mine, with_fewer_shapes(low.character, 30))
    robot.click_widget("key:open:target")
    assert "has changed; try again" in robot.app.dialogs.waiting[0].text
    robot.key("Enter")
    robot.frames(70)
    finish(robot)
    robot.click_widget("key:open:target")
    robot.frames(2)
    assert len(robot.app.session.model.character.shape_names) == 30


def test_poses_of_the_artist_are_not_replaced_without_a_question(open_window: OpenWindow, keys: KeyFolder) -> None:
    robot = show(open_window, keys)
    path = keys.folder / "target" / "wink.json"
    written = path.read_bytes()
    for item in ("propose", "replace-target"):
        choose_from_menu(robot, "key:wink:target", item)
        assert robot.app.dialogs.waiting[0].title.startswith("Replace the target of Wink?")
        robot.key("Esc")
        finish(robot)
        assert path.read_bytes() == written
    choose_from_menu(robot, "key:wink:target", "propose")
    robot.click_widget("choice:0")
    finish(robot)
    assert PROPOSED in read_pose(path).tags
    # A proposal is nobody's work.
    choose_from_menu(robot, "key:wink:target", "replace-target")
    finish(robot)
    assert not robot.app.dialogs.open
    assert read_pose(path).tags == ()


def test_a_mended_folder_is_read_again(open_window: OpenWindow, keys: KeyFolder, tmp_path: Path) -> None:
    robot, description = show(open_window, keys), keys.folder / "keys.json"
    written = description.read_text()
    description.write_text("{")
    robot.frames(70)
    finish(robot)
    assert feature(robot).opened.keys is None
    assert "keys.json" in feature(robot).opened.error
    description.write_text(written)
    robot.frames(70)
    finish(robot)
    assert feature(robot).opened.error == ""
    assert feature(robot).opened.transferable is not None
    keys.folder.rename(tmp_path / "away")
    robot.frames(70)
    finish(robot)
    assert feature(robot).opened.error
    shutil.move(tmp_path / "away", keys.folder)
    robot.frames(70)
    finish(robot)
    assert feature(robot).opened.transferable is not None


def test_a_lack_of_memory_is_told(open_window: OpenWindow, keys: KeyFolder, monkeypatch: pytest.MonkeyPatch) -> None:
    robot = show(open_window, keys)

    def full(*_: object, **__: object) -> None:
        raise MemoryError

    monkeypatch.setattr(commands, "compose_keys", full)
    robot.app.actions["keys-compose"].run()
    finish(robot)
    assert robot.app.dialogs.waiting[0].text == f"There is not enough memory; {TOO_LARGE}"
    robot.key("Enter")
    monkeypatch.setattr(open_keys, "read_key_set", full)
    feature(robot).opened.read()
    finish(robot)
    assert feature(robot).opened.error == f"There is not enough memory; {TOO_LARGE}"


def test_the_dialog_of_transfer_comes_back_after_new_keys_failed(
    open_window: OpenWindow, keys: KeyFolder, monkeypatch: pytest.MonkeyPatch
) -> None:
    robot = show(open_window, keys)
    transfer = robot.app.features[TransferFeature]
    robot.app.actions["transfer"].run()
    transfer.choose_method("examples")
    robot.frames(2)
    transfer.new_keys()
    robot.frames(2)
    assert not transfer.open

    def full(*_: object, **__: object) -> None:
        raise MemoryError

    monkeypatch.setattr(commands, "create_keys", full)
    robot.key("Enter")
    assert robot.app.file_dialogs.open
    robot.key("Enter")
    finish(robot)
    assert robot.app.dialogs.waiting[0].text == f"There is not enough memory; {TOO_LARGE}"
    robot.key("Enter")
    robot.frames(2)
    assert transfer.open


def test_a_closed_dialog_transfers_nothing(
    open_window: OpenWindow, keys: KeyFolder, monkeypatch: pytest.MonkeyPatch
) -> None:
    robot = show(open_window, keys)
    transfer, session = robot.app.features[TransferFeature], robot.app.session
    made: list[object] = []
    make = transfer_feature.make_transfer
    monkeypatch.setattr(transfer_feature, "make_transfer", lambda *inputs: (made.append(inputs), make(*inputs))[1])
    robot.app.actions["transfer"].run()
    robot.frames(2)
    assert len(made) == 1
    robot.key("Esc")
    with session.edit("Pose"):
        session.set_start(session.model.coefficients_of(OPEN))
    robot.frames(3)
    assert len(made) == 1
    assert transfer._scenes is None


def test_pictures_take_memory_only_while_they_are_shown(open_window: OpenWindow, keys: KeyFolder) -> None:
    robot = show(open_window, keys)
    faces = feature(robot).faces
    robot.frames(6)
    assert faces._scenes
    robot.click_widget("keys:close")
    robot.frames(3)
    assert not faces._scenes
    assert not any(portraits._textures for portraits in faces._portraits.values())
    robot.app.actions["key-poses"].run()
    robot.frames(10)
    assert not faces.waiting
    assert all(portraits._textures for portraits in faces._portraits.values())


def test_long_animations_are_covered_in_the_background(
    open_window: OpenWindow, keys: KeyFolder, monkeypatch: pytest.MonkeyPatch
) -> None:
    robot = show(open_window, keys)
    app, model, state = robot.app, robot.app.session.model, feature(robot)
    poses = np.zeros((40, model.n_coefficients))
    poses[27] = model.coefficients_of({"cheekPuff": 1.0})
    monkeypatch.setattr(covering, "_AT_ONCE", 0)
    opened = state.opened.keys
    assert opened is not None

    def play(poses: np.ndarray) -> None:
        app.feature(TimelineFeature).change(Keyframes.of_performance(Performance(poses, 30.0)), "Take")

    play(poses)
    finish(robot)
    covered = state.covering.of_animation(opened)
    assert covered is not None
    assert covered.best == 27
    play(np.roll(poses, 4, axis=0))
    # The coverage before the edit is shown meanwhile.
    assert state.covering.of_animation(opened) is covered
    finish(robot)
    covered = state.covering.of_animation(opened)
    assert covered is not None
    assert covered.best == 31
    assert not state.covering.busy

    def full(*_: object, **__: object) -> None:
        raise MemoryError

    monkeypatch.setattr(covering, "coverage", full)
    play(np.roll(poses, 6, axis=0))
    finish(robot)
    assert state.covering.of_animation(opened) is None


def test_a_combination_that_was_edited_stays(open_window: OpenWindow, keys: KeyFolder) -> None:
    for name, tag in (("open", "viseme"), ("wink", "expression")):
        path = keys.folder / "source" / f"{name}.json"
        write_pose(path, Pose(name.title(), read_pose(path).weights, tags=(tag,)))
    robot = show(open_window, keys)
    robot.app.actions["keys-compose"].run()
    finish(robot)
    path = keys.folder / "target" / "wink+open.json"
    robot.click_widget("key:wink+open:target")
    session = robot.app.session
    with session.edit("Pose"):
        session.set_start(session.model.coefficients_of({"mouthPucker": 1.0}))
    robot.key("Ctrl+S")
    finish(robot)
    written = path.read_bytes()
    assert b"mouthPucker" in written
    robot.app.actions["keys-compose"].run()
    finish(robot)
    assert path.read_bytes() == written


def test_a_sculpt_stays_when_its_source_is_replaced(open_window: OpenWindow, tmp_path: Path, low: FaceModel) -> None:
    write_obj(tmp_path / "head.obj", low.character.vertices, low.character.polygons)
    keys = make_keys(tmp_path / "keys", "low", "low")
    KeyFolder(keys.folder, "low", "../head.obj").write()
    for path in list((keys.folder / "target").iterdir()):
        path.unlink()
        moved = low.instance(low.coefficients_of(OPEN if path.stem == "open" else SMILE))
        write_obj(path.with_suffix(".obj"), moved, low.character.polygons)
    sculpt = keys.folder / "target" / "open.obj"
    written = sculpt.read_bytes()
    robot = show(open_window, keys)
    session = robot.app.session
    with session.edit("Pose"):
        session.set_start(session.model.coefficients_of({"jawOpen": 0.5}))
    robot.frames(2)
    robot.app.actions["keys-add"].run()
    robot.frames(2)
    robot.key("Ctrl+A")
    robot.type("Open")
    robot.frames(2)
    robot.key("Enter")
    finish(robot)
    assert read_pose(keys.folder / "source" / "open.json").weights["jawOpen"] == pytest.approx(0.5, abs=0.02)
    assert sculpt.read_bytes() == written
    assert feature(robot).opened.transferable is not None
