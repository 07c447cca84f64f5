"""Rigs, meshes and pictures of public bug reports (FACEPOSER_CASES), each of which was once read wrongly."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.command_line import run_captured

CASES = Path(os.environ.get("FACEPOSER_CASES", ""))
needs_cases = pytest.mark.skipif("FACEPOSER_CASES" not in os.environ, reason="FACEPOSER_CASES is not set")


@needs_cases
@pytest.mark.parametrize(
    ("case", "said"),
    [
        ("rigs/cc3mixed.glb", "52 of ARKit's 52 shapes"),
        ("rigs/cc3mixed.glb", "without their prefix 'A#_'"),
        ("rigs/suffix.glb", "52 of ARKit's 52 shapes"),
        ("rigs/scaled", "scaled by 100 against the neutral face"),
        ("rigs/hashfew", "parts: head #1, head #2, eye_right"),
        ("rigs/cont", "10 of ARKit's 52 shapes"),
        ("rigs/umlaut", "Zähne_顔"),
    ],
)
def test_rigs(case: str, said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    status, out, err = run_captured(capsys, "train", "--rig", CASES / case, "-o", tmp_path / "o.npz")
    assert (status, err) == (0, "")
    assert said in out
    assert run_captured(capsys, "character", "check", tmp_path / "o.npz")[0] == 0


@needs_cases
@pytest.mark.parametrize("encoding", ["cp1252", "ascii", "utf-8"])
def test_a_console_that_lacks_a_character(encoding: str, tmp_path: Path) -> None:
    words = ["train", "--rig", str(CASES / "rigs/umlaut"), "-o", str(tmp_path / "o.npz")]
    done = subprocess.run(
        [sys.executable, "-m", "faceposer", *words],
        env={**os.environ, "PYTHONIOENCODING": encoding},
        capture_output=True,
        check=False,
    )
    assert (done.returncode, done.stderr) == (0, b"")
    assert b"parts: Z" in done.stdout


@needs_cases
def test_clips_pictures_and_folders(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    other = CASES / "other"
    for words, said in (
        (
            ("export", "low", "--animation", CASES / "rigs/action_per_mesh.glb", "-o", tmp_path / "a.json"),
            "were merged",
        ),
        (("photo", "woman", other / "exif6.tif", "--pins", other / "pins.json", "-o", tmp_path / "t.json"), "10 pins"),
        (("train", "--examples", other / "mac_examples", "-o", tmp_path / "m.npz"), "3 examples"),
    ):
        status, out, err = run_captured(capsys, *words)
        assert status == 0
        assert said in out + err


@needs_cases
@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("train", "--examples", "examples_encrypted.npz"), "is encrypted"),
        (("train", "--examples", "examples_memoryerror.npz"), "must be vertex numbers"),
        (("train", "--examples", "examples_tokenerror.npz"), "no readable header"),
        (("train", "--examples", "set_case_clash"), "is not an expression of the neutral"),
        (("character", "check", "subject-fc31c308.npz"), "cannot be used"),
    ],
)
def test_hostile_archives_get_one_sentence(
    words: tuple[str, ...], said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    output = ("-o", tmp_path / "o.npz") if words[0] == "train" else ()
    status, out, err = run_captured(capsys, *words[:2], CASES / "hostile" / words[2], *output)
    assert (status, out) == (2, "")
    assert said in err
    assert err.count("\n") == 1
    assert not (tmp_path / "o.npz").exists()
