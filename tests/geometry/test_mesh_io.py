"""Meshes come back as they were written, and broken files are refused with their place."""

from pathlib import Path

import numpy as np
import pytest

from faceposer.errors import FacePoserError
from faceposer.geometry.mesh_io import read_mesh
from faceposer.geometry.obj_io import read_obj_positions_and_digest, write_obj
from faceposer.geometry.polygon_mesh import Group

VERTICES = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [2, 0.1, 1 / 3]], dtype=np.float32)
POLYGONS = np.array([[0, 1, 2, 3], [1, 4, 2, -1]])
UV = np.array([[0, 0], [1, 0], [1, 1], [0, 1], [0.25, 0.75]])


def test_obj_round_trip_keeps_order_quads_and_uvs(tmp_path: Path) -> None:
    path = tmp_path / "a.obj"
    normals = np.tile([0.0, 0.0, 1.0], (5, 1))
    groups = [Group("skin", (0, 1), "skin"), Group("eye", (1, 2), "skin")]
    write_obj(path, VERTICES, POLYGONS, UV, np.array([[3, 2, 1, 0], [0, 4, 2, -1]]), normals, groups, "hello")
    mesh = read_mesh(path)
    np.testing.assert_array_equal(mesh.vertices.astype(np.float32), VERTICES)
    np.testing.assert_array_equal(mesh.polygons, POLYGONS)
    np.testing.assert_array_equal(mesh.polygon_uvs, [[3, 2, 1, 0], [0, 4, 2, -1]])
    assert mesh.groups == tuple(groups)
    np.testing.assert_allclose(mesh.uv, UV)
    np.testing.assert_allclose(mesh.normals, normals)
    np.testing.assert_array_equal(mesh.triangles(), [[0, 1, 2], [0, 2, 3], [1, 4, 2]])
    text = path.read_text()
    assert text.startswith("# hello\n")
    assert text.index("g skin") < text.index("f 1/4/1") < text.index("g eye")


def test_obj_without_uvs_and_with_relative_indices(tmp_path: Path) -> None:
    path = tmp_path / "a.obj"
    path.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\n# comment\nf -3 -2 -1\n")
    assert read_mesh(path).polygons.tolist() == [[0, 1, 2]]
    write_obj(path, VERTICES, POLYGONS, normals=np.ones((5, 3)))
    assert "f 1//1 2//2 3//3 4//4" in path.read_text()


def test_other_formats_keep_their_order(tmp_path: Path) -> None:
    path = tmp_path / "a.off"
    rows = "\n".join(" ".join(map(str, row)) for row in VERTICES.tolist())
    path.write_text(f"OFF\n5 2 0\n{rows}\n3 0 1 2\n3 1 4 2\n")
    mesh = read_mesh(path)
    np.testing.assert_allclose(mesh.vertices, VERTICES)
    assert mesh.polygons.tolist() == [[0, 1, 2], [1, 4, 2]]


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("a.obj", "v 0 0\n", "broken at line 1: 'v' needs 3 numbers"),
        ("a.obj", "v 0 0 0\nf 1 2 3\n", "broken at line 2: index 2 is out of range for the 1 entry"),
        ("a.obj", "v 0 0 0\nv x 0 0\n", "broken at line 2"),
        ("a.obj", "v 0 0 0\nf 1 1\n", "at least 3 corners"),
        ("a.obj", "", "no faces"),
        ("a.obj", "v 0 0 nan\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "Vertex 1 of the mesh .* is not finite"),
        ("a.ply", "ply\nnonsense", "does not begin with a PLY header"),
        ("a.off", "nonsense", "Line 1 of .* is invalid: 'nonsense' is not a number"),
        ("a.txt", "hello", "not a supported mesh"),
    ],
)
def test_broken_files_are_refused(tmp_path: Path, name: str, content: str, said: str) -> None:
    path = tmp_path / name
    path.write_text(content)
    with pytest.raises(FacePoserError, match=said) as caught:
        read_mesh(path)
    assert str(path) in str(caught.value)


def test_missing_files_and_folders_are_named(tmp_path: Path) -> None:
    with pytest.raises(FacePoserError, match=r"nowhere\.glb' cannot be read: No such file"):
        read_mesh(tmp_path / "nowhere.glb")
    with pytest.raises(FacePoserError, match="cannot be written"):
        write_obj(tmp_path / "no" / "a.obj", VERTICES, POLYGONS)


def test_polygons_of_many_corners_and_groups_of_blender(tmp_path: Path) -> None:
    path = tmp_path / "a.obj"
    path.write_text(
        "v 0 0 0 1 0 0\nv 1 0 0 1 0 0\nv 2 1 0 1 0 0\nv 1 2 0 1 0 0\nv 0 1 0 1 0 0\n"
        "o head\nusemtl skin\nf 1 2 3 4 5\nusemtl lips\nf 1 2 3\no eye\nf 3 4 5\n"
    )
    mesh = read_mesh(path)
    assert mesh.polygons.tolist() == [[0, 1, 2, 3, 4], [0, 1, 2, -1, -1], [2, 3, 4, -1, -1]]
    assert mesh.triangles().tolist() == [[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 1, 2], [2, 3, 4]]
    assert mesh.groups == (Group("head", (0, 1), "skin"), Group("head", (1, 2), "lips"), Group("eye", (2, 3), "lips"))
    np.testing.assert_array_equal(read_obj_positions_and_digest(path)[0], mesh.vertices)


def test_positions_alone_are_those_of_the_whole_file(tmp_path: Path) -> None:
    path = tmp_path / "a.obj"
    write_obj(path, VERTICES, POLYGONS, UV, POLYGONS)
    vertices, digest = read_obj_positions_and_digest(path)
    np.testing.assert_array_equal(vertices, read_mesh(path).vertices)
    moved = tmp_path / "moved.obj"
    write_obj(moved, VERTICES + 1.0, POLYGONS, UV, POLYGONS)
    assert read_obj_positions_and_digest(moved)[1] == digest
    write_obj(moved, VERTICES, POLYGONS[:, ::-1], UV, POLYGONS)
    assert read_obj_positions_and_digest(moved)[1] != digest
    path.write_text("v 0 0 0\nv 1 0 oops\n")
    with pytest.raises(FacePoserError, match="broken at line 2"):
        read_obj_positions_and_digest(path)
