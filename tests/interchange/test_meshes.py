"""Exported meshes are the solver's face with the character's topology, one by one and as sequences."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh

from faceposer.errors import FacePoserError
from faceposer.geometry.mesh_io import read_mesh
from faceposer.geometry.polygon_mesh import Group
from faceposer.interchange.meshes import write_posed_obj, write_posed_ply, write_sequence
from faceposer.model.face_model import FaceModel, build_face_model
from faceposer.model.origin import Origin
from faceposer.model.performance import Performance
from faceposer.progress import Progress


def test_obj_is_the_posed_face(model: FaceModel, tmp_path: Path) -> None:
    pose = model.coefficients_of({"jawOpen": 0.5, "mouthSmileLeft": 1.0})
    write_posed_obj(tmp_path / "pose.obj", model, pose)
    mesh, character = read_mesh(tmp_path / "pose.obj"), model.character
    height = np.ptp(character.vertices[:, 1])
    assert np.abs(mesh.vertices - model.surface(pose)).max() < 1e-5 * height
    np.testing.assert_array_equal(mesh.polygons, character.polygons)
    np.testing.assert_array_equal(mesh.polygon_uvs, character.polygon_uvs)
    np.testing.assert_allclose(mesh.uv, character.uv, atol=1e-6)
    np.testing.assert_allclose(np.linalg.norm(mesh.normals, axis=1), 1.0, atol=1e-3)
    text = (tmp_path / "pose.obj").read_text()
    for part in character.parts:
        material = "gums_throat" if part.name == "throat" else part.material
        assert f"\ng {part.name}\nusemtl {material}\n" in text


def test_ply_is_the_posed_face(low: FaceModel, tmp_path: Path) -> None:
    pose = low.coefficients_of({"jawOpen": 0.5, "mouthSmileLeft": 1.0})
    write_posed_ply(tmp_path / "pose.ply", low, pose)
    mesh = read_mesh(tmp_path / "pose.ply")
    np.testing.assert_array_equal(mesh.vertices, low.surface(pose))
    np.testing.assert_array_equal(mesh.polygons, low.character.polygons)
    np.testing.assert_allclose(np.linalg.norm(mesh.normals, axis=1), 1.0, atol=1e-5)


@pytest.fixture
def inches(low: FaceModel) -> FaceModel:
    """The head as if it came from a file in inches with z up, each corner of a triangle a vertex of its own."""
    character = low.character
    corners = character.triangles.ravel().astype(np.int32)
    linear = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]]) / 2.54
    neutral = character.vertices[corners] @ linear.T + [1.0, 2.0, 3.0]
    faces = np.arange(len(corners), dtype=np.int32).reshape(-1, 3)
    no_uvs = np.zeros((0, 3), dtype=np.int32)
    origin = Origin(linear, neutral, corners, faces, np.zeros((0, 2)), no_uvs, (Group("all", (0, len(faces))),))
    return build_face_model(replace(character, origin=origin))


def test_ply_goes_back_to_the_unit_and_the_order_of_its_origin(inches: FaceModel, tmp_path: Path) -> None:
    pose = inches.coefficients_of({"jawOpen": 1.0})
    write_posed_ply(tmp_path / "a.ply", inches, pose)
    mesh, origin = read_mesh(tmp_path / "a.ply"), inches.character.origin
    assert origin is not None
    np.testing.assert_array_equal(mesh.polygons, origin.polygons)
    moved = inches.surface(pose) - inches.character.vertices
    expected = origin.neutral + moved[origin.vertex_ids] @ origin.linear.T
    np.testing.assert_allclose(mesh.vertices, expected, atol=1e-5)
    # Of binary PLY, trimesh reads those whose faces have the same number of corners.
    theirs = trimesh.load(tmp_path / "a.ply", process=False)
    np.testing.assert_allclose(theirs.vertices, expected, atol=1e-5)
    np.testing.assert_array_equal(theirs.faces, origin.polygons)
    assert np.median(np.einsum("ij,ij->i", mesh.normals, theirs.vertex_normals)) > 0.9


@pytest.mark.parametrize("kind", ["obj", "ply"])
def test_a_sequence_is_a_folder_of_the_frames(
    kind: str, low: FaceModel, performance: Performance, tmp_path: Path
) -> None:
    shares: list[float] = []
    files = write_sequence(tmp_path / "take", low, performance, kind, Progress(lambda _, share: shares.append(share)))  # type: ignore[arg-type]
    assert [file.name for file in files] == [f"take.{i:04}.{kind}" for i in range(1, 10)]
    assert sorted((tmp_path / "take").glob(f"*.{kind}")) == files
    assert [*tmp_path.iterdir()] == [tmp_path / "take"]
    assert shares == sorted(shares)
    assert shares[-1] == 1
    assert len(shares) == 9
    for file, pose in zip(files, performance.coefficients, strict=True):
        np.testing.assert_allclose(read_mesh(file).vertices, low.surface(pose), atol=1e-5)
    write_posed_obj(tmp_path / "one.obj", low, performance.coefficients[4])
    if kind == "obj":
        alone = (tmp_path / "one.obj").read_bytes().replace(b"mtllib one.mtl", b"mtllib take.mtl")
        assert files[4].read_bytes() == alone


def test_a_sequence_that_is_stopped_leaves_nothing_behind(
    low: FaceModel, performance: Performance, tmp_path: Path
) -> None:
    def stop(_stage: str, share: float) -> None:
        if share > 0.5:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_sequence(tmp_path / "take", low, performance, "ply", Progress(stop))
    assert not [*tmp_path.iterdir()]


def test_a_sequence_replaces_an_empty_folder_and_nothing_else(
    low: FaceModel, performance: Performance, tmp_path: Path
) -> None:
    short = Performance(performance.coefficients[:2], 24.0)
    (tmp_path / "take").mkdir()
    write_sequence(tmp_path / "take", low, short, "ply")
    with pytest.raises(FacePoserError, match="not an empty folder"):
        write_sequence(tmp_path / "take", low, performance, "ply")
    assert len([*(tmp_path / "take").iterdir()]) == 2
    with pytest.raises(FacePoserError, match="cannot be written"):
        write_sequence(tmp_path / "none" / "take", low, short, "ply")
