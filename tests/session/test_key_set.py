"""All keys of a folder at one time, and changes of single keys."""

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from faceposer.errors import FacePoserError
from faceposer.geometry.obj_io import write_obj
from faceposer.model.character_file import save_character
from faceposer.model.face_model import FaceModel, build_face_model
from faceposer.poses.pose_file import read_pose
from faceposer.session.key_edits import add_key_pose, propose_again, save_key
from faceposer.session.key_folder import KeyFolder
from faceposer.session.key_kinds import set_kind
from faceposer.session.key_proposals import PROPOSED, create_keys
from faceposer.session.key_set import read_key_set, stamp_of
from faceposer.session.keys import check_characters
from faceposer.session.opening import load_model
from faceposer.transfer.key_coverage import reach_of
from tests.rigs import with_fewer_shapes


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("keys") / "keys"
    keys = create_keys(folder, "low", "creature")
    for entry in keys.entries()[6:]:
        keys.remove(entry.name)
    return folder


@pytest.fixture
def folder(made: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(made, tmp_path / "keys"))


def test_a_key_has_weight_one_in_its_own_pose_and_none_in_others(folder: Path) -> None:
    keys = read_key_set(folder)
    assert keys.problem == ""
    for key in keys.keys:
        assert key.poses["source"] is not None
        assert key.poses["target"] is not None
        strengths = keys.strengths(key.poses["source"])
        assert strengths.pop(key.name) == pytest.approx(1.0, abs=1e-6)
        assert np.abs(list(strengths.values())).max() < 1e-6


def test_poses_outside_the_keys_are_told(folder: Path) -> None:
    keys = read_key_set(folder)
    assert keys.transfer is not None
    inside = keys.keys[0].poses["source"]
    assert inside is not None
    distance, sentence = reach_of(keys.transfer, inside)
    assert distance < 0.02
    assert sentence == ""
    assert "exaggerates a key 4.0 times" in reach_of(keys.transfer, 4.0 * inside)[1]
    outside = keys.source_model().coefficients_of({"cheekPuff": 1.0, "noseSneerLeft": 1.0})
    distance, sentence = reach_of(keys.transfer, outside)
    assert f"{10.0 * distance:.1f} mm" in sentence


def test_a_proposal_that_is_saved_is_none_any_more(folder: Path) -> None:
    keys = KeyFolder.read(folder)
    low, creature = load_model("low"), load_model("creature")
    pose = read_pose(folder / "source" / "anger.json")
    name = add_key_pose(
        keys, replace(pose.renamed("Half anger"), weights={name: 0.5 * w for name, w in pose.weights.items()})
    )
    path = folder / "target" / f"{name}.json"
    assert PROPOSED in read_pose(path).tags
    made = np.linspace(-0.1, 0.1, creature.n_coefficients)
    save_key(keys, name, "target", creature, made)
    saved = read_pose(path)
    assert saved.name == "Half anger"
    assert PROPOSED not in saved.tags
    assert saved.note == ""
    save_key(keys, name, "source", low, low.coefficients_of({"jawOpen": 0.5}))
    found = read_key_set(folder).key(name)
    assert found is not None
    assert not found.proposed
    assert found.poses["target"] is not None
    np.testing.assert_allclose(found.poses["target"], made, atol=1e-4)
    propose_again(keys, name)
    again = read_key_set(folder).key(name)
    assert again is not None
    assert again.proposed
    assert again.poses["target"] is not None
    assert np.abs(again.poses["target"] - made).max() > 0.05


def test_what_cannot_be_changed_is_refused_and_stays(folder: Path) -> None:
    keys = KeyFolder.read(folder)
    creature = load_model("creature")
    path = folder / "target" / "anger.json"
    pose = read_pose(folder / "source" / "anger.json")
    with pytest.raises(FacePoserError, match="already has a key 'anger'"):
        add_key_pose(keys, pose)
    path.unlink()
    mesh = path.with_suffix(".obj")
    write_obj(mesh, creature.character.vertices + [0.0, 0.5, 0.0], creature.character.polygons)
    refusal = r"anger\.obj' is a mesh"
    with pytest.raises(FacePoserError, match=refusal):
        save_key(keys, "anger", "target", creature, creature.neutral())
    with pytest.raises(FacePoserError, match=refusal):
        propose_again(keys, "anger")
    assert mesh.exists()
    assert not path.exists()
    with pytest.raises(FacePoserError, match="no key 'joy' any more"):
        save_key(keys, "joy", "target", creature, creature.neutral())


def test_keys_that_cannot_be_used_are_listed_with_the_reason(folder: Path) -> None:
    before = stamp_of(folder)
    (folder / "target" / "anger.json").unlink()
    (folder / "target" / "ah.json").write_text("{")
    assert stamp_of(folder) != before
    keys = read_key_set(folder)
    assert keys.transfer is not None
    assert keys.problem == ""
    assert len(keys.keys) == 6
    assert [pair.name for pair in keys.transfer.pairs] == [
        key.name for key in keys.keys if key.name not in ("ah", "anger")
    ]
    anger, ah = keys.key("anger"), keys.key("ah")
    assert anger is not None
    assert ah is not None
    assert anger.poses["source"] is not None
    assert anger.poses["target"] is None
    assert anger.problem.startswith("The key 'anger' has no target in")
    assert "ah.json" in ah.problem


def test_the_state_of_a_folder_includes_its_characters(folder: Path, tmp_path: Path, low: FaceModel) -> None:
    rest, polygons = low.character.vertices, low.character.polygons
    write_obj(tmp_path / "head.obj", rest, polygons)
    save_character(tmp_path / "me.npz", with_fewer_shapes(low.character))
    KeyFolder(folder, "../me.npz", "../head.obj").write()
    before = stamp_of(folder)
    assert stamp_of(folder) == before
    write_obj(tmp_path / "head.obj", rest[:-1], polygons[:1])
    sculpted = stamp_of(folder)
    assert sculpted != before
    save_character(tmp_path / "me.npz", with_fewer_shapes(low.character, 20))
    assert stamp_of(folder) != sculpted


def test_a_character_of_the_same_name_with_other_shapes_is_another(folder: Path, low: FaceModel) -> None:
    keys = read_key_set(folder)
    assert keys.is_of("source", low)
    other = build_face_model(replace(with_fewer_shapes(low.character), name="low"))
    assert not keys.is_of("source", other)
    with pytest.raises(FacePoserError, match=r"of another character .*, with 54, not 30, shapes; make keys of"):
        check_characters(keys.folder, other, "creature")


def test_a_target_without_shapes_has_its_keys_as_shapes(folder: Path, tmp_path: Path) -> None:
    creature = load_model("creature").character
    neutral = tmp_path / "head.obj"
    write_obj(neutral, creature.vertices, creature.polygons)
    keys = create_keys(tmp_path / "mesh", "low", str(neutral))
    for entry in keys.entries()[2:]:
        keys.remove(entry.name)
    assert read_key_set(keys.folder).models["target"] is None
    names = [entry.name for entry in keys.entries()]
    for i, name in enumerate(names):
        bump = np.exp(-((creature.vertices - creature.vertices[100 * i]) ** 2).sum(axis=1))
        write_obj(keys.folder / "target" / f"{name}.obj", creature.vertices + bump[:, None], creature.polygons)
    found = read_key_set(keys.folder)
    assert found.problem == ""
    model = found.models["target"]
    assert model is not None
    for i, name in enumerate(names):
        key = found.key(name)
        assert key is not None
        assert key.poses["target"] is not None
        moved = model.instance(key.poses["target"]) - model.character.vertices
        assert np.linalg.norm(moved[100 * i]) == pytest.approx(np.sqrt(3.0), abs=0.01)
    with pytest.raises(FacePoserError, match="is a mesh"):
        save_key(keys, names[0], "target", model, model.neutral())


def test_keys_change_their_kind(folder: Path) -> None:
    keys = KeyFolder.read(folder)
    assert keys.kinds()["anger"] == "expression"
    set_kind(keys, "anger", "viseme")
    assert keys.kinds()["anger"] == "viseme"
    set_kind(keys, "anger", "")
    assert "anger" not in keys.kinds()
    set_kind(keys, "anger", "expression")
    assert keys.kinds()["anger"] == "expression"
    # Meshes have no tags: the description of the folder names them.
    for side, name in (("source", "low"), ("target", "creature")):
        character = load_model(name).character
        (folder / side / "anger.json").unlink()
        write_obj(folder / side / "anger.obj", character.vertices, character.polygons)
    set_kind(keys, "anger", "viseme")
    assert KeyFolder.read(folder).visemes == ("anger",)
    set_kind(KeyFolder.read(folder), "anger", "")
    assert KeyFolder.read(folder).visemes == ()
    with pytest.raises(FacePoserError, match="has no key 'joy'; its keys are"):
        set_kind(keys, "joy", "viseme")
