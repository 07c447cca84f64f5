"""The commands that make characters and look after their files."""

import json
from pathlib import Path

import numpy as np
import pytest

from faceposer.geometry.mesh_io import read_mesh
from faceposer.geometry.obj_io import write_obj
from faceposer.model.character import ARKIT_SHAPES
from faceposer.model.character_file import load_character
from faceposer.training import expressions, mode_statistics
from tests.command_line import run_captured
from tests.training.faces import base, morph_mesh, write_examples


@pytest.fixture
def rig(tmp_path: Path) -> Path:
    folder = tmp_path / "rig"
    folder.mkdir()
    mesh = morph_mesh()
    write_obj(folder / "neutral.obj", mesh.mesh.vertices, mesh.mesh.polygons, groups=mesh.mesh.groups)
    for name, offsets in mesh.targets.items():
        write_obj(folder / f"{name}.obj", mesh.mesh.vertices + offsets, mesh.mesh.polygons)
    return folder


def write_capture(path: Path, count: int) -> Path:
    """Write a take of Live Link Face with ``count`` frames."""
    weights = 0.5 + 0.4 * np.sin(np.arange(count)[:, None] * np.linspace(0.05, 0.4, len(ARKIT_SHAPES)))
    header = ["Timecode", "BlendShapeCount", *(name[0].upper() + name[1:] for name in ARKIT_SHAPES)]
    rows = [["00:00:00:01", 61, *line] for line in weights.round(4).tolist()]
    path.write_text("\n".join(",".join(map(str, row)) for row in [header, *rows]) + "\n")
    return path


def test_a_rig_is_trained_described_posed_and_renamed(
    rig: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    output, summary = tmp_path / "my-face.npz", tmp_path / "summary"
    status, out, err = run_captured(
        capsys, "train", "--rig", rig, "-o", output, "--title", "My face", "--credits", "Mine", "--summary", summary
    )
    assert (status, err) == (0, "")
    assert f"My face ('my-face'): {len(base().vertices)} vertices" in out
    assert "of ARKit's 52 shapes" in out
    assert json.loads((summary / "summary.json").read_text())["summary"]["curves"]["compactness"]
    assert (summary / "summary.png").read_bytes().startswith(b"\x89PNG")
    assert sorted(path.name for path in summary.iterdir()) == ["summary.json", "summary.png"]

    status, out, _ = run_captured(capsys, "character", "info", output, "--json")
    about = json.loads(out)
    assert status == 0
    assert about["name"] == "my-face"
    assert about["statistics"] == "shipped"
    status, out, _ = run_captured(capsys, "character", "check", output)
    assert status == 0
    assert "can be posed" in out

    session = tmp_path / "smile.json"
    session.write_text(
        json.dumps({"format": "faceposer.session", "version": 1, "subject": "my-face.npz", "constraints": []})
    )
    status, _, err = run_captured(capsys, "solve", session, "-o", tmp_path / "smile.obj")
    assert (status, err) == (0, "")
    mesh = read_mesh(tmp_path / "smile.obj")
    np.testing.assert_array_equal(mesh.polygons, base().polygons)
    np.testing.assert_allclose(mesh.vertices, base().vertices, atol=1e-6)

    status, _, _ = run_captured(capsys, "character", "rename", output, "--name", "hero", "--shape", "jawOpen=JAW")
    assert status == 0
    renamed = load_character(output)
    assert renamed.name == "hero"
    assert "JAW" in renamed.shape_names
    assert renamed.title == "My face"


def test_examples_are_trained(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = tmp_path / "meshes"
    folder.mkdir()
    write_examples(folder, 14)
    output = tmp_path / "me.npz"
    status, out, err = run_captured(capsys, "train", "--examples", folder, "-o", output, "--dimensions", "8")
    assert (status, err) == (0, "")
    assert "15 examples, 8 modes" in out
    assert "did not converge" not in out
    character = load_character(output)
    assert character.statistics is not None
    old = character.shape_names[0]
    assert run_captured(capsys, "character", "rename", output, "--shape", f"{old}=first")[0] == 0
    renamed = load_character(output)
    assert renamed.statistics is not None
    assert renamed.statistics.shape_names[0] == "first"
    assert run_captured(capsys, "character", "check", output)[0] == 0


def test_a_prior_that_did_not_converge_is_reported(
    rig: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(mode_statistics, "_ITERATIONS", 1)
    monkeypatch.setattr(expressions, "_ITERATIONS", 1)
    folder = tmp_path / "meshes"
    folder.mkdir()
    write_examples(folder, 6)
    take = write_capture(tmp_path / "take.csv", 120)
    for source in (("--examples", folder), ("--rig", rig, "--capture", take, "--components", 2, "--factors", 2)):
        status, out, err = run_captured(
            capsys, "train", *source, "-o", tmp_path / "me.npz", "--summary", tmp_path / "about"
        )
        assert (status, err) == (0, "")
        (line,) = (line for line in out.splitlines() if "did not converge" in line)
        assert line.startswith("Note: The mixture of the prior did not converge within the iteration limit")
        summary = json.loads((tmp_path / "about" / "summary.json").read_text())["summary"]
        assert summary["prior"]["converged"] is False
        assert sum("did not converge" in warning for warning in summary["warnings"]) == 1


def test_lost_faces_in_captures_are_in_the_summary(
    rig: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    take = write_capture(tmp_path / "take.csv", 120)
    with take.open("a") as file:
        file.write("00:00:00:01,0\n" * 30)
    words = ("train", "--rig", rig, "--capture", take, "--components", 2, "--factors", 2, "-o", tmp_path / "me.npz")
    status, out, _ = run_captured(capsys, *words)
    assert status == 0
    assert "Note: The capture 'take.csv' has 30 frames without a face, which were left out." in out


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["train", "--rig", "nowhere.glb", "-o", "a.npz"], "'nowhere.glb' does not exist; check the path."),
        (["train", "--rig", "x.glb", "-o", "a.obj"], "The output 'a.obj' must end in '.npz'."),
        (["train", "-o", "a.npz"], "One of the arguments --rig --examples --markers is required"),
        (["train", "--rig", "x.glb", "--examples", "y", "-o", "a.npz"], "not allowed with"),
        (
            ["train", "--examples", ".", "--regions", "99", "-o", "a.npz"],
            "'99' is not 'face', 'whole' or a number from 2 to 12",
        ),
        (["train", "--examples", ".", "--dimensions", "0", "-o", "a.npz"], "'0' is not a number from 1 to 500"),
        (["train", "--examples", ".", "--capture", "a.csv", "-o", "a.npz"], "Performances (--capture)"),
        (["train", "--examples", ".", "-o", "a.npz"], "The folder '.' contains no meshes"),
        (["train", "--markers", "take.csv", "-o", "a.npz"], "need a map (--marker-map)"),
        (["character", "info", "nobody"], "There is no character 'nobody'"),
        (["character", "rename", "man", "--name", "x"], "'man' is not a character file"),
        (["character", "rename", "a.npz"], "No new name is given"),
        (["character", "rename", "a.npz", "--shape", "jawOpen"], "--shape 'jawOpen' must have the form OLD=NEW"),
        (["character", "check", "a.npz"], "There is no character file 'a.npz'"),
    ],
)
def test_what_cannot_be_is_said_in_one_sentence(
    words: list[str], said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "take.csv").write_text("frame,a.x,a.y,a.z\n0,1,2,3\n")
    status, out, err = run_captured(capsys, *words)
    assert status == 2
    assert out == ""
    assert said in err
    assert err.count("\n") == 1
    assert not list(tmp_path.glob("*.npz"))


def test_shapes_are_not_renamed_into_each_other(rig: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    output = tmp_path / "me.npz"
    assert run_captured(capsys, "train", "--rig", rig, "-o", output)[0] == 0
    before = output.read_bytes()
    status, _, err = run_captured(capsys, "character", "rename", output, "--shape", "jawOpen=jawLeft")
    assert status == 2
    assert "Two shapes would be called 'jawLeft'" in err
    status, _, err = run_captured(capsys, "character", "rename", output, "--shape", "smirk=jawOpen")
    assert "has no shape 'smirk'" in err
    assert output.read_bytes() == before


def test_wishes_and_data_that_are_too_little_are_refused(
    rig: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder, output = tmp_path / "meshes", tmp_path / "me.npz"
    folder.mkdir()
    paths = write_examples(folder, 5)
    status, _, err = run_captured(capsys, "train", "--examples", folder, "-o", output, "--components", "40")
    assert status == 2
    assert "40 factor analyzers are too many" in err
    capture = tmp_path / "take.csv"
    capture.write_text("Timecode,BlendShapeCount,JawOpen,EyeBlinkLeft\n" + "0,61,0.1,0.2\n" * 3)
    status, _, err = run_captured(capsys, "train", "--rig", rig, "--capture", capture, "-o", output)
    assert status == 2
    assert f"The capture '{capture}' has 3 frames with a face, too few to learn from" in err
    lines = paths[2].read_text().replace("v ", "v 1e300 ", 1)
    paths[2].write_text(lines)
    status, _, err = run_captured(capsys, "train", "--examples", folder, "-o", output)
    assert status == 2
    assert "frame2.obj' is too far away" in err
    assert err.count("\n") == 1
    assert not output.exists()


def test_two_examples_are_the_fewest(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_examples(tmp_path, 1)
    status, out, err = run_captured(capsys, "train", "--examples", tmp_path, "-o", tmp_path / "me.npz")
    assert (status, err) == (0, "")
    assert "2 examples are too few to judge the model" in out
    assert run_captured(capsys, "character", "check", tmp_path / "me.npz")[0] == 0
