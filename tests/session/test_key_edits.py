"""Changes of single keys: what an artist made is never lost by a change that fails."""

import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from faceposer.errors import FacePoserError
from faceposer.geometry.mesh_io import read_mesh
from faceposer.geometry.obj_io import write_obj
from faceposer.model.face_model import FaceModel
from faceposer.poses.applying import pose_of
from faceposer.poses.pose_file import Pose, read_pose, write_pose
from faceposer.session.document import Document, write_document
from faceposer.session.key_edits import add_key, add_key_pose, choose_keys, propose_again, rename_key, save_key
from faceposer.session.key_folder import COMPOSED, KeyFolder
from faceposer.session.key_proposals import create_keys
from faceposer.session.key_set import read_key_set
from faceposer.session.keys import load_keys
from faceposer.transfer import keyed_model
from faceposer.transfer.examples import MOST_KEYS

OPEN, SMILE = {"jawOpen": 0.8}, {"mouthSmileLeft": 0.9, "mouthSmileRight": 0.9}


@pytest.fixture
def keys(tmp_path: Path) -> KeyFolder:
    """Two keys of the low head for itself."""
    folder = KeyFolder(tmp_path / "keys", "low", "low")
    folder.write()
    folder.add(Pose("Open", OPEN), Pose("Open", OPEN))
    folder.add(Pose("Smile", SMILE), Pose("Smile", SMILE))
    return folder


@pytest.fixture
def mesh_keys(tmp_path: Path, low: FaceModel) -> KeyFolder:
    """The same keys for the low head as a mesh without shapes."""
    write_obj(tmp_path / "head.obj", low.character.vertices, low.character.polygons)
    folder = KeyFolder(tmp_path / "keys", "low", "../head.obj")
    folder.write()
    for name, weights in (("Open", OPEN), ("Smile", SMILE)):
        folder.add(Pose(name, weights), None)
        moved = low.instance(low.coefficients_of(weights))
        write_obj(folder.folder / "target" / f"{name.lower()}.obj", moved, low.character.polygons)
    return folder


def content(folder: KeyFolder) -> dict[str, bytes]:
    return {str(path.relative_to(folder.folder)): path.read_bytes() for path in folder.folder.rglob("*.*")}


def write_source(tmp_path: Path, **weights: float) -> Path:
    path = tmp_path / "new.json"
    write_pose(path, Pose("New", weights))
    return path


def test_a_sculpt_of_the_folder_itself_may_replace_its_key(mesh_keys: KeyFolder, tmp_path: Path) -> None:
    sculpt = mesh_keys.folder / "target" / "smile.obj"
    written = sculpt.read_bytes()
    add_key(mesh_keys, "smile", write_source(tmp_path, mouthSmileLeft=0.5), sculpt, replaces=True)
    assert sculpt.read_bytes() == written
    assert read_pose(mesh_keys.folder / "source" / "smile.json").weights == {"mouthSmileLeft": 0.5}
    # A new pose of the source, too, leaves the sculpt.
    add_key_pose(mesh_keys, Pose("Smile", {"mouthSmileRight": 0.5}), replaces=True)
    assert sculpt.read_bytes() == written


def test_a_replaced_key_has_one_file_on_each_side(keys: KeyFolder, tmp_path: Path, low: FaceModel) -> None:
    sculpt = tmp_path / "sculpt.obj"
    write_obj(sculpt, low.instance(low.coefficients_of(OPEN)), low.character.polygons)
    old = keys.folder / "target" / "open.json"
    old.rename(old.with_suffix(".JSON"))
    (keys.folder / "source" / "open.json").rename(keys.folder / "source" / "open.JSON")
    add_key(keys, "Open", write_source(tmp_path, **OPEN), sculpt, replaces=True)
    entry = keys.entry("open")
    assert entry is not None
    assert entry.source == keys.folder / "source" / "open.JSON"
    assert entry.target == keys.folder / "target" / "open.obj"
    add_key(keys, "Open", write_source(tmp_path, **OPEN), replaces=True)
    assert [path.name for path in sorted((keys.folder / "target").iterdir())] == ["open.json", "smile.json"]


def test_a_key_stays_if_the_new_one_cannot_be_written(
    mesh_keys: KeyFolder, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = content(mesh_keys)
    sculpt = shutil.copy(mesh_keys.folder / "target" / "open.obj", tmp_path / "sculpt.ply.obj")

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(shutil, "copyfile", full)
    for name, replaces in (("Smile", True), ("Frown", False)):
        with pytest.raises(FacePoserError, match="No space left on device"):
            add_key(mesh_keys, name, write_source(tmp_path, jawOpen=1.0), Path(sculpt), replaces=replaces)
    with pytest.raises(FacePoserError, match="not finite"):
        mesh_keys.add(Pose("Smile", {"jawOpen": float("nan")}), None, replace=True)
    assert content(mesh_keys) == before


def test_a_sculpt_of_another_topology_is_refused_for_a_mesh_without_shapes(
    mesh_keys: KeyFolder, tmp_path: Path
) -> None:
    before = content(mesh_keys)
    write_obj(tmp_path / "cube.obj", np.eye(3), np.array([[0, 1, 2]]))
    with pytest.raises(FacePoserError, match=r"cube\.obj' has 3 vertices, but 'head' has 1796"):
        add_key(mesh_keys, "cube", write_source(tmp_path, jawOpen=1.0), tmp_path / "cube.obj")
    assert content(mesh_keys) == before


def test_a_damaged_key_can_be_saved_over(keys: KeyFolder, low: FaceModel) -> None:
    path = keys.folder / "target" / "open.json"
    write_pose(keys.folder / "source" / "open.json", Pose("Open wide", OPEN, tags=("viseme",)))
    path.write_text("{")
    save_key(keys, "open", "target", low, low.coefficients_of({"jawOpen": 0.4}))
    saved = read_pose(path)
    assert saved.weights["jawOpen"] == pytest.approx(0.4, abs=0.02)
    assert (saved.name, saved.tags) == ("Open wide", ("viseme",))
    for side in ("source", "target"):
        (keys.folder / side / "smile.json").write_text("{")
    save_key(keys, "smile", "target", low, low.coefficients_of(SMILE))
    assert read_pose(keys.folder / "target" / "smile.json").name == "smile"


def test_a_key_in_capitals_keeps_its_file(keys: KeyFolder, low: FaceModel) -> None:
    path = keys.folder / "target" / "open.json"
    capitals = path.rename(path.with_suffix(".JSON"))
    save_key(keys, "open", "target", low, low.coefficients_of({"jawOpen": 0.4}))
    propose_again(keys, "open")
    assert not path.exists()
    assert read_pose(capitals).tags == ("proposed",)
    assert len(load_keys(keys).transfer.pairs) == 2


def test_an_edited_combination_is_composed_no_more(keys: KeyFolder, low: FaceModel, tmp_path: Path) -> None:
    for side in ("source", "target"):
        write_pose(keys.folder / side / "smile.json", Pose("Smile", SMILE, tags=(COMPOSED, "favourite")))
    propose_again(keys, "smile")
    assert read_pose(keys.folder / "target" / "smile.json").tags == ("favourite", "proposed")
    save_key(keys, "smile", "source", low, low.coefficients_of(SMILE))
    assert read_pose(keys.folder / "source" / "smile.json").tags == ("favourite",)
    write_pose(tmp_path / "new.json", Pose("New", {"jawOpen": 0.2}, tags=(COMPOSED,)))
    name, _ = add_key(keys, "Mine", tmp_path / "new.json", tmp_path / "new.json")
    assert name not in keys.kinds()


def test_there_is_one_limit_of_keys_and_too_many_can_be_removed(keys: KeyFolder, tmp_path: Path) -> None:
    for i in range(MOST_KEYS - 3):
        shutil.copy(keys.folder / "source" / "open.json", keys.folder / "source" / f"k{i}.json")
    assert len(keys.entries()) == MOST_KEYS - 1
    source = write_source(tmp_path, jawOpen=1.0)
    with pytest.raises(FacePoserError, match=f"may have {MOST_KEYS} keys with the neutral face: none can be added"):
        add_key(keys, "More", source)
    with pytest.raises(FacePoserError, match="none can be added"):
        choose_keys(keys, tmp_path / "take.csv", 5)
    assert len(keys.entries()) == MOST_KEYS - 1
    # By hand, anything can be put there.
    shutil.copy(source, keys.folder / "source" / "more.json")
    with pytest.raises(FacePoserError, match=f"has {MOST_KEYS + 1} keys with the neutral face, more than"):
        keys.entries()
    keys.remove("more")
    assert len(keys.entries()) == MOST_KEYS - 1


def test_frames_are_chosen_from_the_base_of_the_folder(keys: KeyFolder, tmp_path: Path) -> None:
    take = tmp_path / "take.json"

    def write(frames: list[list[float]]) -> None:
        data = {"format": "faceposer.weights", "version": 1, "names": ["jawOpen", "cheekPuff"], "rate": 30}
        take.write_text(json.dumps(data | {"frames": frames}))

    for name in ("open", "smile"):
        keys.remove(name)
    write([[0.0, 0.0]] * 4)
    assert choose_keys(keys, take, 3) == [], "the neutral face reaches all"
    # The base of the keys is an open mouth, which the take does not leave but in one frame.
    keys.add(Pose("Neutral", OPEN), Pose("Neutral", OPEN))
    keys.add(Pose("Smile", OPEN | SMILE), Pose("Smile", OPEN | SMILE))
    write([[0.8, 0.0]] * 4 + [[0.8, 1.0]] + [[0.8, 0.0]] * 4)
    assert [helpful.frame for _, helpful in choose_keys(keys, take, 3)] == [4]
    assert choose_keys(keys, take, 3) == [], "the keys reach all frames"


def test_a_session_of_another_character_of_this_name_is_no_key(keys: KeyFolder, tmp_path: Path, low: FaceModel) -> None:
    from faceposer.model.character_file import save_character
    from faceposer.model.face_model import build_face_model
    from tests.rigs import with_fewer_shapes

    for name, count in (("a", 30), ("b", 20)):
        (tmp_path / name).mkdir()
        save_character(tmp_path / name / "me.npz", with_fewer_shapes(low.character, count))
    mine = KeyFolder(tmp_path / "mine", "../a/me.npz", "low")
    mine.write()
    other = build_face_model(with_fewer_shapes(low.character, 20))
    session = tmp_path / "b" / "session.json"
    write_document(session, Document("me.npz").posed(other.neutral()).with_version_data(other))
    with pytest.raises(FacePoserError, match="not of Me with the 30 shapes of the keys"):
        add_key(mine, "Mine", session)
    own = build_face_model(with_fewer_shapes(low.character, 30))
    pose = own.coefficients_of(OPEN)
    document = Document("me.npz").with_start(pose).posed(pose).with_version_data(own)
    write_document(tmp_path / "a" / "session.json", document)
    assert add_key(mine, "Mine", tmp_path / "a" / "session.json")[0] == "mine"


def test_two_poses_that_become_one_key_are_named(tmp_path: Path) -> None:
    poses = tmp_path / "poses"
    for file, name in (("one", "Joy"), ("two", "Joy!")):
        write_pose(poses / f"{file}.json", Pose(name, SMILE))
    with pytest.raises(FacePoserError, match=r"one\.json' and '.*two\.json' would both become the key 'joy'; rename"):
        create_keys(tmp_path / "new", "low", "low", poses)
    assert not (tmp_path / "new").exists()


def test_unknown_feature_points_are_named(keys: KeyFolder) -> None:
    data = json.loads((keys.folder / "keys.json").read_text())
    (keys.folder / "keys.json").write_text(json.dumps(data | {"points": ["8.3", "8.4", "2.1", "99.1"]}))
    with pytest.raises(FacePoserError, match=r"keys\.json': points names '99\.1', but the source 'low' has no such"):
        load_keys(KeyFolder.read(keys.folder))


def test_a_damaged_key_leaves_the_kinds_of_others(keys: KeyFolder) -> None:
    write_pose(keys.folder / "source" / "open.json", Pose("Open", OPEN, tags=("viseme",)))
    (keys.folder / "target" / "smile.json").unlink()
    found = read_key_set(keys.folder)
    assert [key.kind for key in found.keys] == ["viseme", ""]
    assert [key.name for key in found.left_out] == ["smile"]
    (keys.folder / "source" / "open.json").write_text("{")
    again = read_key_set(keys.folder, last=found)
    assert again.transfer is None
    assert [(key.title, key.kind) for key in again.keys] == [("Open", "viseme"), ("Smile", "")]


def test_the_base_of_a_mesh_without_shapes_is_pictured_as_sculpted(mesh_keys: KeyFolder, low: FaceModel) -> None:
    mesh_keys.add(Pose("Neutral", {"jawOpen": 0.1}), None)
    lifted = low.character.vertices + np.exp(-((low.character.vertices - low.character.vertices[0]) ** 2))
    write_obj(mesh_keys.folder / "target" / "neutral.obj", lifted, low.character.polygons)
    found = read_key_set(mesh_keys.folder)
    key, model = found.key("neutral"), found.models["target"]
    assert key is not None
    assert model is not None
    assert key.poses["target"] is not None
    np.testing.assert_allclose(model.instance(key.poses["target"]), lifted, atol=1e-4)


def test_each_file_is_read_once_and_again_only_when_it_changes(
    keys: KeyFolder, low: FaceModel, monkeypatch: pytest.MonkeyPatch
) -> None:
    from faceposer.session import key_files

    for side in ("source", "target"):
        (keys.folder / side / "smile.json").unlink()
        moved = low.instance(low.coefficients_of(SMILE))
        write_obj(keys.folder / side / "smile.obj", moved, low.character.polygons)
    reads: list[str] = []

    def reading(name: str) -> None:
        read = getattr(key_files, name)
        monkeypatch.setattr(key_files, name, lambda path: (reads.append(path.name), read(path))[1])

    reading("read_mesh")
    reading("read_pose")
    found = read_key_set(keys.folder)
    assert found.problem == ""
    assert sorted(reads) == ["open.json", "open.json", "smile.obj", "smile.obj"]
    save_key(keys, "open", "target", low, low.coefficients_of({"jawOpen": 0.4}))
    reads.clear()
    again = read_key_set(keys.folder, last=found)
    assert reads == ["open.json"]
    was, now = found.key("open"), again.key("open")
    assert was is not None
    assert now is not None
    assert was.poses["target"] is not None
    assert np.abs(was.poses["target"] - now.poses["target"]).max() > 0.01


def test_keys_that_do_not_fit_into_memory_are_refused_before_they_are_read(
    mesh_keys: KeyFolder, monkeypatch: pytest.MonkeyPatch
) -> None:
    from faceposer.session.key_compositions import compose_keys

    for name, tag in (("open", "viseme"), ("smile", "expression")):
        path = mesh_keys.folder / "source" / f"{name}.json"
        write_pose(path, Pose(name, read_pose(path).weights, tags=(tag,)))
    before = content(mesh_keys)
    # Both keys would fit, but not their combination, with which the folder could not be loaded any more.
    monkeypatch.setattr(keyed_model, "_MOST_VALUES", 3 * 3 * 1796 - 1)
    with pytest.raises(FacePoserError, match="as meshes of 1,796 vertices are too many"):
        compose_keys(mesh_keys)
    assert content(mesh_keys) == before
    monkeypatch.undo()
    assert compose_keys(mesh_keys).composed == 1
    assert len(read_mesh(mesh_keys.folder / "target" / "smile+open.obj").vertices) == 1796


def test_poses_of_another_key_are_refused_before_they_are_written(keys: KeyFolder, low: FaceModel) -> None:
    written = content(keys)
    smile = low.coefficients_of(SMILE)
    for coefficients, reason in ((smile, "same expression of the source as 'smile'"), (low.neutral(), "neutral face")):
        with pytest.raises(FacePoserError, match=reason):
            save_key(keys, "open", "source", low, coefficients)
        with pytest.raises(FacePoserError, match=reason):
            add_key_pose(keys, pose_of(low, coefficients, "New"))
    assert content(keys) == written
    # Its own pose, and that of another key on the target, may be saved.
    save_key(keys, "smile", "source", low, smile)
    save_key(keys, "open", "target", low, smile)


def test_of_keys_with_one_expression_one_is_used_and_a_composed_one_is_not(keys: KeyFolder) -> None:
    for name, weights, tags in (("A", SMILE, (COMPOSED,)), ("B", {}, ()), ("T", SMILE, ())):
        write_pose(keys.folder / "source" / f"{name.lower()}.json", Pose(name, weights, tags=tags))
        write_pose(keys.folder / "target" / f"{name.lower()}.json", Pose(name, weights))
    loaded = load_keys(keys)
    assert [pair.name for pair in loaded.transfer.pairs] == ["open", "smile"]
    assert set(loaded.left_out) == {"a", "b", "t"}
    assert "'a' is the same expression of the source as 'smile'" in loaded.left_out["a"]
    assert "'b' is the neutral face of the source" in loaded.left_out["b"]
    assert loaded.remarks.startswith("3 keys left out. ")
    # With a base of their own, the neutral face is an expression like others.
    for side in ("source", "target"):
        write_pose(keys.folder / side / "neutral.json", Pose("Neutral", {"jawOpen": 0.1}))
    again = load_keys(keys)
    assert again.transfer.base.name == "neutral"
    assert set(again.left_out) == {"a", "t"}


def test_a_mesh_without_shapes_is_cloned_by_the_keys_that_are_sculpted(mesh_keys: KeyFolder, low: FaceModel) -> None:
    mesh_keys.add(Pose("Pucker", {"mouthPucker": 1.0}), None)
    loaded = load_keys(mesh_keys)
    assert [pair.name for pair in loaded.transfer.pairs] == ["open", "smile"]
    assert "add a pose or a mesh with this name there, such as 'pucker.obj'" in loaded.left_out["pucker"]
    far = low.character.vertices * 1e4
    write_obj(mesh_keys.folder / "target" / "pucker.obj", far, low.character.polygons)
    assert "is no face" in load_keys(mesh_keys).left_out["pucker"]


def test_a_key_is_renamed_with_both_sides_or_not_at_all(mesh_keys: KeyFolder, monkeypatch: pytest.MonkeyPatch) -> None:
    sculpt = (mesh_keys.folder / "target" / "smile.obj").read_bytes()
    assert rename_key(mesh_keys, "smile", "Big smile") == "big-smile"
    assert read_pose(mesh_keys.folder / "source" / "big-smile.json").name == "Big smile"
    assert (mesh_keys.folder / "target" / "big-smile.obj").read_bytes() == sculpt
    assert [entry.name for entry in mesh_keys.entries()] == ["big-smile", "open"]
    # Another spelling of the same name.
    assert rename_key(mesh_keys, "big-smile", "BIG SMILE") == "big-smile"
    assert read_pose(mesh_keys.folder / "source" / "big-smile.json").name == "BIG SMILE"
    before = content(mesh_keys)

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(shutil, "copyfile", full)
    with pytest.raises(FacePoserError, match="No space left"):
        rename_key(mesh_keys, "open", "Yawn")
    assert content(mesh_keys) == before


def test_a_key_with_two_files_of_one_side_is_not_changed_and_others_are(keys: KeyFolder) -> None:
    (keys.folder / "target" / "smile.obj").write_text("")
    before = content(keys)
    for change in (lambda: keys.remove("smile"), lambda: rename_key(keys, "smile", "Grin")):
        with pytest.raises(FacePoserError, match=r"The key 'smile' has two files, .* remove one of them"):
            change()
    assert content(keys) == before
    assert rename_key(keys, "open", "Yawn") == "yawn"
    assert list(load_keys(keys).left_out) == ["smile"]


def test_a_key_keeps_its_name_if_the_description_cannot_be_written(
    keys: KeyFolder, monkeypatch: pytest.MonkeyPatch
) -> None:
    replace(keys, visemes=("open",)).write()
    named, before = KeyFolder.read(keys.folder), content(keys)

    def full(*_: object, **__: object) -> None:
        raise FacePoserError("The description of the keys cannot be written.")

    monkeypatch.setattr("faceposer.session.key_folder.write_json", full)
    with pytest.raises(FacePoserError, match="description of the keys"):
        rename_key(named, "open", "Yawn")
    assert content(keys) == before
