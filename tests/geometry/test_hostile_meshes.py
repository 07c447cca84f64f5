"""Meshes with extreme numbers or of extreme size are refused in one sentence, before they take memory."""

import tracemalloc
from pathlib import Path

import numpy as np
import pytest

from faceposer.errors import FacePoserError
from faceposer.geometry import mesh_io
from faceposer.geometry.mesh import FARTHEST, first_unusable
from faceposer.geometry.mesh_io import read_mesh

CUBE = (
    "".join(f"v {x} {y} {z}\n" for x in (0, 1) for y in (0, 1) for z in (0, 1)) + "vt 0 0\nvn 0 0 1\nf 1 2 4\nf 5 7 8\n"
)


def refused(path: Path) -> str:
    with pytest.raises(FacePoserError) as caught:
        read_mesh(path)
    said = str(caught.value)
    assert said.startswith("The mesh") or said.split(maxsplit=1)[0] in ("Vertex", "Normal", "Texture")
    assert str(path) in said
    assert said.isprintable()
    return said


@pytest.mark.parametrize("number", ["1e300", "-1e39", "1e13", "nan", "inf", "-inf", "1e999"])
@pytest.mark.parametrize(
    ("line", "noun"), [("v 1 1 1", "Vertex 8"), ("vn 0 0 1", "Normal 1"), ("vt 0 0", "Texture coordinate 1")]
)
def test_numbers_out_of_range(tmp_path: Path, number: str, line: str, noun: str) -> None:
    path = tmp_path / "a.obj"
    words = line.split()
    textured = CUBE.replace("f 1 2 4", "f 1/1/1 2/1/1 4/1/1").replace("f 5 7 8", "f 5/1/1 7/1/1 8/1/1")
    path.write_text(textured.replace(line, " ".join([*words[:-1], number])))
    said = refused(path)
    assert noun in said
    assert ("too far away" in said) == (abs(float(number)) < float("inf"))


@pytest.mark.parametrize("word", ["x", "1/1/1", "0x1", "1,5", "\x1b[31m", "é" * 500, "9" * 5000])
def test_words_of_libraries_are_not_shown(tmp_path: Path, word: str) -> None:
    path = tmp_path / "a.obj"
    for line in ("f 1 2 4", "v 1 1 1"):
        path.write_text(CUBE.replace(line, " ".join([*line.split()[:-1], word])))
        if word == "1/1/1" and line[0] == "f":
            continue
        said = refused(path)
        assert "could not convert" not in said
        assert "invalid literal" not in said
        assert len(said) < 400


@pytest.mark.parametrize("end", ["\n", "\r\n"])
def test_far_too_many_lines_are_refused_at_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, end: str) -> None:
    monkeypatch.setattr(mesh_io, "_MAX_LINES", 1000)
    path = tmp_path / "a.obj"
    path.write_text(CUBE + "# a comment\n" * 900)
    assert len(read_mesh(path).vertices) == 8
    with path.open("w", newline="") as file:
        file.write(f"v 0 0 0{end}" * 500_000)
    tracemalloc.start()
    assert "more than 1,000 lines" in refused(path)
    assert tracemalloc.get_traced_memory()[1] < 64 * 2**20
    tracemalloc.stop()


def test_a_line_without_end_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(mesh_io, "_LONGEST_LINE", 1 << 20)
    path = tmp_path / "a.obj"
    path.write_bytes(CUBE.encode() + b"# " + b"x" * (40 << 20))
    assert "lines of more than 1 MB" in refused(path)


@pytest.mark.parametrize("suffix", [".obj", ".ply", ".off", ".stl", ".glb", ".xyz"])
@pytest.mark.parametrize("content", [b"", b"\0" * 100, b"\xff\xfe" * 50, b"OFF\n9999999999 1 0\n", b"solid", b"ply\n"])
def test_no_meshes(tmp_path: Path, suffix: str, content: bytes) -> None:
    path = tmp_path / f"a{suffix}"
    path.write_bytes(content)
    with pytest.raises(FacePoserError) as caught:
        read_mesh(path)
    assert str(caught.value).isprintable()


def test_first_unusable() -> None:
    values = np.zeros((4, 3))
    assert first_unusable(values) is None
    assert first_unusable(np.zeros((0, 3))) is None
    for number in (np.nan, np.inf, -np.inf, 2 * FARTHEST, -2 * FARTHEST):
        values[2, 1] = number
        assert first_unusable(values) == 2
