"""OBJ files as exporters really write them: continued lines, byte order marks, and any character in names."""

from pathlib import Path

import numpy as np
import pytest

from faceposer.errors import FacePoserError
from faceposer.geometry.mesh_io import read_mesh
from faceposer.geometry.mesh_sequence import open_sequence
from faceposer.geometry.obj_io import read_obj_positions_and_digest
from faceposer.geometry.rig_io import read_rig

PLAIN = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\ng skin\nf 1 2 3 4\n"
POINTS = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
DIALECTS = {
    "continued face": PLAIN.replace("f 1 2 3 4", "f 1 2 \\\n 3 4").encode(),
    "continued twice": PLAIN.replace("f 1 2 3 4", "f 1 \\\n2 \\\n 3 4").encode(),
    "continued with Windows' line ends": PLAIN.replace("v 1 1 0", "v 1 \\\n 1 0").replace("\n", "\r\n").encode(),
    "continued and spaces": PLAIN.replace("v 1 1 0", "v 1 1 \\  \n0").encode(),
    "old Mac": PLAIN.replace("f 1 2 3 4", "f 1 2\\\n3 4").replace("\n", "\r").encode(),
    "comment that ends in a backslash": b"# C:\\heads\\\n" + PLAIN.encode(),
    "byte order mark": b"\xef\xbb\xbf" + PLAIN.encode(),
    "UTF-16": PLAIN.encode("utf-16"),
    "UTF-16, continued": b"\xfe\xff" + PLAIN.replace("f 1 2 3 4", "f 1 2 \\\n3 4").encode("utf-16-be"),
    "comments after numbers": PLAIN.replace("v 1 1 0", "v 1 1 0 # third")
    .replace("f 1 2 3 4", "f 1 2 3 4# all")
    .encode(),
    "no line end": PLAIN.rstrip().encode(),
    "continued at the end": PLAIN.rstrip().encode() + b" \\",
}


@pytest.mark.parametrize("dialect", DIALECTS)
def test_dialects_are_the_same_mesh(dialect: str, tmp_path: Path) -> None:
    path = tmp_path / "a.obj"
    path.write_bytes(DIALECTS[dialect])
    mesh = read_mesh(path)
    np.testing.assert_array_equal(mesh.vertices, POINTS)
    np.testing.assert_array_equal(mesh.polygons, [[0, 1, 2, 3]])
    assert [group.name for group in mesh.groups] == ["skin"]
    np.testing.assert_array_equal(read_obj_positions_and_digest(path)[0], POINTS)
    # In folders, only positions are read where the faces are equal.
    (tmp_path / "neutral.obj").write_text(PLAIN)
    np.testing.assert_array_equal(read_rig(tmp_path).targets["a"], 0.0 * POINTS)
    assert len([*open_sequence(tmp_path).read(0, 2)]) == 2


@pytest.mark.parametrize("name", ["head #1", "#1", "Zähne à 顔", "a  b", "100% [left]", "a\\b"])
def test_names_are_kept_to_the_letter(name: str, tmp_path: Path) -> None:
    path = tmp_path / "a.obj"
    path.write_text(PLAIN.replace("g skin", f"g {name}\nusemtl m {name}"), encoding="utf-8")
    (group,) = read_mesh(path).groups
    assert (group.name, group.material) == (name, f"m {name}")
    path.write_text(PLAIN.replace("g skin", f"g {name}"), encoding="utf-16")
    assert read_mesh(path).groups[0].name == name


def test_names_of_older_exporters_are_windows_1252(tmp_path: Path) -> None:
    (tmp_path / "a.obj").write_bytes(PLAIN.replace("g skin", "g Zähne").encode("cp1252"))
    assert read_mesh(tmp_path / "a.obj").groups[0].name == "Zähne"


def test_what_is_broken_is_told_with_the_line_and_without_wording_of_python(tmp_path: Path) -> None:
    for broken, said in (
        (PLAIN.replace("f 1 2 3 4", "f 1 2 x 4"), r"line 6: 'x' is not the index of a vertex"),
        (PLAIN.replace("v 1 1 0", "v 1 one 0"), r"line 3: 'one' is not a number"),
        ("v 0 0 0 \\\n" * 30000, r"longer than 65536 characters"),
    ):
        (tmp_path / "a.obj").write_text(broken)
        with pytest.raises(FacePoserError, match=said):
            read_mesh(tmp_path / "a.obj")


def test_files_of_macos_about_files_are_no_meshes(tmp_path: Path) -> None:
    for name in ("neutral", "smile"):
        (tmp_path / f"{name}.obj").write_text(PLAIN)
        (tmp_path / f"._{name}.obj").write_bytes(b"\x00\x05\x16\x07" + bytes(60))
    assert len(open_sequence(tmp_path)) == 2
    assert list(read_rig(tmp_path).targets) == ["smile"]
    with pytest.raises(FacePoserError, match=r"\._smile\.obj' is not a mesh but a file of macOS"):
        read_mesh(tmp_path / "._smile.obj")


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("v 1_000 0 0", "line 4: '1_000' is not a number"),
        ("v \u0663 0 0", "line 4: '\u0663' is not a number"),
        ("v \uff11 0 0", "line 4: '\uff11' is not a number"),
        ("f 1_0 2 3", "line 4: '1_0' is not the index of a vertex"),
        ("f \uff11 2 3", "line 4: '\uff11' is not the index of a vertex"),
    ],
)
def test_numbers_have_plain_digits(line: str, said: str, tmp_path: Path) -> None:
    path = tmp_path / "a.obj"
    path.write_text(f"v 0 0 0\nv 1 0 0\nv 0 1 0\n{line}\nf 1 2 3\n", encoding="utf-8")
    with pytest.raises(FacePoserError, match=said):
        read_mesh(path)
