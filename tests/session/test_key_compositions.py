"""Combinations of emotional and verbal keys: written all or none, and never over what the artist made of them."""

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from faceposer.errors import FacePoserError
from faceposer.geometry.mesh_io import read_mesh
from faceposer.geometry.obj_io import write_obj
from faceposer.model.face_model import FaceModel
from faceposer.poses.pose_file import Pose, read_pose, write_pose
from faceposer.progress import CancelledError, Progress
from faceposer.session.key_compositions import compose_keys
from faceposer.session.key_edits import propose_again, save_key
from faceposer.session.key_folder import KeyFolder
from faceposer.session.keys import load_keys

EXPRESSIONS = {"Joy": {"mouthSmileLeft": 0.9, "mouthSmileRight": 0.9}, "Anger": {"browDownLeft": 1, "browDownRight": 1}}
VISEMES = {"Ah": {"jawOpen": 0.7}, "Oh": {"mouthFunnel": 0.8, "jawOpen": 0.2}}
NAMES = {"anger+ah", "anger+oh", "joy+ah", "joy+oh"}


@pytest.fixture
def keys(tmp_path: Path) -> KeyFolder:
    folder = KeyFolder(tmp_path / "keys", "low", "low")
    folder.write()
    for poses, tag in ((EXPRESSIONS, "expression"), (VISEMES, "viseme")):
        for name, weights in poses.items():
            folder.add(Pose(name, weights, tags=(tag,)), Pose(name, weights))
    return folder


def as_meshes(keys: KeyFolder, low: FaceModel) -> KeyFolder:
    """Return the keys with the low head as a mesh without shapes."""
    write_obj(keys.folder.parent / "head.obj", low.character.vertices, low.character.polygons)
    for name, weights in (EXPRESSIONS | VISEMES).items():
        path = keys.folder / "target" / f"{name.lower()}.json"
        write_obj(path.with_suffix(".obj"), low.instance(low.coefficients_of(weights)), low.character.polygons)
        path.unlink()
    folder = replace(keys, target="../head.obj")
    folder.write()
    return folder


def content(folder: KeyFolder) -> dict[str, bytes]:
    return {str(path.relative_to(folder.folder)): path.read_bytes() for path in folder.folder.rglob("*.*")}


@pytest.mark.parametrize("meshes", [False, True])
def test_earlier_combinations_stay_if_new_ones_cannot_be_made(keys: KeyFolder, low: FaceModel, meshes: bool) -> None:
    keys = as_meshes(keys, low) if meshes else keys
    assert compose_keys(keys).composed == 4
    assert {entry.name for entry in keys.pairs()} >= NAMES
    before = content(keys)
    wrong = keys.folder / "target" / "ah.obj"
    correct = wrong.read_bytes() if meshes else b""
    (keys.folder / "target" / "ah.json").unlink(missing_ok=True)
    write_obj(wrong, np.eye(3), np.array([[0, 1, 2]]))
    with pytest.raises(FacePoserError, match="has 3 vertices"):
        compose_keys(keys)
    if meshes:
        wrong.write_bytes(correct)
    else:
        wrong.unlink()
        write_pose(keys.folder / "target" / "ah.json", Pose("Ah", VISEMES["Ah"]))
    assert content(keys) == before
    for after in (0, 3, 6):
        reports: list[float] = []
        progress = Progress(lambda _, share, to=reports: to.append(share), lambda at=after, to=reports: len(to) > at)
        with pytest.raises(CancelledError):
            compose_keys(keys, "switch", progress)
        assert content(keys) == before


def test_combinations_of_removed_keys_go_and_a_failure_to_write_leaves_all(
    keys: KeyFolder, monkeypatch: pytest.MonkeyPatch
) -> None:
    compose_keys(keys)
    keys.remove("oh")
    assert compose_keys(keys).keys == 1 + 3 + 2
    assert {entry.name for entry in keys.entries()} == {"joy", "anger", "ah", "joy+ah", "anger+ah"}
    before = content(keys)
    write_text = Path.write_text

    def full(path: Path, *arguments: object, **options: object) -> int:
        if "anger+ah" in path.name and path.parent.name == "target":
            raise OSError(28, "No space left on device")
        return write_text(path, *arguments, **options)  # type: ignore[arg-type]

    monkeypatch.setattr(Path, "write_text", full)
    with pytest.raises(FacePoserError, match="No space left on device"):
        compose_keys(keys, "switch")
    assert content(keys) == before


def test_combinations_that_the_artist_changed_stay(keys: KeyFolder, low: FaceModel) -> None:
    compose_keys(keys)
    save_key(keys, "joy+ah", "target", low, low.coefficients_of({"jawOpen": 0.5, "cheekPuff": 1.0}))
    save_key(keys, "joy+oh", "source", low, low.coefficients_of({"jawOpen": 0.5, "cheekPuff": 1.0}))
    propose_again(keys, "anger+oh")
    # Another name makes a combination the artist's, too.
    for side in ("source", "target"):
        shutil.copy(keys.folder / side / "anger+ah.json", keys.folder / side / "growl.json")
    before = content(keys)
    write_pose(keys.folder / "source" / "ah.json", Pose("Ah", {"jawOpen": 0.3}, tags=("viseme",)))
    report = compose_keys(keys)
    assert (report.composed, report.kept, report.keys) == (1, 3, 1 + 4 + 4 + 1)
    changed = {name for name, bytes_ in content(keys).items() if bytes_ != before[name]}
    assert changed == {"source/ah.json", "source/anger+ah.json"}
    for name in ("joy+ah", "growl"):
        keys.remove(name)
    assert compose_keys(keys).kept == 2
    assert read_pose(keys.folder / "target" / "joy+ah.json").tags == ("composed",)
    assert len(load_keys(keys).transfer.pairs) == 8


def test_composed_meshes_that_another_program_wrote_stay(keys: KeyFolder, low: FaceModel) -> None:
    keys = as_meshes(keys, low)
    compose_keys(keys)
    sculpt = keys.folder / "target" / "joy+ah.obj"
    assert sculpt.read_text().startswith("# Composed by Face Poser\n")
    mesh = read_mesh(sculpt)
    write_obj(sculpt, mesh.vertices * 1.01, low.character.polygons)
    written = sculpt.read_bytes()
    assert compose_keys(keys).kept == 1
    assert sculpt.read_bytes() == written
    keys.remove("joy+ah")
    assert compose_keys(keys).kept == 0
    np.testing.assert_allclose(read_mesh(sculpt).vertices, mesh.vertices, atol=1e-5)
