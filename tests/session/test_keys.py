"""Folders of key poses: poses, meshes and characters without shapes, and what is wrong with them."""

import json
import re
import shutil
from pathlib import Path

import numpy as np
import pytest

from faceposer.errors import FacePoserError
from faceposer.geometry.obj_io import write_obj
from faceposer.model.face_model import FaceModel
from faceposer.poses.pose_file import read_pose
from faceposer.session.key_compositions import compose_keys, folder_importance
from faceposer.session.key_folder import KeyFolder
from faceposer.session.key_proposals import create_keys
from faceposer.session.keys import load_keys
from faceposer.session.opening import load_model


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Keys of the low head for the creature, from the built-in poses of both."""
    folder = tmp_path_factory.mktemp("keys") / "keys"
    create_keys(folder, "low", "creature")
    return folder


@pytest.fixture
def keys(made: Path, tmp_path: Path) -> KeyFolder:
    return KeyFolder.read(shutil.copytree(made, tmp_path / "keys"))


def grown(vertices: np.ndarray, amount: float) -> np.ndarray:
    """A sculpt that no shape of the creature makes."""
    bump = np.exp(-((vertices - vertices[0]) ** 2).sum(axis=1) / 4.0)
    return vertices + amount * bump[:, None]


def write_mesh(path: Path, vertices: np.ndarray, model: FaceModel) -> None:
    write_obj(path, vertices, model.character.polygons)


def test_the_built_in_poses_make_the_nineteen_keys_of_the_paper(keys: KeyFolder) -> None:
    loaded = load_keys(keys)
    assert len(loaded.transfer.pairs) == 18
    assert loaded.has_own_shapes
    kinds = list(keys.kinds().values())
    assert (kinds.count("expression"), kinds.count("viseme")) == (5, 13)
    for pair in loaded.transfer.pairs:
        clone = loaded.transfer.target.instance(loaded.transfer.pose(pair.source))
        assert np.abs(clone - loaded.transfer.target.instance(pair.target)).max() < 1e-4


def test_missing_poses_of_the_target_are_proposed(tmp_path: Path) -> None:
    poses = tmp_path / "poses"
    poses.mkdir()
    pose = {"format": "faceposer.pose", "version": 1, "name": "Mine", "weights": {"jawOpen": 0.8}}
    (poses / "mine.json").write_text(json.dumps(pose))
    keys = create_keys(tmp_path / "keys", "low", "man", poses)
    written = json.loads((tmp_path / "keys" / "target" / "mine.json").read_text())
    assert written["weights"]["jawOpen"] == pytest.approx(0.8, abs=0.02)
    assert written["tags"] == ["proposed"]
    assert len(load_keys(keys).transfer.pairs) == 1


def test_emotional_and_verbal_keys_are_composed_and_composed_again(tmp_path: Path) -> None:
    keys = create_keys(tmp_path / "keys", "low", "low")
    for name in [name for name, kind in keys.kinds().items() if kind == "viseme"][3:]:
        keys.remove(name)
    kinds = list(keys.kinds().values())
    emotional, verbal = kinds.count("expression"), kinds.count("viseme")
    assert emotional == 5
    report = compose_keys(keys)
    assert report.composed == emotional * verbal
    assert "Happiness + AH" in {read_pose(entry.source).name for entry in keys.entries() if entry.source is not None}
    assert report.keys == 1 + emotional + verbal + emotional * verbal
    assert compose_keys(keys) == report
    assert len(load_keys(keys).transfer.pairs) == report.keys - 1
    found, character = folder_importance(keys, "target")
    assert found.values[character.regions["lip_lower"]].mean() > 0.6
    assert found.values[character.regions["brow_left"]].mean() < 0.2


def test_a_mesh_beyond_the_shapes_stays_as_sculpted(keys: KeyFolder) -> None:
    creature = load_model("creature")
    sculpted = grown(creature.character.vertices.astype(np.float64), 1.5)
    (keys.folder / "target" / "happiness.json").unlink()
    write_mesh(keys.folder / "target" / "happiness.obj", sculpted, creature)
    loaded = load_keys(keys)
    assert not loaded.has_own_shapes
    smile = next(pair for pair in loaded.transfer.pairs if pair.name == "happiness")
    clone = loaded.transfer.target.instance(loaded.transfer.pose(smile.source))
    assert np.abs(clone - sculpted).max() < 1e-4
    nearest = load_keys(keys, "weights")
    assert nearest.has_own_shapes
    assert "1 key of the target cannot be reached" in nearest.notes


def test_a_character_may_be_a_mesh_without_shapes(keys: KeyFolder, tmp_path: Path) -> None:
    rest = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    polygons = np.array([[0, 1, 2], [0, 1, 3]])
    write_obj(tmp_path / "blob.obj", rest, polygons)
    blob = KeyFolder(keys.folder, "low", "../blob.obj")
    blob.write()
    for entry in blob.entries()[2:]:
        blob.remove(entry.name)
    moved = {}
    for i, entry in enumerate(blob.entries()):
        assert entry.target is not None
        entry.target.unlink()
        moved[entry.name] = rest + (i + 1) * np.eye(4, 3)
        write_obj(entry.target.with_suffix(".obj"), moved[entry.name], polygons)
    loaded = load_keys(blob)
    assert not loaded.has_own_shapes
    for pair in loaded.transfer.pairs:
        clone = loaded.transfer.target.instance(loaded.transfer.pose(pair.source))
        np.testing.assert_allclose(clone, moved[pair.name], atol=1e-4)


def test_what_is_wrong_with_a_folder_is_said_in_a_sentence(keys: KeyFolder, tmp_path: Path) -> None:
    def refused(text: str) -> None:
        with pytest.raises(FacePoserError, match=text) as caught:
            load_keys(KeyFolder.read(keys.folder))
        assert "\n" not in str(caught.value)

    def left_out(text: str, name: str = "happiness") -> None:
        loaded = load_keys(KeyFolder.read(keys.folder))
        assert re.search(text, loaded.left_out[name])
        assert "\n" not in loaded.remarks
        assert loaded.remarks.startswith("1 key left out. ")
        assert len(loaded.transfer.pairs) == 17

    happy = keys.folder / "target" / "happiness.json"
    content = happy.read_text()
    happy.unlink()
    left_out("The key 'happiness' has no target")
    write_obj(happy.with_suffix(".obj"), np.eye(3), np.array([[0, 1, 2]]))
    left_out(r"happiness.obj' has 3 vertices, but .* has 14712")
    creature = load_model("creature")
    happy.with_suffix(".obj").write_text("v 0 0 nan\n")
    left_out("happiness.obj'")
    write_mesh(happy.with_suffix(".obj"), grown(creature.character.vertices.astype(np.float64), 1e7), creature)
    left_out("happiness.obj'")
    happy.with_suffix(".obj").unlink()
    happy.write_text(content.replace('"name"', '"nam"'))
    left_out("happiness.json'")
    happy.write_text(content)
    happy.with_suffix(".obj").write_text("")
    left_out("has two files")
    happy.with_suffix(".obj").unlink()
    source = keys.folder / "source"
    shutil.copy(source / "happiness.json", source / "sadness.json")
    left_out("'sadness' is the same expression of the source as 'happiness' at all", "sadness")
    shutil.rmtree(source)
    source.mkdir()
    refused("No key in .* can be used. The key 'ah' has no source")
    data = json.loads((keys.folder / "keys.json").read_text())
    for change, text in (
        ({"regions": "none"}, "regions is 'none'"),
        ({"target": "nobody"}, "no character 'nobody'"),
        ({"more": 1}, "unknown key 'more'"),
        ({"version": 9}, "version is 9"),
        ({"points": ["8.3"]}, "needs at least 3"),
        ({"threshold": 2.0}, "threshold must be"),
    ):
        (keys.folder / "keys.json").write_text(json.dumps(data | change))
        refused(text)
    with pytest.raises(FacePoserError, match="is not a folder of keys"):
        KeyFolder.read(tmp_path)
    shutil.rmtree(source)
    (keys.folder / "keys.json").write_text(json.dumps(data))
    refused("cannot be listed")
