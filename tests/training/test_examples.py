"""Example meshes become a character that makes them again, whatever the head did, and faces like them."""

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from faceposer.errors import FacePoserError
from faceposer.geometry.alignment import rigid_alignment
from faceposer.geometry.camera import OrbitView
from faceposer.geometry.mesh_io import read_mesh
from faceposer.geometry.mesh_sequence import frames_of, open_sequence, write_frames
from faceposer.geometry.picking import SurfacePoint
from faceposer.geometry.polygon_mesh import PolygonMesh
from faceposer.interchange.meshes import write_posed_obj
from faceposer.model.character import Character
from faceposer.model.character_file import load_character, save_character
from faceposer.model.face_model import build_face_model
from faceposer.progress import Progress
from faceposer.solve.constraints.point import PointConstraint
from faceposer.solve.map_solver import solve
from faceposer.solve.problem import PoseProblem
from faceposer.training.examples import ExampleOptions, character_from_examples, character_from_sequence
from tests.training.faces import base, poses, rotation, write_examples

OPTIONS = ExampleOptions("me", "Me")
COUNT = 30


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("examples")
    write_examples(path, COUNT)
    return path


@pytest.fixture(scope="module")
def character(folder: Path) -> Character:
    return character_from_examples(folder, OPTIONS)


def test_the_summary_says_what_was_learned(character: Character) -> None:
    summary = character.summary
    assert summary["examples"] == COUNT + 1
    assert "neutral.obj" in summary["neutral"]
    assert summary["kept_energy"] > 0.99
    assert summary["worst"]["kept_energy"] == min(summary["kept_by_region"].values()) > 0.97
    assert set(summary["kept_by_region"]) == {"brow left", "brow right", "eye left", "eye right", "mouth"}
    curves = summary["curves"]
    assert np.all(np.diff(curves["compactness"]) >= -1e-9)
    assert np.all(np.diff(curves["generalization_cm"]) <= 1e-9)
    assert 0 < curves["generalization_cm"][-1] < curves["neutral_cm"]
    assert summary["prior"]["components"] >= 1


def refitted(character: Character, truth: NDArray[np.float32]) -> NDArray[np.float64]:
    """The face of the character that comes nearest to a frame of its files, in the files' place, (M, 3)."""
    model, origin = build_face_model(character), character.origin
    assert origin is not None
    flat = model.basis.astype(np.float64)
    moved = origin.character_vertices(truth.astype(np.float64), len(character.vertices)).ravel()
    p = np.linalg.lstsq(flat.T, moved, rcond=None)[0]
    return origin.vertices_of(model.instance(p) - character.vertices)


def test_examples_are_made_again_in_the_files_place(folder: Path, character: Character, tmp_path: Path) -> None:
    save_character(tmp_path / "me.npz", character)
    loaded = load_character(tmp_path / "me.npz")
    for truth in poses(COUNT)[::7]:
        made = refitted(loaded, truth)
        # How the head is laid on the neutral leaves a faint motion of all of it.
        made = rigid_alignment(made, truth).apply(made)
        far, missed = (np.linalg.norm(mesh - truth, axis=1) for mesh in (base().vertices, made))
        assert missed.mean() < 0.5 * far.mean()
    write_posed_obj(tmp_path / "pose.obj", build_face_model(loaded), build_face_model(loaded).neutral())
    mesh, original = read_mesh(tmp_path / "pose.obj"), read_mesh(folder / "neutral.obj")
    np.testing.assert_array_equal(mesh.vertices, original.vertices)
    np.testing.assert_array_equal(mesh.polygons, original.polygons)
    assert mesh.groups == original.groups


def test_a_drag_moves_what_the_examples_move_and_leaves_other_regions(character: Character) -> None:
    model = build_face_model(character)
    assert character.origin is not None
    ours = {name: int(character.origin.vertex_ids[vertex]) for name, vertex in base().feature_points.items()}
    camera = OrbitView.preset(character.vertices.min(axis=0), character.vertices.max(axis=0)).camera((800, 800))
    brow = ours["4.3"]
    pixel = camera.project(character.vertices[[brow]])[0]
    constraint = PointConstraint(
        SurfacePoint.at_vertex(character.triangles, brow), (float(pixel[0]), float(pixel[1] - 15)), camera
    )
    solution = solve(PoseProblem(model, [constraint]))
    assert solution.residuals_px[0] < 12.0
    moved = np.linalg.norm(model.instance(solution.coefficients) - character.vertices, axis=1)
    assert moved[brow] > 0.15
    assert moved[ours["8.2"]] < 0.35 * moved[brow], "the mouth hardly follows"
    rest = solve(PoseProblem(model, []))
    np.testing.assert_allclose(rest.coefficients, 0.0, atol=1e-6)


def test_turned_scaled_and_shaken_examples_give_the_same_model(character: Character, tmp_path: Path) -> None:
    write_examples(tmp_path, COUNT, turn=rotation(3), scale=0.01)
    other = character_from_examples(tmp_path, OPTIONS)
    # A vertex that lies between two regions may fall to the other one, and a mode of little energy with it.
    assert abs(len(other.shape_names) - len(character.shape_names)) <= 2
    assert np.abs(other.vertices - character.vertices).max() < 0.02 * np.ptp(character.vertices[:, 1])
    for truth in poses(COUNT)[::7]:
        far = np.linalg.norm(truth - base().vertices, axis=1)
        difference = refitted(other, 0.01 * truth @ rotation(3).T) @ rotation(3) / 0.01 - refitted(character, truth)
        assert np.linalg.norm(difference, axis=1).mean() < 0.03 * far.mean()
    assert other.summary["prior"]["components"] == character.summary["prior"]["components"]


def test_whole_faces_and_a_fixed_number_of_modes(folder: Path) -> None:
    whole = character_from_examples(folder, ExampleOptions("me", "Me", segments="whole", n_dimensions=5))
    assert len(whole.shape_names) == 5
    assert whole.shape_names[0] == "face 1"
    fixed = ExampleOptions("me", "Me", n_dimensions=9, n_components=2, n_factors=3)
    parted = character_from_examples(folder, fixed)
    assert len(parted.shape_names) == 9
    assert parted.summary["prior"]["fixed_by_user"]
    assert (parted.summary["prior"]["components"], parted.summary["prior"]["factors"]) == (2, 3)
    found = character_from_examples(folder, ExampleOptions("me", "Me", segments=3))
    assert 3 <= len({name.rsplit(" ", 1)[0] for name in found.shape_names}) <= 6
    for character in (whole, parted, found):
        build_face_model(character)


def test_a_few_examples_work_and_are_called_few(tmp_path: Path) -> None:
    write_examples(tmp_path, 3)
    character = character_from_examples(tmp_path, OPTIONS)
    assert any("too few" in warning for warning in character.summary["warnings"])
    build_face_model(character)


def test_arrays_are_examples_too(tmp_path: Path) -> None:
    face = base()
    frames = np.concatenate([face.vertices[None], poses(12)])
    np.savez_compressed(tmp_path / "frames.npz", vertices=frames, faces=face.triangles)
    character = character_from_examples(tmp_path / "frames.npz", OPTIONS)
    assert character.summary["examples"] == 13
    write_frames(tmp_path / "streamed.npz", iter(frames), 13, len(face.vertices))
    mesh = PolygonMesh(face.vertices.astype(np.float64), face.polygons)
    streamed = character_from_sequence(
        frames_of(tmp_path / "streamed.npz", mesh, "the neutral"), "streamed", OPTIONS, Progress()
    )
    np.testing.assert_allclose(streamed.shapes, character.shapes, atol=2e-3)


def test_meshes_that_tell_nothing_are_refused(tmp_path: Path) -> None:
    face = base()
    mesh = {"vertices": np.repeat(face.vertices[None], 4, axis=0), "faces": face.triangles}
    np.savez(tmp_path / "same.npz", **mesh)
    with pytest.raises(FacePoserError, match=r"same\.npz' are all the same"):
        character_from_examples(tmp_path / "same.npz", OPTIONS)
    np.savez(tmp_path / "one.npz", vertices=face.vertices, faces=face.triangles)
    with pytest.raises(FacePoserError, match="single mesh"):
        character_from_examples(tmp_path / "one.npz", OPTIONS)


def test_a_frame_of_another_topology_is_named(tmp_path: Path) -> None:
    paths = write_examples(tmp_path, 3)
    lines = paths[2].read_text().splitlines()
    last = max(i for i, line in enumerate(lines) if line.startswith("f "))
    words = lines[last].split()
    lines[last] = " ".join([words[0], *words[:0:-1]])
    paths[2].write_text("\n".join(lines))
    with pytest.raises(FacePoserError, match=r"topology of '.*frame2\.obj' differs.*face \d+ differs"):
        character_from_examples(tmp_path, OPTIONS)
    assert len(open_sequence(tmp_path)) == 4
