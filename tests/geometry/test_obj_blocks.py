"""Blocks of OBJ files parsed at once are the same as parsed line by line, and their memory and time are bounded."""

import tracemalloc
from pathlib import Path

import numpy as np
import pytest

from faceposer.errors import FacePoserError
from faceposer.geometry import obj_blocks, obj_io
from faceposer.geometry.mesh_io import read_mesh
from faceposer.geometry.obj_arrays import parsed_at_once
from faceposer.geometry.obj_blocks import Block, Counts, read_blocks
from faceposer.geometry.obj_lines import parsed_by_line
from faceposer.geometry.polygon_mesh import triangle_fans

VERTICES = "v 0 0 0\nv 1 0 0 1 0.5 .25\n  v\t1 1e0 0  # third\nv 0 1 -0.0 1\nvt 0 1\nvt .5 .5 0\nvt 1 0\nvn 0 0 1\n"
FACES = {
    "plain": "f 1 2 3\nf 2 3 4\n",
    "mixed sizes": "f 1 2 3 4\nf 2 3 4\n",
    "textures": "f 1/1 2/2 3/3\nf 2/1 3/2 4/3 1/1\n",
    "normals": "f 1//1 2//1 3//1\n",
    "both": "f 1/1/1 2/2/1 3/3/1\n",
    "mixed forms": "f 1/1/1 2/2 3/3/\nf 1//1 2 3/1\n",
    "empty textures": "f 1/ 2/ 3/\n",
    "from the end": "f -1 -2 -3\nv 5 5 5\nf -1/-1 -2/-2 -3/-3\n",
    "comments": "f 1 2 3#x\n# f 1 2 9\nf 4 3 2 # f 9 9 9\n",
    "names": "g a #1\nusemtl b\nf 1 2 3\n o  c d \nf 2 3 4\ng\nmtllib x.mtl\nf 1 2 4\n",
    "interleaved": "v 9 9 9\nvt 0 0\nf 5/4 1/1 2/2\nv 8 8 8\nvt 1 1\nf 6/5 5/4 1/1\n",
    "other statements": "s 1\nl 1 2\nvp 0.5\n\n \t\nf 1 2 3\nvtx\n",
    "continued": "f 1 \\\n2 \\ \n3\nv 5 \\\n 5 5\nf 1 2 5\n",
}


@pytest.mark.parametrize("faces", FACES)
def test_blocks_are_parsed_at_once_as_line_by_line(faces: str) -> None:
    block = Block((VERTICES + FACES[faces]).encode(), 0, decoded=True)
    fast = parsed_at_once(block, Counts())
    assert fast is not None
    slow = parsed_by_line(block, Counts(), Path("a.obj"))
    for keyword in ("v", "vt", "vn"):
        np.testing.assert_array_equal(fast.rows[keyword], slow.rows[keyword])
    np.testing.assert_array_equal(fast.sizes, slow.sizes)
    np.testing.assert_array_equal(fast.corners, slow.corners)
    assert (fast.textures is None) == (slow.textures is None)
    if fast.textures is not None and slow.textures is not None:
        np.testing.assert_array_equal(fast.textures, slow.textures)
    assert fast.names == slow.names


@pytest.mark.parametrize(
    "line",
    ["v 1 2", "v 1 2 x", "v 1 2 3 x", "v 1 2 1_0", "vt 1", "vn", "f 1 2", "f 1 2 5", "f 0 1 2", "f -5 1 2", "f /1 1 2"]
    + ["f 1/9 2/1 3/1", "f 1.5 2 3", "f " + "1 " * 129, "v\u00a01 2 3", "\u00a0v 1 2 3", "f 1 2 99999999999999999999"]
    + ["v 1 2 \\\n# 3", "v 1 2\x00 3", "v 1,5 2 3"],
)
def test_statements_that_are_not_plain_are_parsed_line_by_line(line: str) -> None:
    block = Block((VERTICES + line + "\n").encode("latin-1"), 0, decoded=False)
    assert parsed_at_once(block, Counts()) is None


def test_files_of_many_blocks_are_read_as_of_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "a.obj"
    path.write_bytes((VERTICES + "".join(FACES.values())).replace("\n", "\r\n").encode())
    whole = read_mesh(path)
    for size in (1, 7, 40):
        monkeypatch.setattr(obj_blocks, "_BLOCK", size)
        assert len([*read_blocks(path)]) > 3
        mesh = read_mesh(path)
        np.testing.assert_array_equal(mesh.vertices, whole.vertices)
        np.testing.assert_array_equal(mesh.polygons, whole.polygons)
        assert mesh.groups == whole.groups
        assert mesh.libraries == whole.libraries
    with path.open("a") as file:
        file.write("f 1 2 x\n")
    lines = path.read_text().count("\n")
    with pytest.raises(FacePoserError, match=f"broken at line {lines}: 'x' is not the index"):
        read_mesh(path)


def test_memory_follows_the_mesh(tmp_path: Path) -> None:
    path = tmp_path / "a.obj"
    path.write_text("v 1 2 3\nvt 0 0\nf -1/1 -1/1 -1/1\n" * 100_000)
    tracemalloc.start()
    mesh = read_mesh(path)
    assert tracemalloc.get_traced_memory()[1] < 60 * 2**20
    tracemalloc.stop()
    assert len(mesh.polygons) == 100_000


def test_limits_are_told_before_memory_is_taken(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "a.obj"
    monkeypatch.setattr(obj_io, "_MOST_CELLS", 1000)
    path.write_text("v 0 0 0\n" + "f 1 1 1\n" * 100 + "f " + "1 " * 100)
    with pytest.raises(FacePoserError, match="101 faces of up to 100 corners, which is too many"):
        read_mesh(path)
    monkeypatch.setattr(obj_io, "_MOST_GROUPS", 50)
    path.write_text("v 0 0 0\n" + "g a\nf 1 1 1\n" * 51)
    with pytest.raises(FacePoserError, match="more than 50 groups"):
        read_mesh(path)
    monkeypatch.setattr(obj_io, "_MOST_SLOW", 40)
    with pytest.raises(FacePoserError, match="more than 40 lines of names"):
        read_mesh(path)
    monkeypatch.setattr(obj_blocks, "_LONGEST_LINE", 1000)
    monkeypatch.setattr(obj_blocks, "_BLOCK", 1000)
    path.write_text("v 0 0 \\\n" * 1000)
    with pytest.raises(FacePoserError, match="broken"):
        read_mesh(path)


def test_fans_of_wide_faces_take_the_memory_of_their_triangles() -> None:
    polygons = np.full((20_000, 128), -1, dtype=np.int32)
    polygons[:, :3] = [0, 1, 2]
    polygons[7] = np.arange(128)
    tracemalloc.start()
    triangles = triangle_fans(polygons)
    assert tracemalloc.get_traced_memory()[1] < 8 * 2**20
    tracemalloc.stop()
    assert len(triangles) == 19_999 + 126
    np.testing.assert_array_equal(triangles[7:9], [[0, 1, 2], [0, 2, 3]])
    np.testing.assert_array_equal(triangles[-1], [0, 1, 2])
