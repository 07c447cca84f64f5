"""``faceposer identity fit`` and ``learn``: characters and models of scans, or one sentence."""

import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from PIL import Image

from faceposer.identity.scans.basis import HeadBasis
from faceposer.identity.scans.head_from_scans import doubts, shipped_basis
from faceposer.model.character_file import load_character
from tests.command_line import run_captured

Capture = pytest.CaptureFixture[str]
SHRUNK = 0.1


@pytest.fixture(scope="module")
def basis() -> HeadBasis:
    """Return the basis of the shipped model."""
    return shipped_basis()


@pytest.fixture
def scan(tmp_path: Path, basis: HeadBasis) -> Path:
    """A scan of the mean head, in decimetres, with colours."""
    path = tmp_path / "scan.obj"
    rows = np.hstack([SHRUNK * basis.mean, np.tile([0.8, 0.5, 0.4], (len(basis.mean), 1))])
    lines = ["v " + " ".join(f"{value:.5f}" for value in row) for row in rows]
    lines += ["f " + " ".join(map(str, row)) for row in (basis.triangles + 1).tolist()]
    path.write_text("\n".join(lines) + "\n")
    return path


@pytest.fixture
def landmarks(tmp_path: Path, basis: HeadBasis) -> Path:
    """Its landmarks."""
    path = tmp_path / "points.json"
    places = basis.landmarks.positions(basis.mean, basis.triangles)
    data = {"format": "faceposer.landmarks", "version": 1, "kind": "mesh", "points": (SHRUNK * places).tolist()}
    path.write_text(json.dumps(data))
    return path


def test_a_scan_becomes_a_character(
    scan: Path, landmarks: Path, tmp_path: Path, capsys: Capture, basis: HeadBasis
) -> None:
    out, report, picture = tmp_path / "me.npz", tmp_path / "r.json", tmp_path / "d.png"
    words = ["identity", "fit", scan, "-o", out, "--landmarks", landmarks, "--report", report, "--no-detail"]
    status, said, errors = run_captured(capsys, *words, "--distance-map", picture, "--title", "Me")
    assert (status, errors) == (0, "")
    assert "100% of the face on the scan" in said
    character = load_character(str(out))
    for source in ("Made from 1 scan", "ICT-FaceKit", "Face Units 01"):
        assert character.credits.count(source) == 1, source
    assert character.title == "Me"
    skin = character.vertices[: len(basis.mean)]
    assert 10.0 * np.linalg.norm(skin - basis.mean, axis=1)[basis.trust > 0.9].mean() < 0.5
    assert character.textures["skin"] != load_character("man").textures["skin"]
    data = json.loads(report.read_text())
    assert data["surface_mm_median"] < 0.1
    assert data["scans"][0]["unit_cm"] == pytest.approx(1.0 / SHRUNK, rel=0.01)
    assert data["likelihood"] > 0.9
    with Image.open(picture) as image:
        assert image.width == 3 * 640


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("fit", "scan.txt", "-o", "me.npz"), "is not a mesh"),
        (("fit", "missing.obj", "-o", "me.npz"), "cannot be read"),
        (
            ("fit", "a.obj", "b.obj", "-o", "me.npz", "--landmarks", "p.json"),
            "--landmarks is given for 1 of 2 scans",
        ),
        (("fit", "a.obj", "-o", "me.obj"), "me.obj"),
        (("learn", ".", "-o", "model.npz"), "needs at least 3 scans"),
        (("info", "head.obj"), "'head.obj' is a mesh, not a character; make a character of a scan with"),
        (("new", "--base", "head.ply", "-o", "me.npz"), "'head.ply' is a mesh, not a character"),
        (("learn", "nowhere", "-o", "model.npz"), "is not a folder"),
        (("learn", ".", "-o", "model.npz", "--rounds", "0"), "not a whole number from 1"),
    ],
)
def test_bad_input_gets_one_sentence(
    words: tuple[str, ...], message: str, tmp_path: Path, capsys: Capture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    if "scan.txt" in words:
        Path("scan.txt").write_text("no")
    status, _, errors = run_captured(capsys, "identity", *words)
    assert status == 2
    assert message in errors
    assert errors.count("\n") == 1
    assert not list(tmp_path.glob("m*"))


@pytest.mark.parametrize("texture", ["scan.png", "skin.png"])
def test_textures_of_a_scan_are_inputs(tmp_path: Path, capsys: Capture, texture: str) -> None:
    scan, picture = tmp_path / "scan.obj", tmp_path / texture
    library = "mtllib scan.mtl\nusemtl a\n" if texture == "skin.png" else ""
    scan.write_text(f"{library}v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nf 1/1 2/2 3/3\n")
    (tmp_path / "scan.mtl").write_text("newmtl a\nmap_Kd skin.png\n")
    Image.new("RGB", (4, 4), (200, 150, 130)).save(picture)
    content = picture.read_bytes()
    for words in (
        ("identity", "fit", scan, "-o", tmp_path / "me.npz", "--distance-map", picture),
        ("landmarks", scan, "--image", picture),
        ("render", scan, "-o", picture),
    ):
        status, _, errors = run_captured(capsys, *words)
        assert (status, errors.count("\n")) == (2, 1)
        assert f"'{picture}' is also an input; give the output another name." in errors
    assert picture.read_bytes() == content


def test_landmarks_of_the_other_side_do_not_match(scan: Path, landmarks: Path, tmp_path: Path, capsys: Capture) -> None:
    data = json.loads(landmarks.read_text())
    data["points"] = [[-x, y, z] for x, y, z in data["points"]]
    landmarks.write_text(json.dumps(data))
    out = tmp_path / "me.npz"
    status, _, errors = run_captured(capsys, "identity", "fit", scan, "-o", out, "--landmarks", landmarks)
    assert (status, errors.count("\n")) == (2, 1)
    assert f"The landmarks in '{landmarks}' of the scan '{scan}' do not match it" in errors
    assert not out.exists()


def test_little_of_a_face_on_a_scan_is_said() -> None:
    def made(*shares: float) -> Any:
        names = ("a.obj", "b.obj")
        scans = [
            SimpleNamespace(scan=SimpleNamespace(name=n), report={"used": s})
            for n, s in zip(names, shares, strict=True)
        ]
        return SimpleNamespace(scans=tuple(scans))

    assert doubts(made(0.95, 0.8)) == ""
    assert doubts(made(0.95, 0.35)).startswith(
        "Little of the face lies on the scan: 35% on 'b.obj'. Check the landmarks"
    )


def test_a_full_disk_is_said_before_the_fit(
    scan: Path, tmp_path: Path, capsys: Capture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("shutil.disk_usage", lambda _: SimpleNamespace(total=1 << 30, free=2 << 20))
    words = ["identity", "fit", scan, "-o", tmp_path / "me.npz"]
    status, _, errors = run_captured(capsys, *words)
    assert (status, errors.count("\n")) == (2, 1)
    assert "has no room for 'me.npz': 2 MB are free, and up to 32 MB are needed; free some space, or choose" in errors
