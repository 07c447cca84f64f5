"""``faceposer photo``: a session with photo, camera and pose, or one sentence."""

import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from faceposer.geometry.camera import Camera
from faceposer.model.face_model import FaceModel
from faceposer.photo.places import GUIDED
from faceposer.session.document import read_document
from tests.command_line import run

CAMERA = Camera(np.diag([1.0, -1.0, -1.0]), np.array([3.0, -2.0, 120.0]), 900.0, (400, 300))
Capture = pytest.CaptureFixture[str]


@pytest.fixture
def files(model: FaceModel, tmp_path: Path) -> tuple[Path, Path]:
    """A photo, and pins on it of the man who smiles."""
    Image.new("RGB", (400, 300), (90, 90, 90)).save(tmp_path / "face.png")
    vertices = model.instance(model.coefficients_of({"mouthSmileLeft": 0.8, "mouthSmileRight": 0.8}))
    seen = CAMERA.project(vertices[[model.character.feature_points[name] for name in GUIDED]]).tolist()
    pins = [{"point": name, "pixel": pixel} for name, pixel in zip(GUIDED, seen, strict=True)]
    data = {"format": "faceposer.pins", "version": 1, "pins": [*pins, {"point": "99.1", "pixel": [1, 1]}]}
    (tmp_path / "pins.json").write_text(json.dumps(data))
    return tmp_path / "face.png", tmp_path / "pins.json"


@pytest.mark.gl
def test_photo_writes_a_session_and_a_picture(files: tuple[Path, Path], tmp_path: Path, capsys: Capture) -> None:
    photo, pins = files
    out, picture = tmp_path / "out.json", tmp_path / "out.png"
    assert run("photo", "man", photo, "--pins", pins, "-o", out, "--focal", 900, "--render", picture) == 0
    said = capsys.readouterr().out
    assert "left mouth corner" in said
    assert "99.1" in said
    document = read_document(out)
    (written,) = document.photos
    assert written.path == "face.png"
    assert written.camera is not None
    assert document.camera == written.camera
    assert written.camera.focal == 900.0
    np.testing.assert_allclose(written.camera.rotation, CAMERA.rotation, atol=0.03)
    assert len(document.constraints) > 10
    assert document.coefficients is not None
    assert np.any(document.coefficients)
    with Image.open(picture) as image:
        assert image.size == (1440, 600)
    assert run("photo", out, photo, "--pins", pins, "-o", tmp_path / "two.json", "--no-pose") == 0
    assert len(read_document(tmp_path / "two.json").photos) == 2
    assert len(read_document(tmp_path / "two.json").constraints) == len(document.constraints)


def test_photo_refuses_in_one_sentence_and_writes_nothing(
    files: tuple[Path, Path], tmp_path: Path, capsys: Capture
) -> None:
    photo, pins = files
    few = tmp_path / "few.json"
    data = json.loads(pins.read_text())
    few.write_text(json.dumps(data | {"pins": data["pins"][:3]}))
    outside = tmp_path / "outside.json"
    pinned = [data["pins"][0], data["pins"][1] | {"pixel": [401, 20]}, *data["pins"][2:]]
    outside.write_text(json.dumps(data | {"pins": pinned}))
    cut = tmp_path / "cut.jpg"
    Image.effect_noise((400, 300), 50).convert("RGB").save(cut)
    cut.write_bytes(cut.read_bytes()[:-9000])
    out, before = tmp_path / "out.json", (photo.read_bytes(), pins.read_bytes())
    for arguments, words in (
        (("man", photo, "--pins", few, "-o", out), "aligning the camera needs at least 4"),
        (("man", tmp_path / "none.jpg", "--pins", pins, "-o", out), "There is no photo"),
        (("man", photo, "--pins", tmp_path / "none.json", "-o", out), "There is no file of pins"),
        (("man", photo, "--pins", pins, "-o", out, "--focal", -3), "focal length"),
        (("nobody", photo, "--pins", pins, "-o", out), "neither a character"),
        (("man", photo, "--pins", pins, "-o", pins), "is also an input"),
        (("man", photo, "--pins", pins, "-o", out, "--render", photo), "is also an input"),
        (("man", photo, "--pins", outside, "-o", out), "pins[1] is at (401, 20), outside the photo of 400 x 300"),
        (("man", cut, "--pins", pins, "-o", out), "cut.jpg' is damaged and cannot be read"),
    ):
        assert run("photo", *arguments) == 2
        told = capsys.readouterr()
        assert words in told.err
        assert told.err.count("\n") == 1
        assert not out.exists()
        assert (photo.read_bytes(), pins.read_bytes()) == before


def test_pins_that_no_view_shows_are_told(files: tuple[Path, Path], tmp_path: Path, capsys: Capture) -> None:
    photo, pins = files
    out = tmp_path / "out.json"
    assert run("photo", "man", photo, "--pins", pins, "-o", out) == 0
    assert "No camera explains" not in capsys.readouterr().out
    data = json.loads(pins.read_text())
    turned = [pin["pixel"] for pin in data["pins"]][::-1]
    shuffled = [pin | {"pixel": pixel} for pin, pixel in zip(data["pins"], turned, strict=True)]
    pins.write_text(json.dumps(data | {"pins": shuffled}))
    assert run("photo", "man", photo, "--pins", pins, "-o", out) == 0
    assert "No camera explains these pins" in capsys.readouterr().out


def test_pins_at_one_pixel_write_nothing(files: tuple[Path, Path], tmp_path: Path, capsys: Capture) -> None:
    photo, pins = files
    data = json.loads(pins.read_text())
    for pin in data["pins"]:
        pin["pixel"] = [200.0, 150.0]
    pins.write_text(json.dumps(data))
    assert run("photo", "man", photo, "--pins", pins, "-o", tmp_path / "out.json") == 2
    assert "all pins are at (200, 150); give each its own place" in capsys.readouterr().err
    assert not (tmp_path / "out.json").exists()
