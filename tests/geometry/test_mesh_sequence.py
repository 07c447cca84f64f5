"""Folders and arrays of meshes come in order; what does not fit is refused with the file and the place."""

import contextlib
import io
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from faceposer.errors import FacePoserError
from faceposer.geometry.mesh_sequence import frames_of, open_sequence, write_frames
from faceposer.geometry.obj_io import write_obj
from faceposer.geometry.polygon_mesh import PolygonMesh

VERTICES = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [2, 0.5, 0.25]], dtype=np.float64)
FACES = np.array([[0, 1, 2, 3], [1, 4, 2, -1]], dtype=np.int32)


def frame(i: int) -> np.ndarray:
    return VERTICES + i


def obj(path: Path, i: int, faces: np.ndarray = FACES, **more: Any) -> Path:
    write_obj(path, frame(i), faces, **more)
    return path


def arrays(path: Path, vertices: Any, faces: Any = FACES, compressed: bool = False, **more: Any) -> Path:
    (np.savez_compressed if compressed else np.savez)(path, vertices=vertices, faces=faces, **more)
    return path


def numbers(sequence: Any) -> list[float]:
    return [float(vertices[0, 0]) for vertices in sequence.read(0, len(sequence))]


def with_header(path: Path, shape: tuple[int, ...], data: bytes = b"", descr: str = "<f4") -> Path:
    """Write an archive whose array claims ``shape`` whatever it has."""
    stream = io.BytesIO()
    np.lib.format.write_array_header_1_0(stream, {"descr": descr, "fortran_order": False, "shape": shape})
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("vertices.npy", stream.getvalue() + data)
        faces = io.BytesIO()
        np.lib.format.write_array(faces, FACES)
        archive.writestr("faces.npy", faces.getvalue())
    return path


def refused(path: Path, match: str) -> None:
    with pytest.raises(FacePoserError, match=match) as caught:
        read_all(path)
    assert "\n" not in str(caught.value)


def read_all(path: Path) -> None:
    sequence = open_sequence(path)
    list(sequence.read(0, len(sequence)))


def test_natural_order_of_a_folder(tmp_path: Path) -> None:
    for i in (10, 9, 1, 2):
        obj(tmp_path / f"take_{i}.obj", i)
    (tmp_path / "notes.txt").write_text("not a mesh")
    sequence = open_sequence(tmp_path)
    assert numbers(sequence) == [1, 2, 9, 10]
    np.testing.assert_array_equal(sequence.neutral.vertices, frame(1))
    assert sequence.name_of(3) == f"'{tmp_path / 'take_10.obj'}'"


@pytest.mark.parametrize("name", ["a_neutral.obj", "Z-Rest.obj", "head base 01.obj"])
def test_neutral_by_its_name(tmp_path: Path, name: str) -> None:
    for i, other in enumerate(["b.obj", "interest.obj", "based.obj"]):
        obj(tmp_path / other, i)
    obj(tmp_path / name, 7)
    assert open_sequence(tmp_path).neutral.vertices[0, 0] == 7


def test_neutral_that_is_given_wins(tmp_path: Path) -> None:
    folder = tmp_path / "meshes"
    folder.mkdir()
    obj(folder / "neutral.obj", 1)
    sequence = open_sequence(folder, obj(tmp_path / "other.obj", 5))
    assert sequence.neutral.vertices[0, 0] == 5
    assert "other.obj" in sequence.neutral_name


@pytest.mark.parametrize("dtype", [np.float16, np.float32, np.float64, ">f4"])
@pytest.mark.parametrize("compressed", [False, True])
def test_arrays_of_any_precision(tmp_path: Path, dtype: Any, compressed: bool) -> None:
    stack = np.stack([frame(i) for i in range(7)]).astype(dtype)
    sequence = open_sequence(arrays(tmp_path / "a.npz", stack, compressed=compressed))
    assert sequence.compressed == compressed
    assert numbers(sequence) == list(range(7))
    assert [v[0, 0] for v in sequence.pick([0, 3, 4, 6])] == [0, 3, 4, 6]
    assert [v[0, 0] for v in sequence.read(5, 7)] == [5, 6]
    np.testing.assert_array_equal(sequence.neutral.polygons, FACES)
    assert sequence.name_of(2) == f"frame 3 of '{tmp_path / 'a.npz'}'"


def test_folder_of_arrays_and_meshes_together(tmp_path: Path) -> None:
    obj(tmp_path / "0_neutral.obj", 0)
    np.savez(tmp_path / "1.npz", vertices=np.stack([frame(1), frame(2)]))
    np.savez(tmp_path / "2.npz", vertices=frame(3))
    obj(tmp_path / "3.obj", 4)
    sequence = open_sequence(tmp_path)
    assert numbers(sequence) == [0, 1, 2, 3, 4]
    assert [v[0, 0] for v in sequence.pick([1, 3, 4])] == [1, 3, 4]
    assert [v[0, 0] for v in sequence.absolute().read(2, 4)] == [2, 3]


def test_written_frames_come_back(tmp_path: Path) -> None:
    path = tmp_path / "a.npz"
    write_frames(path, (frame(i) for i in range(5)), 5, len(VERTICES))
    assert numbers(frames_of(path, PolygonMesh(VERTICES, FACES), "the neutral")) == list(range(5))
    with np.load(path, allow_pickle=False) as file:
        assert file["vertices"].shape == (5, 5, 3)
    with pytest.raises(ValueError, match="2 frames were given, not 3"):
        write_frames(path, (frame(i) for i in range(2)), 3, len(VERTICES))


@pytest.mark.parametrize("ending", ["\n", "\r\n"])
def test_obj_files_of_many_makers(tmp_path: Path, ending: str) -> None:
    """Colours, comments, normals with numbers of their own, groups, tabs and other ends of lines."""
    obj(tmp_path / "0_neutral.obj", 0)
    plain = [f"v {x} {y} {z}" for x, y, z in frame(1)]
    variants = {
        "colours": [*(f"{row} 0.5 0.5 0.5" for row in plain), "f 1 2 3 4", "f 2 5 3"],
        "comments": ["# made", *plain[:2], "# more", *plain[2:], "g lips", "f 1 2 3 4", "usemtl skin", "f 2 5 3"],
        "normals": [*plain, "vn 0 0 1", "vn 0 1 0", "f 1//1 2//2 3//1 4//1", "f 2//2 5//1 3//1", "# end"],
        "tabs": [*(row.replace("v ", "v\t") for row in plain), "f\t1 2 3 4", "f\t2 5 3"],
        "faces_first": ["g a", *plain, "vt 0 0", "f 1/1 2/1 3/1 4/1", "f 2/1 5/1 3/1", ""],
        "ends_abruptly": [*plain, "f 1 2 3 4", "f 2 5 3"],
        "from_the_end": [*plain, "f -5 -4 -3 -2", "f -4 -1 -3"],
    }
    for name, lines in variants.items():
        text = ending.join(lines) + ("" if name == "ends_abruptly" else ending)
        (tmp_path / f"{name}.obj").write_bytes(text.encode())
    sequence = open_sequence(tmp_path)
    for number, vertices in enumerate(sequence.read(1, len(sequence))):
        np.testing.assert_array_equal(vertices, frame(1), err_msg=sequence.name_of(number + 1))


def test_other_topology(tmp_path: Path) -> None:
    obj(tmp_path / "0_neutral.obj", 0)
    obj(tmp_path / "1.obj", 1, FACES[::-1])
    refused(tmp_path, r"topology of '.*1\.obj' differs from the neutral '.*0_neutral\.obj': face 1 differs")
    obj(tmp_path / "1.obj", 1, FACES[:1])
    refused(tmp_path, r"1 face, not 2; export all meshes with the same")


def test_other_number_of_vertices(tmp_path: Path) -> None:
    obj(tmp_path / "0_neutral.obj", 0)
    write_obj(tmp_path / "1.obj", np.vstack([VERTICES, [[9, 9, 9]]]), FACES)
    refused(tmp_path, r"'.*1\.obj' has 6 vertices, but the neutral '.*' has 5")
    (tmp_path / "1.obj").unlink()
    np.savez(tmp_path / "1.npz", vertices=np.zeros((3, 4, 3)))
    refused(tmp_path, r"'.*1\.npz' has 4 vertices")


def test_broken_line_of_a_mesh(tmp_path: Path) -> None:
    obj(tmp_path / "0_neutral.obj", 0)
    text = obj(tmp_path / "1.obj", 1).read_text().splitlines()
    for row, place in (("v 1 zwei 3", "line 3"), ("v 1 2", "line 3")):
        (tmp_path / "1.obj").write_text("\n".join([*text[:2], row, *text[3:]]))
        refused(tmp_path, rf"1\.obj' is broken at {place}")


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_what_is_not_finite(tmp_path: Path, value: float) -> None:
    stack = np.stack([frame(i) for i in range(4)])
    stack[2, 3, 1] = value
    refused(arrays(tmp_path / "a.npz", stack), r"Vertex 4 of frame 3 of '.*a\.npz' is not finite")
    obj(tmp_path / "0_neutral.obj", 0)
    obj(tmp_path / "1.obj", 2)
    lines = (tmp_path / "1.obj").read_text().splitlines()
    fourth = [i for i, line in enumerate(lines) if line.startswith("v ")][3]
    x, _, z = lines[fourth].split()[1:]
    lines[fourth] = f"v {x} {value} {z}"
    (tmp_path / "1.obj").write_text("\n".join(lines))
    (tmp_path / "a.npz").unlink()
    refused(tmp_path, r"Vertex 4 of '.*1\.obj' is not finite")


@pytest.mark.parametrize("compressed", [False, True])
def test_truncated_archive(tmp_path: Path, compressed: bool) -> None:
    path = arrays(tmp_path / "a.npz", np.random.default_rng(0).random((50, 5, 3)), compressed=compressed)
    whole = path.read_bytes()
    for share in (0.1, 0.5, 0.95):
        path.write_bytes(whole[: int(share * len(whole))])
        refused(path, r"'.*a\.npz' is damaged")
    for place in range(40, len(whole) - 30, 97):
        damaged = bytearray(whole)
        damaged[place] ^= 0xFF
        path.write_bytes(bytes(damaged))
        # What is wrong shows, or the numbers are others; nothing else happens.
        with contextlib.suppress(FacePoserError):
            read_all(path)


def test_claims_without_data(tmp_path: Path) -> None:
    path = tmp_path / "a.npz"
    refused(with_header(path, (10**12, 5, 3)), r"a\.npz' is damaged")
    refused(with_header(path, (3, 10**12, 3)), r"declares 1000000000000 vertices")
    refused(with_header(path, (3, 5, 3), b"\0" * 179), r"a\.npz' is damaged")
    refused(with_header(path, (1_000_001, 1, 3), b"\0" * 12_000_012), r"1000001 frames, more than 1000000")


def test_other_arrays(tmp_path: Path) -> None:
    path = tmp_path / "a.npz"
    np.savez(path, points=np.zeros((2, 5, 3)))
    refused(path, r"a\.npz' has no array 'vertices'")
    refused(arrays(path, np.zeros((2, 5, 2))), "store them as floating-point numbers of shape")
    refused(arrays(path, np.zeros((2, 5, 3), dtype=int)), "store them as floating-point numbers of shape")
    refused(arrays(path, np.asfortranarray(np.zeros((2, 5, 3)))), "in Fortran order")
    refused(arrays(path, np.zeros((0, 5, 3))), "store them as floating-point numbers of shape")
    ragged = np.array([np.zeros((5, 3)), np.zeros((4, 3))], dtype=object)
    refused(arrays(path, ragged), "are object of shape")
    path.write_text("no archive")
    refused(path, r"a\.npz' is damaged or is not an \.npz file")


def test_other_faces(tmp_path: Path) -> None:
    path = tmp_path / "a.npz"
    stack = np.zeros((2, 5, 3))
    for faces in ([[0, 1, 5]], [[0, -1, 2]], [[0.0, 1.0, 2.0]], [0, 1, 2], np.zeros((0, 3), dtype=int), [[0, 1]]):
        refused(arrays(path, stack, faces), r"The faces in '.*a\.npz' must be vertex numbers from 0")
    refused(arrays(path, stack, np.array([None, None])), r"The faces in .*a\.npz")
    np.savez(path, vertices=stack)
    refused(path, r"has no 'faces' .* specify the neutral mesh with --neutral")


def test_no_meshes(tmp_path: Path) -> None:
    refused(tmp_path, "contains no meshes; add OBJ")
    refused(tmp_path / "missing", "is not a folder of meshes or an .npz file")
    text = tmp_path / "a.txt"
    text.write_text("")
    refused(text, "is not a folder of meshes")
