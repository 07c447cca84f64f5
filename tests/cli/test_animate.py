"""``faceposer animate`` from a file of trajectories to a file of weights, and what it refuses."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

from faceposer.animation import following
from faceposer.geometry.camera import OrbitView
from faceposer.model.face_model import FaceModel
from tests.command_line import run
from tests.film.conftest import frames_folder, speaking

__all__ = ["frames_folder", "speaking"]

Capture = pytest.CaptureFixture[str]
NAMES = ("8.3", "8.4", "8.1", "8.2", "2.10")


@pytest.fixture
def jaw(model: FaceModel, tmp_path: Path) -> Path:
    """The mouth of a face in a picture while the jaw opens, beside the picture's camera."""
    character = model.character
    camera = OrbitView.preset(character.vertices.min(axis=0), character.vertices.max(axis=0)).camera((800, 800))
    vertices = [character.feature_points[name] for name in NAMES]
    lines = ["time," + ",".join(f"{name}.{axis}" for name in NAMES for axis in "xy")]
    for i, strength in enumerate(np.linspace(0.0, 0.8, 15)):
        pixels = camera.project(model.instance(model.coefficients_of({"jawOpen": strength}))[vertices])
        if i == 7:
            pixels[4] += 60.0
        cells = ["" if i == 4 else f"{x:.2f}" for x in pixels.ravel()]
        lines.append(",".join([f"{i / 30.0:.4f}", *cells]))
    (tmp_path / "jaw.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    (tmp_path / "camera.json").write_text('{"view": "front", "size": [800, 800]}', encoding="utf-8")
    return tmp_path / "jaw.csv"


def test_a_table_of_pixels_becomes_an_animation(jaw: Path, tmp_path: Path, capsys: Capture) -> None:
    out = tmp_path / "jaw.json"
    assert run("animate", "man", jaw, "--camera", tmp_path / "camera.json", "-o", out) == 0
    said = capsys.readouterr()
    assert re.search(r"15 frames at 30 fps, mean error 0\.[1-5] px, 1 of them without points", said.out)
    assert "jumps removed: 1" in said.out
    assert said.err == ""
    data = json.loads(out.read_text())
    assert data["rate"] == 30.0
    opening = np.array(data["frames"])[:, data["names"].index("jawOpen")]
    assert opening.shape == (15,)
    assert opening[-1] > 0.4
    assert (np.diff(opening) > -0.02).all()


def test_options_reach_the_solver(jaw: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    asked: dict[str, object] = {}
    solve = following.solve_trajectories

    def watched(model: FaceModel, trajectories: object, **options: object) -> object:
        asked.update(options, trajectories=trajectories)
        return solve(model, trajectories, **options)

    monkeypatch.setattr(following, "solve_trajectories", watched)
    words = ["--camera", tmp_path / "camera.json", "--points", "8.4, 2.10", "--rate", "60", "--keep-jumps"]
    words += [
        "--smoothness",
        "2.5",
        "--prior-weight",
        "0.5",
        "--prior",
        "whole",
        "--spread",
        "0.25",
        "-o",
        tmp_path / "jaw.json",
    ]
    assert run("animate", "man", jaw, *words) == 0
    assert (asked["smoothness"], asked["prior_weight"], asked["prior"]) == (2.5, 0.5, "whole")
    assert asked["spread"] == 0.25
    assert asked["trajectories"].names == ("8.4", "2.10")
    assert asked["trajectories"].rate == 60.0
    assert asked["trajectories"].seen[7].all()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["man", "jaw.csv", "-o", "a.json"], "give the camera of the images with --camera"),
        (["man", "none.csv", "-o", "a.json"], "cannot be read"),
        (["nobody", "jaw.csv", "-o", "a.json"], "nobody"),
        (["man", "jaw.csv", "-o", "a.txt"], "must end in"),
        (["man", "jaw.csv", "-o", "no/a.json"], "does not exist"),
        (["man", "jaw.csv", "-o", "a.json", "--camera", "none.json"], "camera 'none.json' cannot be read"),
        (["man", "jaw.csv", "-o", "a.json", "--camera", "camera.json", "--points", "9.9"], "has no point 9.9"),
        (["man", "jaw.csv", "-o", "a.json", "--markers", "none.json"], "marker map 'none.json' cannot be read"),
        (["man", "jaw.csv", "-o", "a.json", "--smoothness", "-1"], "not a number from 0"),
        (["man", "jaw.csv", "-o", "a.json", "--rate", "nan"], "not a number from 0.001"),
        (["man", "jaw.csv", "-o", "a.json", "--rate", "1001"], "not a number from 0.001 to 1000"),
        (["man", "jaw.csv", "-o", "jaw.csv", "--camera", "camera.json"], "is also an input"),
        (["man", "jaw.csv", "-o", "camera.json", "--camera", "camera.json"], "is also an input"),
    ],
)
def test_what_it_cannot_use_gets_one_sentence(
    jaw: Path, monkeypatch: pytest.MonkeyPatch, capsys: Capture, words: list[str], said: str
) -> None:
    monkeypatch.chdir(jaw.parent)
    before = sorted(path.name for path in jaw.parent.iterdir())
    assert run("animate", *words) == 2
    error = capsys.readouterr().err
    assert said in error
    assert error.count("\n") == 1
    assert sorted(path.name for path in jaw.parent.iterdir()) == before


def test_an_interrupt_leaves_what_was_there(jaw: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    out = tmp_path / "old.json"
    out.write_text("old", encoding="utf-8")

    def interrupted(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(following, "smooth_poses", interrupted)
    before = sorted(path.name for path in tmp_path.iterdir())
    assert run("animate", "man", jaw, "--camera", tmp_path / "camera.json", "-o", out) == 130
    assert out.read_text(encoding="utf-8") == "old"
    assert sorted(path.name for path in tmp_path.iterdir()) == before


def test_times_in_milliseconds_and_missing_rows_are_said(jaw: Path, tmp_path: Path, capsys: Capture) -> None:
    header, *lines = jaw.read_text().splitlines()
    rows = [f"{40 * i}{line[line.index(',') :]}" for i, line in enumerate(lines) if i not in (9, 10)]
    jaw.write_text("\n".join([header, *rows]))
    out = tmp_path / "jaw.json"
    assert run("animate", "man", jaw, "--camera", tmp_path / "camera.json", "-o", out) == 0
    said = capsys.readouterr()
    assert "15 frames at 25 fps" in said.out
    assert "read as milliseconds" in said.err
    assert "2 of its 15 frames are missing" in said.err
    assert json.loads(out.read_text())["rate"] == 25.0


def test_a_film_becomes_an_animation_with_session_and_report(
    frames_folder: Path, tmp_path: Path, capsys: Capture
) -> None:
    out, session, report = (tmp_path / name for name in ("o.csv", "s.json", "r.json"))
    words = ("--landmarks-only", "--rate", "25", "--session", session, "--report", report)
    assert run("animate", "man", frames_folder, *words, "-o", out, "--from", "0:00", "--to", "0.32") == 0
    said = capsys.readouterr()
    assert re.search(r"o\.csv written: 8 frames at 25 fps, landmarks [0-4]\.\d px off the person's head", said.out)
    assert said.err == ""
    assert len(out.read_text().splitlines()) == 9
    measured = json.loads(report.read_text())
    assert [frame["frame"] for frame in measured["frames"]] == list(range(8))
    assert set(measured["frames"][0]) == {"frame", "time", "landmark_px", "yaw", "pitch", "roll", "place"}
    animation = json.loads(session.read_text())["animation"]
    assert (animation["rate"], animation["length"]) == (25.0, 8)
    assert 2 <= len(animation["keys"]) <= 8


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("{film}", "--to", "1", "--from", "2"), "--to 1 is not after --from 2"),
        (("{film}", "--points", "8.3"), "--points is for trajectories, not for films"),
        (("{film}", "--prior", "whole"), "--prior is for trajectories, not for films"),
        (("{film}", "--from", "x"), "'x' is no time in seconds such as 12.5, nor"),
        (("{film}", "--session", "{out}"), "is given for two outputs"),
        (("{film}", "--from", "100"), "choose a part that begins before its end"),
        (("{jaw}", "--to", "1"), "are for films, not for trajectories"),
        (("{none}",), "There is no film"),
        (("{nowhere}",), "There is no film, folder or file of trajectories"),
        (("{picture}",), "is neither a film nor trajectories; give a video, an animated .gif, a folder of pictures"),
    ],
)
def test_films_and_options_that_do_not_fit_are_refused(
    words: tuple[str, ...], message: str, frames_folder: Path, jaw: Path, tmp_path: Path, capsys: Capture
) -> None:
    pytest.importorskip("av", reason="the extra 'film' is not installed")
    out = tmp_path / "out.json"
    picture = tmp_path / "ok.jpg"
    picture.write_bytes(b"\xff\xd8\xff" + bytes(20))
    named = {"film": frames_folder, "jaw": jaw, "none": tmp_path / "none.mp4", "out": out}
    named |= {"nowhere": tmp_path / "nowhere", "picture": picture}
    assert run("animate", "man", *(word.format(**named) for word in words), "-o", out) == 2
    assert message in " ".join(capsys.readouterr().err.split())
    assert not out.exists()
