"""The subcommands of ``faceposer identity`` that make and describe heads."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

import faceposer
from faceposer.geometry.mesh_io import read_mesh
from faceposer.model.character_file import load_character
from tests.command_line import run_captured


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("heads")


@pytest.fixture(scope="module")
def old(folder: Path) -> Path:
    """A character made by ``new``."""
    face = faceposer.new_head(4, {"age": 0.9, "nose-length": 0.5}, tone=1.5)
    return face.save_character(folder / "old.npz", "Old")


def values(capsys: pytest.CaptureFixture[str], what: object) -> dict[str, float]:
    """Return the values of attributes that ``info`` prints."""
    status, out, err = run_captured(capsys, "identity", "info", what, "--json")
    assert (status, err) == (0, "")
    return {name: entry["value"] for name, entry in json.loads(out)["attributes"].items()}


def test_new_heads_are_those_of_the_interface(capsys: pytest.CaptureFixture[str], old: Path, tmp_path: Path) -> None:
    words = ("--seed", 4, "--set", "age=0.9", "nose_length=0.5", "--tone", 1.5, "--title", "Old")
    status, out, _ = run_captured(capsys, "identity", "new", "-o", tmp_path / "me.npz", *words)
    assert status == 0
    assert "me.npz written" in out
    _, told, _ = run_captured(capsys, "identity", "info", tmp_path / "me.npz")
    found = [re.search(r"distance from the average:? ([.\d]+)", text) for text in (out, told)]
    assert found[0] is not None
    assert found[1] is not None
    assert found[0][1] == found[1][1]
    mine, theirs = load_character(tmp_path / "me.npz"), load_character(old)
    assert (mine.name, mine.title) == ("me", "Old")
    np.testing.assert_array_equal(mine.vertices, theirs.vertices)
    np.testing.assert_array_equal(mine.shapes, theirs.shapes)
    assert mine.textures == theirs.textures


def test_set_changes_what_is_named(capsys: pytest.CaptureFixture[str], old: Path, tmp_path: Path) -> None:
    before = values(capsys, old)
    status, *_ = run_captured(capsys, "identity", "set", old, "upper-lip=0.9", "-o", tmp_path / "b.npz")
    assert status == 0
    after = values(capsys, tmp_path / "b.npz")
    # The lips are closed again, which moves their vertices by up to a millimetre.
    assert after["upper-lip"] == pytest.approx(0.9, abs=0.1)
    assert after["face-width"] == pytest.approx(before["face-width"], abs=0.01)
    assert load_character(tmp_path / "b.npz").textures == load_character(old).textures


def test_mix_is_between_its_heads(capsys: pytest.CaptureFixture[str], old: Path, tmp_path: Path) -> None:
    status, *_ = run_captured(capsys, "identity", "mix", old, "woman", "--share", 0.25, "-o", tmp_path / "c.npz")
    assert status == 0
    mixed, ends = values(capsys, tmp_path / "c.npz"), [values(capsys, what) for what in (old, "woman")]
    for name in ("gender", "nose-width", "face-length", "jaw-width"):
        assert mixed[name] == pytest.approx(0.75 * ends[0][name] + 0.25 * ends[1][name], abs=0.05), name


def test_info_describes_sessions_and_characters(capsys: pytest.CaptureFixture[str], old: Path, tmp_path: Path) -> None:
    face = faceposer.new_head(2, variety=0.0, texture="old-dark-male")
    face.save(tmp_path / "s.json")
    status, out, err = run_captured(capsys, "identity", "info", tmp_path / "s.json")
    assert (status, err) == (0, "")
    assert "distance from the average: 0.00" in out
    assert "skin: of the model, tone" in out
    status, out, err = run_captured(capsys, "identity", "info", old)
    assert out.startswith("Old ('old')")
    assert "the character's own image" in out
    assert "nose-length" in out


def test_sessions_with_a_head_are_exported(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    face = faceposer.new_head(2)
    face.set_weights({"jawOpen": 0.6})
    face.save(tmp_path / "s.json")
    assert run_captured(capsys, "export", tmp_path / "s.json", "-o", tmp_path / "s.obj")[0] == 0
    assert np.abs(read_mesh(tmp_path / "s.obj").vertices - face.vertices).max() < 1e-3


@pytest.mark.gl
def test_sessions_with_a_head_are_drawn(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    from PIL import Image

    pictures = []
    for name, face in (("man", faceposer.load("man")), ("other", faceposer.new_head(2, tone=2.0))):
        face.save(tmp_path / f"{name}.json")
        words = ("render", tmp_path / f"{name}.json", "-o", tmp_path / f"{name}.png", "--size", "96x96")
        assert run_captured(capsys, *words)[0] == 0
        pictures.append(np.asarray(Image.open(tmp_path / f"{name}.png")).astype(float))
    assert np.abs(pictures[1] - pictures[0]).mean() > 5.0


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("new", "--set", "nose-lenght=.1"), "did you mean 'nose-length'"),
        (("new", "--set", "age=9"), "from -0.8 to 1.4, not 9"),
        (("new", "--set", "age=nan"), "NAME=NUMBER"),
        (("new", "--set", "age"), "NAME=NUMBER"),
        (("new", "--set", "age=.1", "age=.2"), "twice"),
        (("new", "--set", "nose-length=.1", "nose_length=.2"), "twice"),
        (("new", "--set", "african=.1", "asian=.1", "caucasian=.1"), "add up to 0"),
        (("new", "--seed", "1.5"), "whole number"),
        (("new", "--variety", "inf"), "from 0 to 2"),
        (("new", "--caricature", "9"), "from 0 to 2.5"),
        (("new", "--tone", "x"), "from -2.5 to 2.5"),
        (("new", "--texture", "green"), "no skin 'green'"),
        (("new", "--segments", "chin"), "no segment 'chin'"),
        (("new", "--base", "creature"), "cannot be edited"),
        (("new", "--title", " "), "--title must have"),
        (("new", "--name", "../../x"), "--name cannot be a path such as '../../x'; give a name such as 'my-head'"),
        (("mix", "man", "woman", "--name", ".."), "--name cannot be a path"),
        (("set", "man", "age=.5", "--name", "c:x"), "--name cannot be a path"),
        (("new", "--name", "Man"), "--name cannot be 'Man', which is a built-in character; give another name"),
        (("fit", "bad.obj", "--name", "a/b"), "--name cannot be a path"),
        (("fit-photo", "bad.jpg", "--name", "a\\b"), "--name cannot be a path"),
        (("set", "man"), "No change is given"),
        (("set", "low", "age=.5"), "cannot be edited"),
        (("set", "missing.npz", "age=.5"), "no character file 'missing.npz'"),
        (("set", "bad.npz", "age=.5"), "bad.npz"),
        (("mix", "man", "nobody"), "nobody"),
        (("mix", "man", "woman", "--share", "2"), "from 0 to 1"),
    ],
)
def test_bad_input_gets_one_sentence_and_no_file(
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    words: tuple[str, ...],
    message: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("bad.npz").write_bytes(b"PK\x03\x04")
    status, out, err = run_captured(capsys, "identity", words[0], "-o", "out.npz", *words[1:])
    assert (status, out) == (2, "")
    assert message in err
    assert err.count("\n") == 1
    assert [path.name for path in tmp_path.iterdir()] == ["bad.npz"]


@pytest.mark.parametrize("words", [("new",), ("set", "woman", "age=.5"), ("fit", "x.obj"), ("fit-photo", "x.jpg")])
def test_a_file_does_not_get_the_name_of_a_built_in_character(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, words: tuple[str, ...]
) -> None:
    status, _, err = run_captured(capsys, "identity", *words, "-o", tmp_path / "Man.npz")
    assert status == 2
    assert "would be called 'Man', as a built-in one" in err
    assert not list(tmp_path.iterdir())


def test_outputs_do_not_replace_inputs(capsys: pytest.CaptureFixture[str], old: Path) -> None:
    content = old.read_bytes()
    for words in (("set", old, "age=.5"), ("mix", "man", old), ("new", "--base", old)):
        status, _, err = run_captured(capsys, "identity", *words, "-o", old)
        assert status == 2
        assert "also an input" in err
    assert old.read_bytes() == content
    status, _, err = run_captured(capsys, "identity", "new", "-o", old.parent / "no" / "x.npz")
    assert status == 2
    assert "does not exist" in err
