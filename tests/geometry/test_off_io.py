"""OFF and STL files: their variants are read, and what is broken or truncated is said."""

import struct
from pathlib import Path

import numpy as np
import pytest

from faceposer.errors import FacePoserError
from faceposer.geometry import off_io
from faceposer.geometry.mesh_io import read_mesh

CORNERS = "0 0 0\n1 0 0\n0 1 0\n1 1 0\n"


@pytest.mark.parametrize(
    "text",
    [
        f"OFF\n4 2 0\n{CORNERS}3 0 1 2\n3 1 3 2\n",
        f"# made by hand\nOFF 4 2 5\n\n{CORNERS}# faces\n3 0 1 2 255 0 0\n3 1 3 2 0.5 0.5 0.5 1.0\n",
        f"4 2 0\n{CORNERS}3 0 1 2\n3 1 3 2 7\n",
        "COFF\n4 2 0\n" + CORNERS.replace("\n", " 255 0 0 255\n") + "3 0 1 2\n3 1 3 2\n",
        "\ufeffNOFF\r\n4 2 0\r\n" + CORNERS.replace("\n", " 0 0 1\r\n") + "3 0 1 2\r\n3 1 3 2\r\n",
    ],
)
def test_variants_are_read(text: str, tmp_path: Path) -> None:
    (tmp_path / "a.off").write_text(text, encoding="utf-8", newline="")
    mesh = read_mesh(tmp_path / "a.off")
    np.testing.assert_array_equal(mesh.vertices, [[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]])
    np.testing.assert_array_equal(mesh.polygons, [[0, 1, 2], [1, 3, 2]])


def test_polygons_keep_their_corners(tmp_path: Path) -> None:
    (tmp_path / "a.off").write_text(f"OFF\n4 3 0\n{CORNERS}4 0 1 3 2\n2 0 1\n3 0 1 2\n")
    np.testing.assert_array_equal(read_mesh(tmp_path / "a.off").polygons, [[0, 1, 3, 2], [0, 1, 2, -1]])


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (f"OFF\n4 1 0\n{CORNERS}4 0 1 2\n", "Line 7 of .* a face of 4 corners has only 3"),
        (f"OFF\n4 1 0\n{CORNERS}1000000 0 1 2\n", "a face has 1000000 corners, not 3 to 1000"),
        (f"OFF\n4 1 0\n{CORNERS}-3 0 1 2\n", "a face has -3 corners"),
        (f"OFF\n4 1 0\n{CORNERS}3 0 1 4\n", "a corner is not one of the 4 vertices"),
        (f"OFF\n4 1 0\n{CORNERS}3 0 1 -1\n", "a corner is not one of the 4 vertices"),
        (f"OFF\n4 2 0\n{CORNERS}3 0 1 2\n", "is truncated: it declares 2 faces, but has 1"),
        ("OFF\n4 2 0\n0 0 0\n", "is truncated: it declares 4 vertices, but has 1"),
        ("OFF\n1000000000000 1 0\n", "numbers of vertices and faces are missing"),
        ("OFF\n900000000000 1 0\n", "it declares 900000000000 vertices, but has 0"),
        ("OFF\n-4 1 0\n", "numbers of vertices and faces are missing"),
        ("OFF", "numbers of vertices and faces are missing"),
        ("", "numbers of vertices and faces are missing"),
        ("4OFF\n1 1 0\n", "'4OFF' is not supported"),
        ("OFF BINARY\n1 1 0\n", "not supported"),
        (
            f"OFF\n4 1 0\n{CORNERS}".replace("1 1 0\n", "1 1\n", 1) + "3 0 1 2\n",
            "Line 6 .* fewer than 3 coordinates",
        ),
        (f"OFF\n4 1 0\n{CORNERS}3 0 1 ٢\n", "is not a number"),
        (f"OFF\n4 1 0\n{CORNERS.replace('1 1 0', '1_0 1 0')}3 0 1 2\n", "'1_0' is not a number"),
        (f"OFF\n4 1 0\n{CORNERS.replace('1 1 0', 'nan 1 0')}3 0 1 2\n", "Vertex 4 .* is not finite"),
        (f"OFF\n4 1 0\n{CORNERS}2 0 1\n", "has no faces"),
    ],
)
def test_what_is_broken_is_said(text: str, said: str, tmp_path: Path) -> None:
    (tmp_path / "a.off").write_text(text, encoding="utf-8")
    with pytest.raises(FacePoserError, match=said):
        read_mesh(tmp_path / "a.off")


def test_padding_to_the_largest_face_is_limited(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(off_io, "_MAX_CELLS", 20)
    (tmp_path / "a.off").write_text(f"OFF\n4 7 0\n{CORNERS}" + "3 0 1 2\n" * 7)
    with pytest.raises(FacePoserError, match="its faces have too many corners"):
        read_mesh(tmp_path / "a.off")


@pytest.mark.parametrize("declared", [2, 2**32 - 1])
def test_stl_with_fewer_triangles_than_declared(declared: int, tmp_path: Path) -> None:
    triangle = struct.pack("<12fH", 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0)
    path = tmp_path / "a.stl"
    path.write_bytes(bytes(80) + struct.pack("<I", declared) + triangle)
    with pytest.raises(FacePoserError, match=f"truncated: it declares {declared} triangles, but has 1; copy"):
        read_mesh(path)
    path.write_bytes(b"solid exported as binary".ljust(80) + struct.pack("<I", 1) + triangle)
    assert len(read_mesh(path).polygons) == 1


def test_truncated_stl_in_text(tmp_path: Path) -> None:
    facet = "facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\n"
    path = tmp_path / "a.stl"
    path.write_text(f"solid a\n{facet}{facet}endsolid a\n")
    assert len(read_mesh(path).polygons) == 2
    path.write_text(f"solid a\n{facet}{facet}"[:-12])
    with pytest.raises(FacePoserError, match="it declares 2 triangles, but has 1"):
        read_mesh(path)
