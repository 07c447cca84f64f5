"""``faceposer identity fit-photo`` and ``faceposer photo --auto``."""

import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from faceposer.model.character_file import load_character
from faceposer.session.document import read_document
from tests.command_line import run
from tests.landmarks.photos import astronaut

Capture = pytest.CaptureFixture[str]


@pytest.fixture
def photo(tmp_path: Path) -> Path:
    path = tmp_path / "me.png"
    Image.fromarray(astronaut()).save(path)
    return path


def test_a_photo_becomes_a_character_with_a_session(photo: Path, tmp_path: Path, capsys: Capture) -> None:
    out, report, session = tmp_path / "me.npz", tmp_path / "r.json", tmp_path / "s.json"
    arguments = ("-o", out, "--report", report, "--session", session, "--landmarks-only", "--title", "Me")
    assert run("identity", "fit-photo", photo, *arguments) == 0
    assert "me.npz written from 1 photo" in capsys.readouterr().out
    character = load_character(str(out))
    for source in ("made from 1 photo", "ICT-FaceKit", "Skins: MakeHuman", "Face Units 01"):
        assert character.credits.count(source) == 1, source
    assert (character.name, character.title) == ("me", "Me")
    measured = json.loads(report.read_text())
    assert 0.0 < measured["photos"][0]["landmark_px"] < 3.0
    assert measured["refined"] is False
    document = read_document(session)
    assert document.photos[0].camera is not None
    assert document.coefficients.any()
    # The nose is where the photo has it.
    nose = character.vertices[[character.feature_points["9.3"]]]
    assert np.abs(document.photos[0].camera.project(nose) - (224.4, 128.0)).max() < 8.0


def test_the_expression_of_a_photo_is_taken_without_pins(photo: Path, tmp_path: Path, capsys: Capture) -> None:
    out = tmp_path / "s.json"
    assert run("photo", "man", photo, "--auto", "-o", out) == 0
    assert "mouthSmile" in capsys.readouterr().out
    document = read_document(out)
    assert document.photos[0].pins
    assert document.coefficients.any()


def test_a_photo_without_a_face_gets_one_sentence(tmp_path: Path, capsys: Capture) -> None:
    path = tmp_path / "wall.png"
    Image.new("RGB", (200, 200), (120, 110, 100)).save(path)
    assert run("identity", "fit-photo", path, "-o", tmp_path / "me.npz") == 2
    error = capsys.readouterr().err
    assert "No face was found" in error
    assert len(error.strip().splitlines()) == 1
    assert not (tmp_path / "me.npz").exists()


def test_outputs_of_one_name_are_refused_and_inputs_kept(photo: Path, tmp_path: Path, capsys: Capture) -> None:
    (tmp_path / "w").mkdir()
    out, one, same = tmp_path / "me.npz", tmp_path / "ok.json", tmp_path / "w" / ".." / "ok.json"
    for words in (
        ("identity", "fit-photo", photo, "-o", out, "--session", one, "--report", same),
        ("landmarks", photo, "-o", one, "--pins", same),
    ):
        assert run(*words) == 2
        assert "given for two outputs" in " ".join(capsys.readouterr().err.split())
    assert not out.exists()
    assert not one.exists()


def test_of_two_faces_one_is_taken_and_said(tmp_path: Path, capsys: Capture) -> None:
    both, out = tmp_path / "both.png", tmp_path / "s.json"
    one = astronaut()
    Image.fromarray(np.hstack([one, one[:, ::-1]])).save(both)
    assert run("photo", "man", both, "--auto", "-o", out, "--no-pose") == 0
    said = " ".join(capsys.readouterr().err.split())
    assert "both.png: 2 faces were found; the most distinct one, at (" in said
    place = float(said.split("at (")[1].split(",")[0])
    eyes = [pin.pixel[0] for pin in read_document(out).photos[0].pins]
    assert min(eyes) < place < max(eyes)


def test_a_photo_that_is_given_twice_is_refused(photo: Path, tmp_path: Path, capsys: Capture) -> None:
    again = tmp_path / "again.png"
    again.symlink_to(photo)
    assert run("identity", "fit-photo", photo, again, "-o", tmp_path / "me.npz") == 2
    assert "again.png' is given twice; give each photo once." in capsys.readouterr().err
    assert not (tmp_path / "me.npz").exists()
