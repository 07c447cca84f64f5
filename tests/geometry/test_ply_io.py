"""PLY comes back as it was written: polygons, order, texture coordinates; broken files are refused with the place."""

import struct
from pathlib import Path

import numpy as np
import pytest
import trimesh

from faceposer.errors import FacePoserError
from faceposer.geometry.mesh_io import read_mesh

VERTICES = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [2, 0.5, 0.25], [3, 3, 3]], dtype=np.float32)
UV = np.array([[0, 0], [1, 0], [1, 1], [0, 1], [0.5, 0.5], [0, 0]], dtype=np.float32)
NORMALS = np.tile(np.array([0, 0, 1], dtype=np.float32), (6, 1))
FACES = [(0, 1, 2, 3), (1, 4, 2), (0, 1, 4, 5, 3), (3, 2, 1, 0), (0, 2, 4)]
FORMATS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}


def write(path: Path, form: str, *, corners: bool = False, faces: list[tuple[int, ...]] = FACES) -> Path:
    """Write vertices with all they may have, an element that nobody reads, and faces among other properties."""
    header = ["ply", f"format {form} 1.0", "comment of no meaning", "element vertex 6"]
    header += [f"property float {name}" for name in ("x", "y", "z", "nx", "ny", "nz", *(() if corners else "st"))]
    header += ["element camera 2", "property uchar mark", "property list uint8 int16 any"]
    header += [f"element face {len(faces)}", "property uchar flags", "property list uchar int vertex_indices"]
    header += ["property list uchar float texcoord"] if corners else []
    header += ["property short tail", "end_header", ""]
    columns = [VERTICES, NORMALS] if corners else [VERTICES, NORMALS, UV]
    rows: list[list[tuple[str, float]]] = [[("f", v) for v in row] for row in np.hstack(columns).tolist()]
    rows += [[("B", 7), ("B", 0)], [("B", 7), ("B", 2), ("h", -1), ("h", 300)]]
    for face in faces:
        row: list[tuple[str, float]] = [("B", 9), ("B", len(face)), *(("i", v) for v in face)]
        if corners:
            row += [("B", 2 * len(face)), *(("f", t) for v in face for t in (UV[v] + len(face)).tolist())]
        rows.append([*row, ("h", -5)])
    if form == "ascii":
        body = "".join(" ".join(str(v) for _, v in row) + "\n" for row in rows).encode()
    else:
        body = b"".join(struct.pack(FORMATS[form] + code, v) for row in rows for code, v in row)
    path.write_bytes("\n".join(header).encode() + body)
    return path


@pytest.mark.parametrize("form", FORMATS)
def test_polygons_and_texture_coordinates_of_vertices(tmp_path: Path, form: str) -> None:
    mesh = read_mesh(write(tmp_path / "a.ply", form))
    np.testing.assert_array_equal(mesh.vertices, VERTICES)
    np.testing.assert_array_equal(mesh.normals, NORMALS)
    np.testing.assert_array_equal(mesh.uv, UV)
    assert [tuple(v for v in face if v >= 0) for face in mesh.polygons.tolist()] == FACES
    np.testing.assert_array_equal(mesh.polygon_uvs, mesh.polygons)


@pytest.mark.parametrize("form", FORMATS)
def test_texture_coordinates_of_corners(tmp_path: Path, form: str) -> None:
    mesh = read_mesh(write(tmp_path / "a.ply", form, corners=True))
    assert [tuple(v for v in face if v >= 0) for face in mesh.polygons.tolist()] == FACES
    assert mesh.polygon_uvs.shape == mesh.polygons.shape
    for face, corners in zip(FACES, mesh.polygon_uvs.tolist(), strict=True):
        np.testing.assert_allclose(mesh.uv[corners[: len(face)]], UV[list(face)] + len(face))


@pytest.mark.parametrize("binary", [True, False])
def test_files_of_another_writer(tmp_path: Path, binary: bool) -> None:
    ball = trimesh.creation.icosphere(2)
    encoding = "binary" if binary else "ascii"
    ball.export(tmp_path / "a.ply", encoding=encoding, vertex_normal=True)
    mesh = read_mesh(tmp_path / "a.ply")
    np.testing.assert_allclose(mesh.vertices, ball.vertices, atol=1e-6)
    np.testing.assert_array_equal(mesh.polygons, ball.faces)
    np.testing.assert_allclose(mesh.normals, ball.vertex_normals, atol=1e-6)


def test_many_kinds_of_faces_in_any_order(tmp_path: Path) -> None:
    rng = np.random.default_rng(3)
    faces = [tuple(rng.integers(0, 6, rng.integers(3, 9)).tolist()) for _ in range(300)]
    mesh = read_mesh(write(tmp_path / "a.ply", "binary_little_endian", faces=faces))
    assert [tuple(v for v in face if v >= 0) for face in mesh.polygons.tolist()] == faces


HEAD = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
FACE = "element face 1\nproperty list uchar int vertex_index\nend_header\n"
POINTS = "0 0 0\n1 0 0\n0 1 0\n"


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("", "does not begin with a PLY header"),
        ("ply\nformat ascii 1.0\n", "does not begin with a PLY header"),
        ("ply\nformat xml 1.0\nend_header\n", "its format is 'xml'"),
        ("ply\nformat ascii 1.0\nelement vertex many\nend_header\n", "line 3 of its header is invalid"),
        ("ply\nformat ascii 1.0\nelement vertex 999999999999\nend_header\n", "too short for 999999999999 of 'vertex'"),
        ("ply\nformat ascii 1.0\nelement vertex -1\nend_header\n", "line 3 of its header is invalid"),
        ("ply\nformat ascii 1.0\nproperty float x\nend_header\n", "line 3 of its header is invalid"),
        ("ply\nformat ascii 1.0\nelement vertex 1\nproperty quad x\nend_header\n", "line 4 of its header is invalid"),
        (HEAD + FACE + "0 0 0\n1 0 0\n", "truncated in 'vertex' 3 of 3"),
        (HEAD + FACE + POINTS, "truncated in 'face' 1 of 1"),
        (HEAD + FACE + POINTS + "3 0 1\n", "truncated in 'face' 1 of 1"),
        (HEAD + FACE + POINTS + "3 0 1 3\n", "face 1 has a corner outside the 3"),
        (HEAD + FACE + POINTS + "3 0 1 -1\n", "face 1 has a corner"),
        (HEAD + FACE + POINTS + "3 0 1 nan\n", "face 1 has a corner"),
        (HEAD + FACE + POINTS + "2 0 1\n", "face 1 has fewer than 3"),
        (HEAD + FACE + POINTS + "-2 0 1\n", r"'face' 1 has a list of -2"),
        (HEAD + FACE + POINTS + "nan 0 1\n", r"'face' 1 has a list of nan"),
        (HEAD + FACE + POINTS + "3 0 1 oops\n", "line 4 after its header has a value that is not a number"),
        (HEAD + FACE + POINTS + "3 0 1\xa02 2\n", "line 4 after its header has a value that is not a number"),
        (HEAD + FACE + POINTS.replace("1", "nan") + "3 0 1 2\n", "Vertex 2 of the mesh .* is not finite"),
        (HEAD + "end_header\n" + POINTS, "has no faces"),
        (HEAD.replace("float z", "float w") + FACE + POINTS + "3 0 1 2\n", "no vertices with x, y and z"),
    ],
)
def test_broken_files_are_refused(tmp_path: Path, content: str, said: str) -> None:
    path = tmp_path / "a.ply"
    path.write_text(content, encoding="latin-1")
    with pytest.raises(FacePoserError, match=said) as caught:
        read_mesh(path)
    assert str(path) in str(caught.value)


@pytest.mark.parametrize("form", FORMATS)
def test_whatever_is_wrong_only_our_error_comes_out(tmp_path: Path, form: str) -> None:
    rng = np.random.default_rng(7)
    path = write(tmp_path / "a.ply", form, corners=True)
    whole = path.read_bytes()
    refused = 0
    for trial in range(400):
        changed = bytearray(whole[: rng.integers(len(whole))] if trial % 2 else whole)
        for place in rng.integers(0, len(changed), 2) if changed else ():
            changed[place] = rng.integers(ord("0"), ord("9") + 1) if form == "ascii" else rng.integers(256)
        path.write_bytes(changed)
        try:
            mesh = read_mesh(path)
        except FacePoserError as error:
            if str(path) not in str(error):
                raise
            refused += 1
        else:
            assert mesh.polygons.max() < len(mesh.vertices)
    assert 200 <= refused < 400
