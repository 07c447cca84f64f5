"""Shapes of a folder become offsets from its neutral, and files that do not fit together are named."""

import re
from pathlib import Path

import numpy as np
import pytest

from faceposer.errors import FacePoserError
from faceposer.geometry.obj_io import write_obj
from faceposer.geometry.polygon_mesh import Group
from faceposer.geometry.rig_io import empty_targets, read_rig
from faceposer.geometry.shape_folder import read_shape_folder

VERTICES = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [2, 0.5, 0.25]])
FACES = np.array([[0, 1, 2, 3], [1, 4, 2, -1]])
UV = np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
UV_FACES = np.array([[3, 2, 1, 0], [0, 1, 2, -1]])
GROUPS = [Group("skin", (0, 1), "skin"), Group("lips", (1, 2), "lips")]
MOVE = np.array([[0, 0, 0], [0, 0.5, 0], [0, 0, 0], [0, 0, -0.125], [0, 0, 0]])


def folder(path: Path, neutral: str = "neutral.obj", **shapes: float) -> Path:
    """Write a neutral and shapes that are so many times ``MOVE``."""
    write_obj(path / neutral, VERTICES, FACES, UV, UV_FACES, groups=GROUPS)
    for name, amount in shapes.items():
        write_obj(path / f"{name}.obj", VERTICES + amount * MOVE, FACES, UV, UV_FACES)
    return path


def ply(path: Path, vertices: np.ndarray, triangles: list[list[int]]) -> None:
    rows = [" ".join(map(str, row)) for row in vertices.tolist()]
    rows += [" ".join(map(str, [len(row), *row])) for row in triangles]
    path.write_text(
        f"ply\nformat ascii 1.0\nelement vertex {len(vertices)}\nproperty float x\nproperty float y\nproperty float z\n"
        f"element face {len(triangles)}\nproperty list uchar int vertex_indices\nend_header\n" + "\n".join(rows) + "\n"
    )


def test_shapes_are_offsets_and_the_rest_is_the_neutrals(tmp_path: Path) -> None:
    folder(tmp_path, smile=1, frown=-2, still=0)
    (tmp_path / "notes.txt").write_text("not a shape")
    (tmp_path / ".smile2.obj").write_text("nor this")
    rig = read_rig(tmp_path)
    np.testing.assert_array_equal(rig.mesh.vertices, VERTICES)
    np.testing.assert_array_equal(rig.mesh.polygons, FACES)
    np.testing.assert_array_equal(rig.mesh.polygon_uvs, UV_FACES)
    assert rig.mesh.groups == tuple(GROUPS)
    assert list(rig.targets) == ["frown", "smile", "still"]
    np.testing.assert_array_equal(rig.targets["smile"], MOVE)
    np.testing.assert_array_equal(rig.targets["frown"], -2 * MOVE)
    assert rig.targets["smile"].dtype == np.float32
    assert empty_targets(rig) == ("still",)


@pytest.mark.parametrize(
    ("neutral", "shape", "name"),
    [
        ("Neutral.obj", "jawOpen", "jawOpen"),
        ("BASE.OBJ", "jaw_open", "jaw_open"),
        ("rest.obj", "jawOpen", "jawOpen"),
        ("generic_neutral_mesh.obj", "browDown_L", "browDown_L"),
        ("head_neutral.obj", "head_jawOpen", "jawOpen"),
        ("my-head.Neutral.obj", "my-head.jawOpen", "jawOpen"),
        ("manBase.obj", "manJawOpen", "manJawOpen"),
        ("Basis.obj", "jawOpen", "jawOpen"),
        ("neutral_Head_Mesh.obj", "jawOpen_Head_Mesh", "jawOpen_Head_Mesh"),
    ],
)
def test_the_neutral_is_found_and_prefixes_are_left_out(tmp_path: Path, neutral: str, shape: str, name: str) -> None:
    rig = read_rig(folder(tmp_path, neutral, **{shape: 1}))
    assert list(rig.targets) == [name]


def test_the_neutral_can_be_given(tmp_path: Path) -> None:
    inside = folder(tmp_path, "a.obj", smile=1)
    with pytest.raises(FacePoserError, match="has no neutral face among its 2 meshes; name it neutral, base, basis"):
        read_rig(inside)
    assert list(read_rig(inside, inside / "a.obj").targets) == ["smile"]
    assert list(read_rig(inside, Path("a.obj")).targets) == ["smile"]
    outside = tmp_path / "outside"
    outside.mkdir()
    (inside / "a.obj").rename(outside / "a.obj")
    assert list(read_rig(inside, outside / "a.obj").targets) == ["smile"]
    with pytest.raises(FacePoserError, match=r"b\.obj' cannot be read"):
        read_rig(inside, Path("b.obj"))
    write_obj(inside / "neutral.obj", VERTICES, FACES)
    write_obj(inside / "base.obj", VERTICES, FACES)
    with pytest.raises(FacePoserError, match=r"both 'base\.obj' and 'neutral\.obj' may be the neutral"):
        read_rig(inside)


def test_faces_are_compared_by_their_vertices_alone(tmp_path: Path) -> None:
    folder(tmp_path, smile=1)
    # Other normals, no texture coordinates, other spacing and line ends: all as exporters differ.
    write_obj(tmp_path / "frown.obj", VERTICES - MOVE, FACES, normals=np.ones((5, 3)))
    text = (tmp_path / "smile.obj").read_text()
    (tmp_path / "crlf.obj").write_bytes(text.replace("\n", "\r\n").encode())
    (tmp_path / "spaced.obj").write_text(text.replace("f ", "  f  "))
    lines = [line.split("/")[0] if line.startswith("f") else line for line in text.splitlines()]
    lines[-2:] = ["f -5 -4 -3 -2", "f -4 -1 -3"]
    (tmp_path / "relative.obj").write_text("\n".join(lines))
    rig = read_rig(tmp_path)
    for name in ("smile", "crlf", "spaced", "relative"):
        np.testing.assert_array_equal(rig.targets[name], MOVE)
    np.testing.assert_array_equal(rig.targets["frown"], -MOVE)


def test_other_topologies_are_refused_with_the_place(tmp_path: Path) -> None:
    folder(tmp_path, smile=1)
    write_obj(tmp_path / "frown.obj", VERTICES[:4], FACES[:1])
    with pytest.raises(FacePoserError, match=r"frown\.obj' has 4 vertices, but .*neutral\.obj' has 5; export all"):
        read_rig(tmp_path)
    write_obj(tmp_path / "frown.obj", VERTICES, FACES[:, [1, 2, 3, 0]][:1])
    with pytest.raises(FacePoserError, match=r"frown\.obj' differ from .*: it has 1 face, not 2; export all"):
        read_rig(tmp_path)
    write_obj(tmp_path / "frown.obj", VERTICES, np.array([[0, 1, 2, 3], [1, 4, 3, -1]]))
    with pytest.raises(FacePoserError, match=r"face 2 has the corners 2, 5, 4, not 2, 5, 3"):
        read_rig(tmp_path)
    (tmp_path / "frown.obj").write_text((tmp_path / "smile.obj").read_text().replace("\nf", "\nf 1 2 3\nf", 1))
    with pytest.raises(FacePoserError, match="it has 3 faces, not 2"):
        read_rig(tmp_path)
    (tmp_path / "frown.obj").write_text((tmp_path / "smile.obj").read_text().replace("v 2 ", "v nan "))
    with pytest.raises(FacePoserError, match=r"Vertex 5 of .*frown\.obj' is not finite"):
        read_rig(tmp_path)
    (tmp_path / "frown.obj").write_text((tmp_path / "smile.obj").read_text().replace("v 2 ", "v oops "))
    with pytest.raises(FacePoserError, match=r"frown\.obj' is broken at line 5"):
        read_rig(tmp_path)
    (tmp_path / "frown.obj").write_bytes(b"")
    with pytest.raises(FacePoserError, match=r"frown\.obj' has no faces"):
        read_rig(tmp_path)


def test_two_files_of_one_name_matter_where_the_shape_is_used(tmp_path: Path) -> None:
    folder(tmp_path, smile=1)
    ply(tmp_path / "Smile.ply", VERTICES, [[0, 1, 2], [0, 2, 3], [1, 4, 2]])
    assert not read_rig(tmp_path).unusable
    ply(tmp_path / "smile.ply", VERTICES, [[0, 1, 2], [0, 2, 3], [1, 4, 2]])
    rig = read_rig(tmp_path)
    assert sorted(rig.targets) == ["Smile", "smile"]
    assert re.search(r"smile\.obj' and '.*smile\.ply' have the same shape name, smile;", rig.unusable["smile"])


def test_names_of_files_that_are_no_text_can_be_shown(tmp_path: Path) -> None:
    folder(tmp_path, smile=1)
    try:
        (tmp_path / "smile.obj").rename(tmp_path / "caf\udce9.obj")
    except OSError:
        pytest.skip("the file system has only names that are text")
    assert list(read_rig(tmp_path).targets) == ["caf\ufffd"]


def test_triangulated_shapes_fit_a_neutral_of_quads(tmp_path: Path) -> None:
    folder(tmp_path)
    ply(tmp_path / "smile.ply", VERTICES + MOVE, [[0, 1, 2], [2, 3, 0], [1, 4, 2]])
    rig = read_rig(tmp_path)
    np.testing.assert_allclose(rig.targets["smile"], MOVE)
    assert rig.mesh.polygons.shape == (2, 4)
    ply(tmp_path / "smile.ply", VERTICES + MOVE, [[0, 1, 2], [2, 3, 1], [1, 4, 2]])
    with pytest.raises(FacePoserError, match=r"face 2 has the corners 3, 4, 2, not 1, 3, 4"):
        read_rig(tmp_path)


def test_numbers_too_large_for_an_offset_are_told(tmp_path: Path) -> None:
    folder(tmp_path, smile=1)
    (tmp_path / "smile.obj").write_text((tmp_path / "smile.obj").read_text().replace("v 2 ", "v 1e200 "))
    with pytest.raises(FacePoserError, match=r"Vertex 5 of the mesh '.*smile.obj' is too far away"):
        read_rig(tmp_path)


def test_what_is_no_rig(tmp_path: Path) -> None:
    with pytest.raises(FacePoserError, match="does not exist"):
        read_rig(tmp_path / "none")
    with pytest.raises(FacePoserError, match="contains no meshes; add a mesh for each shape"):
        read_rig(tmp_path)
    with pytest.raises(FacePoserError, match="has no shapes; add a mesh for each"):
        read_rig(folder(tmp_path))
    with pytest.raises(FacePoserError, match=r"neutral\.obj' is not a supported rig"):
        read_rig(tmp_path / "neutral.obj")
    (tmp_path / "a.glb").write_bytes(b"glTF")
    with pytest.raises(FacePoserError, match="truncated"):
        read_rig(tmp_path / "a.glb")
    with pytest.raises(FacePoserError, match="contains its neutral"):
        read_rig(tmp_path / "a.glb", tmp_path / "neutral.obj")
    with pytest.raises(FacePoserError, match="cannot be read"):
        read_shape_folder(tmp_path / "none")
