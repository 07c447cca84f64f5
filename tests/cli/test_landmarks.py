"""``faceposer landmarks``: points of photos and meshes as files and pictures, or one sentence."""

import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from faceposer.landmarks.points import N_POINTS
from faceposer.photo.pins_file import read_pins
from tests.command_line import run_captured
from tests.landmarks.photos import grace_hopper

Capture = pytest.CaptureFixture[str]


@pytest.fixture
def photo(tmp_path: Path) -> Path:
    """A photo with a face."""
    path = tmp_path / "face.png"
    Image.fromarray(grace_hopper()).save(path)
    return path


def test_photo(photo: Path, tmp_path: Path, capsys: Capture) -> None:
    out, image, pins = tmp_path / "p.json", tmp_path / "p.png", tmp_path / "pins.json"
    status, said, errors = run_captured(capsys, "landmarks", photo, "-o", out, "--image", image, "--pins", pins)
    assert (status, errors) == (0, "")
    assert "score" in said
    data = json.loads(out.read_text())
    assert (data["format"], data["version"], data["kind"], data["size"]) == (
        "faceposer.landmarks",
        1,
        "photo",
        [512, 600],
    )
    (face,) = data["faces"]
    assert np.shape(face["points"]) == (N_POINTS, 3)
    assert np.shape(face["iris"]) == (2, 5, 3)
    assert len(face["feature_points"]) == len(read_pins(pins)) > 40
    with Image.open(image) as picture:
        drawn = np.asarray(picture)
    assert (drawn == (60, 230, 90)).all(axis=2).sum() > 1000


def test_all_faces_of_a_photo(photo: Path, tmp_path: Path, capsys: Capture) -> None:
    out = tmp_path / "p.json"
    assert run_captured(capsys, "landmarks", photo, "--all", "-o", out)[0] == 0
    assert len(json.loads(out.read_text())["faces"]) == 1


def test_character_and_mesh(tmp_path: Path, capsys: Capture) -> None:
    mesh, out, image = tmp_path / "low.obj", tmp_path / "m.json", tmp_path / "m.png"
    assert run_captured(capsys, "export", "low", "-o", mesh)[0] == 0
    status, said, _ = run_captured(capsys, "landmarks", mesh, "-o", out, "--image", image)
    assert status == 0
    assert "left mouth corner" in said
    data = json.loads(out.read_text())
    assert data["kind"] == "mesh"
    assert len(data["points"]) == N_POINTS
    assert len(data["feature_points"]) == 66
    with Image.open(image) as drawn:
        assert drawn.size == (4000, 800)


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["grey.png"], "No face was found"),
        (["missing.jpg"], "There is no photo"),
        (["flat.obj"], "No face was found"),
        (["grey.png", "-o", "out.txt"], "must end in"),
        (["low", "--pins", "pins.json"], "Pins are for photos"),
    ],
)
def test_one_sentence(
    words: list[str], sentence: str, tmp_path: Path, capsys: Capture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Image.new("RGB", (200, 150), (90, 90, 90)).save("grey.png")
    Path("flat.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    status, _, errors = run_captured(capsys, "landmarks", *words)
    assert status == 2
    assert sentence in errors
    assert errors.count("\n") == 1
