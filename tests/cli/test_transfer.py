"""``faceposer transfer``: poses, captures and animations in, sessions, meshes and animations out."""

import json
from pathlib import Path

import numpy as np
import pytest

from faceposer.animation.keyframes import Key, Keyframes
from faceposer.geometry.mesh_io import read_mesh
from faceposer.model.face_model import FaceModel
from faceposer.session.document import Document, write_document
from faceposer.session.opening import open_session
from faceposer.transfer.pairs import PAPER_PAIRS, pairs_to_json
from tests.command_line import run, run_captured

SMILE = {"mouthSmileLeft": 0.8, "mouthSmileRight": 0.8}


@pytest.fixture
def smile(tmp_path: Path, model: FaceModel) -> Path:
    path = tmp_path / "smile.json"
    pose = model.coefficients_of(SMILE)
    write_document(path, Document("man").with_start(pose).posed(pose))
    return path


@pytest.fixture
def take(tmp_path: Path) -> Path:
    lines = ["Timecode,BlendShapeCount,JawOpen,MouthSmileLeft,MouthSmileRight"]
    lines += [f"00:00:0{i // 4}:{15 * (i % 4)}.0,61,{0.1 * i:.2f},0.5,0.5" for i in range(8)]
    path = tmp_path / "take.csv"
    path.write_text("\n".join(lines))
    return path


def test_a_pose_of_the_library_is_transferred_from_the_character_that_it_was_made_on(
    tmp_path: Path, model: FaceModel, low: FaceModel, capsys: pytest.CaptureFixture[str]
) -> None:
    path, out = tmp_path / "smile.json", tmp_path / "out.json"
    pose = {"format": "faceposer.pose", "version": 1, "name": "Smile", "weights": SMILE}
    path.write_text(json.dumps(pose | {"subject": "man"}))
    assert run("transfer", path, "low", "-o", out, "--method", "weights") == 0
    session = open_session(str(out))
    np.testing.assert_allclose(session.coefficients, low.coefficients_of(SMILE), atol=1e-3)
    assert run("transfer", path, "man", "-o", out, "--method", "weights", "--from", "low") == 0
    np.testing.assert_allclose(open_session(str(out)).coefficients, model.coefficients_of(SMILE), atol=1e-3)
    path.write_text(json.dumps(pose | {"subject": "nobody"}))
    status, _, said = run_captured(capsys, "transfer", path, "low", "-o", out)
    assert (status, "was made on the character 'nobody', which is not known here" in said) == (2, True)


def test_a_pose_becomes_a_session_of_the_other_face_and_a_mesh(tmp_path: Path, smile: Path) -> None:
    out = tmp_path / "out.json"
    assert run("transfer", smile, "low", "-o", out) == 0
    session = open_session(str(out))
    assert session.model.character.name == "low"
    weights = dict(
        zip(session.model.character.shape_names, session.model.weights_of(session.coefficients), strict=True)
    )
    assert weights["mouthSmileLeft"] > 0.5
    assert not session.document.constraints
    mesh = tmp_path / "out.obj"
    assert run("transfer", smile, "low", "-o", mesh, "--method", "weights") == 0
    read = read_mesh(mesh).vertices
    assert read.shape == session.model.character.vertices.shape
    assert np.abs(read - session.model.character.vertices).max() > 0.1


def test_a_capture_becomes_an_animation_and_goes_on_from_there(tmp_path: Path, take: Path) -> None:
    out, back = tmp_path / "out.json", tmp_path / "back.json"
    assert run("transfer", take, "creature", "-o", out, "--frames", "2:", "--rate", "4") == 0
    animation = json.loads(out.read_text())
    assert (animation["rate"], len(animation["frames"])) == (4.0, 6)
    assert run("transfer", out, "man", "--from", "creature", "-o", back, "--frames", "0:3") == 0
    animation = json.loads(back.read_text())
    jaw = np.array(animation["frames"])[:, animation["names"].index("jawOpen")]
    assert len(jaw) == 3
    assert (np.diff(jaw) > 0.03).all()
    one = tmp_path / "one.json"
    assert run("transfer", take, "woman", "-o", one, "--frames", "5", "--method", "weights") == 0
    session = open_session(str(one))
    weights = dict(
        zip(session.model.character.shape_names, session.model.weights_of(session.coefficients), strict=True)
    )
    assert weights["jawOpen"] == pytest.approx(0.5, abs=0.1)


def test_a_session_goes_over_with_all_its_keys(tmp_path: Path, model: FaceModel) -> None:
    frames: dict[int, dict[str, float]] = {0: {}, 12: SMILE, 20: {"jawOpen": 0.5}}
    keys = tuple(Key.of(frame, model.coefficients_of(weights)) for frame, weights in frames.items())
    source, out, film = tmp_path / "smile.json", tmp_path / "creature.json", tmp_path / "creature.csv"
    document = Document(
        "man", prior_weight=2.0, keyframes=Keyframes(keys, 24.0, 25, loop=True), frame=12, animated=True
    )
    pose = keys[1].pose
    write_document(source, document.with_start(pose).posed(pose))

    assert run("transfer", source, "low", "-o", out) == 0
    session = open_session(str(out))
    found = session.document.keyframes
    assert found is not None
    assert (found.rate, found.length, found.loop) == (24.0, 25, True)
    assert [key.frame for key in found.keys] == list(frames)
    assert (session.document.frame, session.document.prior_weight) == (12, 2.0)
    names = session.model.character.shape_names
    smile, jaw = (
        np.array([session.model.weights_of(key.pose)[names.index(name)] for key in found.keys])
        for name in ("mouthSmileLeft", "jawOpen")
    )
    assert np.abs(found.keys[0].pose - session.model.neutral()).max() < 1e-6, "a relaxed face stays one"
    assert smile[1] > 0.5
    assert jaw[2] == pytest.approx(0.5, abs=0.15)
    np.testing.assert_allclose(session.coefficients, found.keys[1].pose, atol=1e-9)

    assert run("transfer", source, "low", "-o", film, "--method", "weights") == 0
    assert len(film.read_text().splitlines()) == 1 + 25
    mesh = tmp_path / "low.obj"
    assert run("transfer", source, "low", "-o", mesh) == 0
    np.testing.assert_allclose(read_mesh(mesh).vertices, session.model.instance(found.keys[1].pose), atol=0.05)


@pytest.mark.parametrize("arguments", [("{a}", "woman", "-o", "{a}"), ("{a}", "low", "--pairs", "{p}", "-o", "{p}")])
def test_what_is_read_is_never_overwritten(
    arguments: tuple[str, ...], tmp_path: Path, smile: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pairs = tmp_path / "pairs.json"
    pairs.write_text(json.dumps(pairs_to_json(PAPER_PAIRS)))
    before = smile.read_bytes(), pairs.read_bytes()
    assert run("transfer", *(word.format(a=smile, p=pairs) for word in arguments)) == 2
    assert "is also an input; give the output another name" in capsys.readouterr().err
    assert (smile.read_bytes(), pairs.read_bytes()) == before


def test_the_pairs_of_a_file_are_those_that_count(tmp_path: Path, smile: Path) -> None:
    listed, three, full = tmp_path / "pairs.json", tmp_path / "three.json", tmp_path / "full.json"
    listed.write_text(json.dumps(pairs_to_json(PAPER_PAIRS)))
    by_name = tmp_path / "by_name.json"
    assert run("transfer", smile, "low", "-o", three, "--pairs", listed) == 0
    assert run("transfer", smile, "low", "-o", by_name, "--pairs", "paper") == 0
    assert run("transfer", smile, "low", "-o", full, "--scaling", "paper") == 0
    assert three.read_text() == by_name.read_text()
    assert three.read_text() != full.read_text()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("smile.json", "creature", "-o", "o.json", "--method", "weights"), "none of ARKit's shapes"),
        (("smile.json", "low", "-o", "o.json", "--from", "man"), "is a session"),
        (("smile.json", "low", "-o", "o.json", "--pairs", "none.json"), "cannot be read"),
        (("smile.json", "low", "-o", "o.json", "--pairs", "paper", "--method", "weights"), "leave out --pairs"),
        (("smile.json", "low", "-o", "o.fbx"), "must end in one of .glb, .obj, "),
        (("smile.json", "nobody", "-o", "o.json"), "no character 'nobody'"),
        (("smile.png", "low", "-o", "o.json"), "not a supported source"),
        (("none.json", "low", "-o", "o.json"), "cannot be read"),
        (("take.csv", "low", "-o", "o.obj"), "has 8 frames, but a '.obj' file holds one"),
        (("take.csv", "low", "-o", "o.json", "--frames", "99"), "has 8 frames, none"),
        (("take.csv", "low", "-o", "o.json", "--from", "creature"), "has none of the shapes"),
        (("bad.json", "low", "-o", "o.json"), "'bad.json'"),
    ],
)
def test_errors_are_sentences(
    tmp_path: Path,
    smile: Path,
    take: Path,
    words: tuple[str, ...],
    said: str,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "bad.json").write_text(
        '{"format": "faceposer.weights", "version": 1, "names": ["jawOpen"], "rate": 30, "frames": [[0.1, 0.2]]}'
    )
    assert run("transfer", *words) == 2
    shown = capsys.readouterr().err
    assert said in shown
    assert len([line for line in shown.splitlines() if "It has no weights of" not in line]) == 1
    assert not list(tmp_path.glob("o.*"))


def test_weights_of_another_tool_are_no_session(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    source, out = tmp_path / "mp.json", tmp_path / "out.json"
    source.write_text(json.dumps([{"jawOpen": i / 10} for i in range(10)]))
    assert run("transfer", source, "low", "-o", out, "--method", "weights") == 0
    assert "30 frames per second were assumed" in capsys.readouterr().err
    assert run("transfer", source, "low", "-o", out, "--method", "weights", "--rate", "24") == 0
    assert "assumed" not in capsys.readouterr().err
    animation = json.loads(out.read_text())
    assert (animation["rate"], len(animation["frames"])) == (24.0, 10)
