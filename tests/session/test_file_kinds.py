"""Files that are no sessions are recognised, and messages name the command that opens them."""

import json
from pathlib import Path

import pytest

from faceposer.cli.remedies import remedy_for
from faceposer.errors import FacePoserError, NoSessionError
from faceposer.session.file_kinds import kind_of
from faceposer.session.opening import open_session
from tests.command_line import run_captured

FILES = {
    "take.csv": ("time,jawOpen\n0,0.5\n", "performance", "export CHARACTER --animation"),
    "cap.txt": ("bs,jawOpen\nk,0,0,0,0,0,0,0,0,0,0,0,0.5\n", "performance", "export CHARACTER --animation"),
    "markers.csv": ("time,8.3.x,8.3.y,8.3.z\n0,1,2,3\n", "trajectories", "animate CHARACTER"),
    "points.csv": ("a,b\n1,2\n", "table", "animate CHARACTER"),
    "a.c3d": ("", "trajectories", "train --markers"),
    "a.trc": ("", "trajectories", "train --markers"),
    "a.glb": ("", "rig", "train --rig"),
    "a.obj": ("", "mesh", "export CHARACTER --pose"),
    "a.heic": ("", "photo", "faceposer photo"),
    "weights.json": (json.dumps({"format": "faceposer.weights"}), "weights", "--animation"),
    "other.json": (json.dumps([{"jawOpen": 0.5}]), "weights", "--animation"),
    "points.json": (json.dumps({"format": "faceposer.trajectories"}), "trajectories", "animate CHARACTER"),
    "lines.svg": ("<svg/>", "drawing", "sketch CHARACTER"),
    "strokes.json": (json.dumps({"format": "faceposer.strokes"}), "drawing", "sketch CHARACTER"),
    "session.json": (json.dumps({"format": "faceposer.session"}), "", ""),
    "broken.json": ('{"format": "a\x01"}', "", ""),
    "unknown.xyz": ("", "", ""),
}


@pytest.mark.parametrize("name", FILES)
def test_kinds_and_their_commands(name: str, tmp_path: Path) -> None:
    text, kind, command = FILES[name]
    (tmp_path / name).write_text(text)
    assert kind_of(tmp_path / name) == kind
    assert command in remedy_for(tmp_path / name)
    with pytest.raises(FacePoserError) as caught:
        open_session(str(tmp_path / name))
    assert isinstance(caught.value, NoSessionError) == (name not in ("session.json", "broken.json"))


def test_folders_and_missing_files(tmp_path: Path) -> None:
    assert kind_of(tmp_path) == "folder"
    assert kind_of(tmp_path / "none.csv") == ""


def test_commands_name_the_right_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    take = tmp_path / "take.csv"
    take.write_text("time,jawOpen\n0,0.5\n")
    status, _, err = run_captured(capsys, "render", take, "-o", tmp_path / "a.png")
    assert status == 2
    assert "'faceposer export CHARACTER --animation FILE -o OUT.glb' applies a performance" in err
    status, _, err = run_captured(capsys, "render", "take", "-o", tmp_path / "a.png")
    assert status == 2
    assert "faceposer export" not in err


def test_rates_may_be_fractions(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    take = tmp_path / "take.csv"
    take.write_text("jawOpen\n" + "0.5\n" * 10)
    words = ("export", "low", "--animation", take, "-o", tmp_path / "a.json", "--rate")
    assert run_captured(capsys, *words, "30000/1001")[0] == 0
    assert json.loads((tmp_path / "a.json").read_text())["rate"] == pytest.approx(30000 / 1001)
    for wrong in ("30/0", "1/0.0000001", "abc", "1/2/3"):
        status, _, err = run_captured(capsys, *words, wrong)
        assert status == 2
        assert "or a fraction such as 30000/1001" in err
