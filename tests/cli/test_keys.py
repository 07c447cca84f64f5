"""``faceposer keys`` and transfer by examples."""

import json
from pathlib import Path

import numpy as np
import pytest

from faceposer.errors import FacePoserError
from faceposer.geometry.mesh_io import read_mesh
from faceposer.interchange.formats import write
from faceposer.model.face_model import FaceModel
from faceposer.session.opening import open_session
from tests.command_line import run, run_captured


@pytest.fixture
def take(tmp_path: Path) -> Path:
    path = tmp_path / "take.json"
    frames = [[0.1 * i, 0.08 * i, 0.0] for i in range(8)] + [[0.0, 0.0, 0.2 * i] for i in range(5)]
    data = {"format": "faceposer.weights", "version": 1, "names": ["jawOpen", "mouthSmileLeft", "eyeBlinkRight"]}
    path.write_text(json.dumps(data | {"rate": 30, "frames": frames}))
    return path


@pytest.fixture
def poses(tmp_path: Path) -> Path:
    folder = tmp_path / "poses"
    folder.mkdir()
    named = {
        "Joy": ({"mouthSmileLeft": 1.0, "mouthSmileRight": 1.0, "cheekSquintLeft": 0.8}, "expression"),
        "Open": ({"jawOpen": 0.8}, "viseme"),
        "Pucker": ({"mouthPucker": 1.0}, "viseme"),
    }
    for name, (weights, tag) in named.items():
        data = {"format": "faceposer.pose", "version": 1, "name": name, "tags": [tag], "weights": weights}
        (folder / f"{name.lower()}.json").write_text(json.dumps(data))
    return folder


def test_keys_are_created_extended_composed_and_checked_and_transfer_a_take(
    tmp_path: Path, take: Path, poses: Path, low: FaceModel, capsys: pytest.CaptureFixture[str]
) -> None:
    keys, out = tmp_path / "keys", tmp_path / "out.json"
    status, said, _ = run_captured(capsys, "keys", "init", "low", "low", "-o", keys, "--poses", poses)
    assert (status, said) == (0, f"{keys} written: 3 keys, 3 of them proposed\n")
    assert run("keys", "add", keys, "Blink", "--source", take, "--frame", 12) == 0
    status, said, _ = run_captured(capsys, "keys", "compose", keys)
    assert status == 0
    assert "2 keys composed of 1 emotional and 2 verbal ones; 7 with the neutral face" in said
    report = tmp_path / "report.json"
    status, said, _ = run_captured(capsys, "keys", "check", keys, "--on", take, "--json", report)
    assert "7 keys with the neutral face; the target gets poses of its shapes" in said
    found = json.loads(report.read_text())
    assert found["frames"] == 13
    assert found["missed"] < 0.2
    assert run("keys", "rename", keys, "blink", "Wink") == 0
    assert (keys / "source" / "wink.json").is_file()
    assert run("keys", "rename", keys, "wink", "Blink") == 0
    assert run("keys", "remove", keys, "joy+open") == 0
    assert run("keys", "choose", keys, take, "--count", 2) == 0
    assert run("keys", "check", keys, "--on", take, "--json", report) == 0
    assert json.loads(report.read_text())["missed"] < 0.01
    arrays = tmp_path / "importance.npz"
    assert run("keys", "importance", keys, "-o", arrays) == 0
    with np.load(arrays, allow_pickle=False) as members:
        assert members["values"].shape == (len(low.character.vertices),)
    options = ("--from", "low", "--method", "examples", "--keys", keys)
    assert run("transfer", take, "low", "-o", out, *options) == 0
    animation = json.loads(out.read_text())
    jaw = np.array(animation["frames"])[:, animation["names"].index("jawOpen")]
    assert jaw[7] == pytest.approx(0.7, abs=0.15)
    mesh = tmp_path / "out.obj"
    assert run("transfer", take, "low", "-o", mesh, *options, "--frames", "7", "--regions", "halves") == 0
    assert len(read_mesh(mesh).vertices) == len(low.character.vertices)


def test_a_mesh_without_shapes_is_animated_by_its_sculpted_keys(tmp_path: Path, poses: Path, low: FaceModel) -> None:
    from faceposer.geometry.obj_io import write_obj

    rest = low.character.vertices * 2.0
    write_obj(tmp_path / "head.obj", rest, low.character.polygons)
    keys = tmp_path / "keys"
    assert run("keys", "init", "low", tmp_path / "head.obj", "-o", keys, "--poses", poses) == 0
    moved = {}
    for i, name in enumerate(("joy", "open", "pucker")):
        moved[name] = rest + (i + 1) * np.sin(rest)
        write_obj(keys / "target" / f"{name}.obj", moved[name], low.character.polygons)
    session = tmp_path / "open.json"
    weights = {"format": "faceposer.weights", "version": 1, "rate": 30, "names": ["jawOpen"], "frames": [[0.8], [0.4]]}
    session.write_text(json.dumps(weights))
    out = tmp_path / "out.obj"
    options = ("--from", "low", "--method", "examples", "--keys", keys)
    assert run("transfer", session, tmp_path / "head.obj", "-o", out, *options, "--frames", 0) == 0
    np.testing.assert_allclose(read_mesh(out).vertices, moved["open"], atol=2e-3)
    pose = keys / "source" / "pucker.json"
    assert run("transfer", pose, tmp_path / "head.obj", "-o", out, *options[2:]) == 0
    np.testing.assert_allclose(read_mesh(out).vertices, moved["pucker"], atol=2e-3)
    assert run("transfer", session, tmp_path / "head.obj", "-o", tmp_path / "out.glb", *options) == 0
    assert run("transfer", session, tmp_path / "head.obj", "-o", tmp_path / "no.json", *options) == 2
    assert run("keys", "choose", keys, session) == 2


def test_a_source_outside_the_keys_is_told_with_its_distance(
    tmp_path: Path, poses: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    keys, source, out = tmp_path / "keys", tmp_path / "far.json", tmp_path / "out.json"
    assert run("keys", "init", "low", "low", "-o", keys, "--poses", poses) == 0
    weights = {"format": "faceposer.weights", "version": 1, "rate": 30, "names": ["jawOpen", "browDownLeft"]}
    source.write_text(json.dumps(weights | {"frames": [[0.4, 0.0], [8.0, 1.0]]}))
    options = ("--from", "low", "--method", "examples", "--keys", keys)
    status, _, said = run_captured(capsys, "transfer", source, "low", "-o", out, *options)
    assert status == 0
    assert "The source is outside the keys" in said
    assert "exaggerated up to 10.0 times" in said
    assert np.isfinite(json.loads(out.read_text())["frames"]).all()
    status, _, said = run_captured(capsys, "transfer", source, "low", "-o", out, *options, "--frames", "0")
    assert (status, "outside the keys" in said) == (0, False)


def test_a_session_becomes_one_of_the_target(tmp_path: Path, poses: Path, low: FaceModel) -> None:
    from faceposer.session.document import Document, write_document

    keys, source, out = tmp_path / "keys", tmp_path / "pose.json", tmp_path / "out.json"
    assert run("keys", "init", "low", "low", "-o", keys, "--poses", poses) == 0
    pose = low.coefficients_of({"jawOpen": 0.8})
    write_document(source, Document("low").with_start(pose).posed(pose))
    assert run("transfer", source, "low", "-o", out, "--method", "examples", "--keys", keys) == 0
    np.testing.assert_allclose(open_session(str(out)).coefficients, pose, atol=1e-3)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("transfer", "{take}", "man", "-o", "o.obj", "--method", "examples"), "needs --keys DIR"),
        (("transfer", "{take}", "man", "-o", "o.obj", "--keys", "{keys}"), "apply to the method 'examples' only"),
        (
            ("transfer", "{take}", "man", "-o", "o.obj", "--method", "examples", "--keys", "{no}"),
            "There is no folder",
        ),
        (
            (
                "transfer",
                "{take}",
                "woman",
                "-o",
                "o.json",
                "--from",
                "low",
                "--method",
                "examples",
                "--keys",
                "{keys}",
            ),
            "are for Low-poly head ('low'), not for Woman",
        ),
        (
            ("transfer", "{take}", "low", "-o", "o.json", "--method", "examples", "--keys", "{keys}"),
            "are of Low-poly head ('low'), but the source is Man",
        ),
        (("keys", "init", "low", "low", "-o", "{keys}"), "is not an empty folder"),
        (("keys", "init", "low", "low", "-o", "o", "--poses", "{no}"), "There are no poses for the character 'low'"),
        (("keys", "rename", "{keys}", "pukker", "a"), "has no key 'pukker'; did you mean 'pucker'?"),
        (("keys", "rename", "{keys}", "pucker", "../a"), "cannot be a path"),
        (("keys", "rename", "{keys}", "pucker", "Open"), "already has a key 'open'; choose another name."),
        (("keys", "remove", "{keys}", "none"), "has no key 'none'; its keys are the files in"),
        (("keys", "remove", "{keys}", "pukker"), "has no key 'pukker'; did you mean 'pucker'?"),
        (("keys", "add", "{keys}", "Joy", "--source", "{take}"), "already has a key 'joy'"),
        (("keys", "add", "{keys}", "Joy", "--source", "{take}"), "choose another name, or add --replace."),
        (("keys", "add", "{keys}", "../evil", "--source", "{take}"), "cannot be a path such as '../evil'"),
        (("keys", "add", "{keys}", "..", "--source", "{take}"), "cannot be a path such as '..'"),
        (("keys", "add", "{keys}", "Still", "--source", "{take}"), "is the neutral face of the source at all feature"),
        (("keys", "add", "{keys}", "Joy 2", "--source", "{keys}/source/joy.json"), "expression of the source as 'joy'"),
        (("transfer", "{keys}/source/joy.json", "low", "-o", "o.obj", "--frames", "3"), "is a single pose"),
        (("keys", "add", "{keys}", "New", "--source", "{take}", "--frame", "99"), "no frame 100"),
        (("keys", "choose", "{keys}", "{no}.csv"), "cannot be read"),
        (("keys", "importance", "{keys}", "-o", "o.txt"), "must end in '.png' or '.npz'"),
        (("keys", "check", "{no}"), "There is no folder"),
        (("keys", "check", "."), "not a folder of keys"),
    ],
)
def test_errors_are_sentences(
    tmp_path: Path,
    take: Path,
    poses: Path,
    words: tuple[str, ...],
    said: str,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    keys = tmp_path / "keys"
    assert run("keys", "init", "low", "low", "-o", keys, "--poses", poses) == 0
    status, _, shown = run_captured(capsys, *(word.format(take=take, keys=keys, no=tmp_path / "no") for word in words))
    assert status == 2
    assert said in shown
    assert len([line for line in shown.splitlines() if "It has no weights of" not in line]) == 1
    assert not list(tmp_path.glob("o.*"))


def test_compose_says_what_it_keeps(tmp_path: Path, poses: Path, capsys: pytest.CaptureFixture[str]) -> None:
    keys = tmp_path / "keys"
    assert run("keys", "init", "low", "low", "-o", keys, "--poses", poses) == 0
    assert run("keys", "compose", keys) == 0
    edited = keys / "target" / "joy+open.json"
    data = json.loads(edited.read_text())
    edited.write_text(json.dumps(data | {"tags": [], "weights": {"jawOpen": 0.9}}))
    written = edited.read_bytes()
    status, said, _ = run_captured(capsys, "keys", "compose", keys)
    assert status == 0
    assert "1 key composed of 1 emotional and 2 verbal ones; 6 with the neutral face" in said
    assert "1 combination kept as you changed them" in said
    assert edited.read_bytes() == written


def test_keys_that_cannot_be_used_are_told_and_the_others_clone(
    tmp_path: Path, take: Path, poses: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    keys, report, out = tmp_path / "keys", tmp_path / "report.json", tmp_path / "out.json"
    assert run("keys", "init", "low", "low", "-o", keys, "--poses", poses) == 0
    (keys / "target" / "pucker.json").write_text("{")
    (keys / "source" / "joy.json").unlink()
    status, said, noted = run_captured(capsys, "keys", "check", keys, "--json", report)
    assert status == 2
    assert "2 keys with the neutral face" in said
    assert noted.count("Left out.") == 2
    assert set(json.loads(report.read_text())["left_out"]) == {"joy", "pucker"}
    options = ("--from", "low", "--method", "examples", "--keys", keys)
    status, _, noted = run_captured(capsys, "transfer", take, "low", "-o", out, *options)
    assert status == 0
    assert "2 keys left out. The key 'joy' has no source" in noted


@pytest.mark.parametrize("place", ["target/anger.json", "source/new.json", "source/new.csv", "target/face.obj"])
def test_no_output_is_written_among_key_poses(
    place: str, tmp_path: Path, poses: Path, take: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    keys = tmp_path / "keys"
    assert run("keys", "init", "low", "low", "-o", keys, "--poses", poses) == 0
    before = {path: path.read_bytes() for path in keys.rglob("*.*")}
    options = ("--from", "low", "--method", "examples", "--keys", keys, "--frames", 7)
    status, _, said = run_captured(capsys, "transfer", take, "low", "-o", keys / place, *options)
    assert status == 2
    assert f"'{keys / place}' is among the key poses of '{keys}'" in said
    face = open_session("low")
    if place.endswith("anger.json"):
        with pytest.raises(FacePoserError, match="among the key poses"):
            face.save(keys / place)
        assert run("keys", "check", keys, "--json", keys / place) == 2
        with pytest.raises(FacePoserError, match="among the key poses"):
            face.save(keys / "keys.json")
    elif not place.startswith("source/new.json"):
        with pytest.raises(FacePoserError, match="among the key poses"):
            write(keys / place, face.model, face.coefficients)
    assert {path: path.read_bytes() for path in keys.rglob("*.*")} == before


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (None, "mesh.obj"),
        ("nothing\n", "mesh.obj"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\n", "has no faces"),
    ],
)
def test_the_mesh_of_a_target_is_checked_before_keys_are_created(
    content: str | None, said: str, tmp_path: Path, poses: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    mesh, keys = tmp_path / "mesh.obj", tmp_path / "keys"
    if content is not None:
        mesh.write_text(content)
    status, _, error = run_captured(capsys, "keys", "init", "low", mesh, "-o", keys, "--poses", poses)
    assert status == 2
    assert said in error
    assert str(mesh) in error
    assert not keys.exists()


def test_contradictions_of_kinds_are_told(tmp_path: Path, poses: Path, capsys: pytest.CaptureFixture[str]) -> None:
    keys = tmp_path / "keys"
    assert run("keys", "init", "low", "low", "-o", keys, "--poses", poses) == 0
    path = keys / "keys.json"
    description = json.loads(path.read_text())

    def refused(action: str, **changes: object) -> str:
        path.write_text(json.dumps(description | changes))
        status, _, said = run_captured(capsys, "keys", action, keys)
        assert status == 2
        return str(said)

    assert f"'{path}': expressions names 'nope', but there is no such key" in refused("check", expressions=["nope"])
    assert "there is no such key" in refused("compose", visemes=["nope"])
    both = refused("check", expressions=["joy"], visemes=["joy"])
    assert str(path) in both
    assert "expressions and visemes both name 'joy'" in both
    assert "The key 'joy'" in refused("check", visemes=["joy"])
    few = refused("check", points=["8.3", "8.3"])
    assert str(path) in few
    assert "points names 1 feature point, but cloning needs at least 3" in few
    assert f"'{path}': source: There is no character 'nobody'" in refused("check", source="nobody")
    # A key that is renamed or removed is named accordingly.
    path.write_text(json.dumps(description | {"visemes": ["open", "pucker"]}))
    assert run("keys", "rename", keys, "open", "Wide") == 0
    assert json.loads(path.read_text())["visemes"] == ["wide", "pucker"]
    assert run("keys", "rename", keys, "wide", "Open") == 0
    assert run("keys", "remove", keys, "open") == 0
    assert json.loads(path.read_text())["visemes"] == ["pucker"]
    assert run("keys", "check", keys) == 0
