"""Meshes and weights become poses and performances again, or one sentence says why not."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from faceposer.errors import FacePoserError
from faceposer.geometry.obj_io import write_obj
from faceposer.interchange.formats import write
from faceposer.interchange.glb import write_glb
from faceposer.interchange.meshes import write_posed_obj, write_posed_ply
from faceposer.interchange.reading import read_performance, read_pose
from faceposer.model.character import ARKIT_SHAPES
from faceposer.model.character_file import load_character
from faceposer.model.face_model import FaceModel, build_face_model
from faceposer.model.performance import Performance
from faceposer.model.sampling import resampled
from faceposer.model.shape_names import weight_map
from faceposer.progress import Progress
from faceposer.render.options import OutputOptions
from faceposer.training.rigs import RigOptions, character_from_morphs
from faceposer.training.weights_file import read_weights
from tests.rigs import with_wholes
from tests.training.faces import morph_mesh, rotation

SHORT_TIMECODES = "Its timecodes do not tell how many frames they count per second; 60 were assumed"


def distance(model: FaceModel, one: np.ndarray, other: np.ndarray) -> float:
    """Return how far apart two poses are at most, in centimetres."""
    return float(np.linalg.norm(model.instance(one) - model.instance(other), axis=1).max())


@pytest.mark.parametrize("suffix", [".obj", ".ply"])
def test_an_exported_mesh_is_its_pose(suffix: str, low: FaceModel, performance: Performance, tmp_path: Path) -> None:
    pose = performance.coefficients[3]
    # The contact step is no part of the pose.
    write(tmp_path / f"a{suffix}", low, pose, OutputOptions(contact=False))
    read = read_pose(tmp_path / f"a{suffix}", low)
    assert distance(low, read.coefficients, pose) < 1e-4
    assert read.note == "The pose matches the mesh exactly."


def test_a_mesh_goes_through_the_unit_and_axes_of_its_origin(tmp_path: Path) -> None:
    rig = morph_mesh(rotation(4), 0.01, np.array([3.0, -2.0, 1.0]))
    character = character_from_morphs(rig, "rig", RigOptions("a", "A"), Progress())
    assert character.origin is not None
    model = build_face_model(character)
    pose = model.coefficients_of({"jawOpen": 0.6, "mouthSmileLeft": 0.7})
    write_posed_obj(tmp_path / "a.obj", model, pose, contact=False)
    assert distance(model, read_pose(tmp_path / "a.obj", model).coefficients, pose) < 1e-3


def test_what_the_face_cannot_do_is_told_in_millimetres(low: FaceModel, tmp_path: Path) -> None:
    pose = low.coefficients_of({"jawOpen": 0.5})
    bumped = low.instance(pose).astype(np.float64)
    bumped[100] += [0.0, 0.0, 2.0]
    write_obj(tmp_path / "a.obj", bumped, low.character.polygons)
    read = read_pose(tmp_path / "a.obj", low)
    assert distance(low, read.coefficients, pose) < 0.3
    most = float(read.note.split("maximum ")[1].split(" mm")[0])
    assert 15.0 < most < 20.5


def test_the_pose_is_the_nearest_in_least_squares(low: FaceModel, tmp_path: Path) -> None:
    rng = np.random.default_rng(2)
    target = low.instance(low.coefficients_of({"jawOpen": 0.5})) + 0.2 * rng.standard_normal(
        (len(low.character.vertices), 3)
    )
    write_obj(tmp_path / "a.obj", target, low.character.polygons)
    found = read_pose(tmp_path / "a.obj", low).coefficients
    residual = (low.instance(found) - target).ravel()
    slopes = low.basis @ residual
    assert np.abs(slopes).max() < 1e-3 * np.linalg.norm(residual) * np.linalg.norm(low.basis, axis=1).max()


def test_a_mesh_of_another_topology_is_told_with_both_counts(low: FaceModel, model: FaceModel, tmp_path: Path) -> None:
    write_posed_ply(tmp_path / "low.ply", low, low.neutral())
    few, many = len(low.character.vertices), len(model.character.vertices)
    with pytest.raises(FacePoserError, match=rf"has {few} vertices, but Man has {many}"):
        read_pose(tmp_path / "low.ply", model)


def test_a_mesh_that_was_moved_turned_and_scaled_is_laid_back(low: FaceModel, tmp_path: Path) -> None:
    pose = low.coefficients_of({"jawOpen": 0.7, "mouthSmileLeft": 1.0, "browInnerUp": 0.5})
    moved = 0.01 * low.instance(pose).astype(np.float64) @ rotation(6).T + [4.0, -2.0, 1.0]
    write_obj(tmp_path / "a.obj", moved, low.character.polygons)
    read = read_pose(tmp_path / "a.obj", low)
    assert read.note.endswith("it was aligned with the face by all its vertices.")
    assert distance(low, read.coefficients, pose) < 0.01


@pytest.mark.parametrize("mirror", [(-1.0, 1.0, 1.0), (1.0, -100.0, 1.0), (1.0, 1.0, -1.0), (-2.0, -2.0, -2.0)])
def test_a_mirrored_mesh_is_mirrored_back(mirror: tuple[float, ...], low: FaceModel, tmp_path: Path) -> None:
    coefficients = low.coefficients_of({"mouthSmileLeft": 1.0, "jawOpen": 0.3})
    scale = np.abs(mirror).max() * np.sign(mirror)
    write_obj(tmp_path / "a.obj", low.instance(coefficients) * scale, low.character.polygons)
    read = read_pose(tmp_path / "a.obj", low)
    assert "The mesh is mirrored; it was mirrored back." in read.note
    np.testing.assert_allclose(read.coefficients, coefficients, atol=1e-3)


@pytest.mark.parametrize("mirror", [(-1.0, 1.0, 1.0), (1.0, -1.0, 1.0), (1.0, 1.0, -1.0)])
def test_a_mirrored_mesh_is_recognised_on_every_head(
    mirror: tuple[float, ...], model: FaceModel, tmp_path: Path
) -> None:
    coefficients = model.coefficients_of({"mouthSmileLeft": 1.0, "jawOpen": 0.3})
    # Faces may be turned round and listed in another order.
    faces = model.character.polygons[::-1]
    write_obj(tmp_path / "a.obj", model.instance(coefficients) * mirror, faces)
    read = read_pose(tmp_path / "a.obj", model)
    assert "The mesh is mirrored; it was mirrored back." in read.note
    np.testing.assert_allclose(model.weights_of(read.coefficients), model.weights_of(coefficients), atol=0.02)


def test_the_mirror_image_of_a_flat_face_is_recognised(low: FaceModel, tmp_path: Path) -> None:
    flat = build_face_model(
        replace(
            low.character,
            vertices=(low.character.vertices * (1.0, 1.0, 0.1)).astype(np.float32),
            shapes=(low.character.shapes * (1.0, 1.0, 0.1)).astype(np.float32),
        )
    )
    coefficients = flat.coefficients_of({"mouthSmileLeft": 1.0, "jawOpen": 0.3})
    write_obj(tmp_path / "a.obj", flat.instance(coefficients) * (1.0, 1.0, -1.0), flat.character.polygons)
    read = read_pose(tmp_path / "a.obj", flat)
    assert "The mesh is mirrored; it was mirrored back." in read.note


def test_a_mesh_that_was_only_sculpted_stays_where_it_is(low: FaceModel, tmp_path: Path) -> None:
    pose = low.coefficients_of({"jawOpen": 0.5})
    sculpted = low.instance(pose).astype(np.float64)
    sculpted[low.character.vertices[:, 1] > 10.0] += [0.0, 1.0, 0.0]
    write_obj(tmp_path / "a.obj", sculpted, low.character.polygons)
    read = read_pose(tmp_path / "a.obj", low)
    assert "moved back" not in read.note
    assert distance(low, read.coefficients, pose) < 0.5


@pytest.mark.parametrize("spoil", [lambda v: v[::-1], lambda v: 0 * v])
def test_a_mesh_that_is_no_pose_is_refused(
    spoil: Callable[[np.ndarray], np.ndarray], low: FaceModel, tmp_path: Path
) -> None:
    write_obj(tmp_path / "a.obj", spoil(low.character.vertices), low.character.polygons)
    with pytest.raises(FacePoserError, match=r"is not a pose of Low-poly head: the mean error is \d+ mm"):
        read_pose(tmp_path / "a.obj", low)


@pytest.mark.parametrize("suffix", [".csv", ".json"])
def test_weights_are_the_performance_again(suffix: str, low: FaceModel, tmp_path: Path) -> None:
    rng = np.random.default_rng(8)
    inside = rng.uniform(0.0, 1.0, (7, 52)) * (rng.random((7, 52)) < 0.3)
    # Live Link Face has one value for both sides of browInnerUp and cheekPuff.
    inside = inside @ weight_map(low.character.shape_names, ARKIT_SHAPES).T
    performance = Performance.from_weights(low, inside, 24.0)
    path = tmp_path / f"a{suffix}"
    write(path, low, performance)
    read = read_performance(path, low)
    # Timecodes of less than a second do not tell their base.
    assert read.note == ("" if suffix == ".json" else f"{SHORT_TIMECODES}.")
    assert read.performance.rate == pytest.approx(24.0)
    assert len(read.performance) == 7
    for ours, theirs in zip(performance.coefficients, read.performance.coefficients, strict=True):
        assert distance(low, ours, theirs) < 0.15
    third = read_pose(path, low, 2)
    np.testing.assert_array_equal(third.coefficients, read.performance.coefficients[2])
    assert third.note == f"Frame 3 of 7. {read.note}".strip()
    with pytest.raises(FacePoserError, match="the frames 1 to 7, but no frame 8"):
        read_pose(path, low, 7)


def test_a_pose_in_json_is_one_frame_without_a_rate(low: FaceModel, tmp_path: Path) -> None:
    write(tmp_path / "a.json", low, low.coefficients_of({"jawOpen": 0.4}))
    data = json.loads((tmp_path / "a.json").read_text())
    assert data["format"] == "faceposer.weights"
    assert data["names"] == list(low.character.shape_names)
    assert len(data["frames"]) == 1
    assert "rate" not in data
    assert data["frames"][0][data["names"].index("jawOpen")] == pytest.approx(0.4, abs=0.02)
    with pytest.raises(FacePoserError, match="a single frame"):
        read_pose(tmp_path / "a.json", low, 1)


def test_halves_and_wholes_in_files_are_understood_on_every_rig(low: FaceModel, tmp_path: Path) -> None:
    whole = build_face_model(with_wholes(low.character))

    def read(model: FaceModel, **weights: float) -> np.ndarray:
        data = {"format": "faceposer.weights", "version": 1, "names": [*weights], "frames": [[*weights.values()]]}
        (tmp_path / "a.json").write_text(json.dumps(data))
        pose = read_pose(tmp_path / "a.json", model)
        assert pose.note == ""
        return pose.coefficients

    def same(model: FaceModel, pose: np.ndarray, **weights: float) -> None:
        assert distance(model, pose, model.coefficients_of(weights)) < 1e-6

    same(low, read(low, browInnerUp=0.6), browInnerUpLeft=0.6, browInnerUpRight=0.6)
    same(whole, read(whole, browInnerUpLeft=0.8, browInnerUpRight=0.4), browInnerUp=0.6)
    same(low, read(low, browInnerUp=0.3, browInnerUpLeft=0.2), browInnerUpLeft=0.5, browInnerUpRight=0.3)
    pose = low.coefficients_of({"browInnerUpLeft": 0.9, "browInnerUpRight": 0.3, "cheekPuff": 0.5, "jawOpen": 0.2})
    write_glb(tmp_path / "a.glb", low, pose)
    assert distance(low, read_pose(tmp_path / "a.glb", low).coefficients, pose) < 1e-4


def test_modes_beyond_one_come_back(tmp_path: Path) -> None:
    goblin = build_face_model(load_character("creature"))
    high = goblin.character.shape_limits[:, 1].astype(np.float64)
    pose = goblin.coefficients_of(0.9 * high)
    write(tmp_path / "a.json", goblin, pose)
    assert read_weights(tmp_path / "a.json").frames.max() > 1.5
    assert distance(goblin, read_pose(tmp_path / "a.json", goblin).coefficients, pose) < 0.01


def test_foreign_shapes_are_left_out_and_told(low: FaceModel, tmp_path: Path) -> None:
    data = {"format": "faceposer.weights", "version": 1, "names": ["jawOpen", "hat"], "frames": [[1.0, 3.0]]}
    (tmp_path / "a.json").write_text(json.dumps(data))
    read = read_pose(tmp_path / "a.json", low)
    assert read.note == "1 of its 2 shapes was not read, because Low-poly head does not have them."
    assert distance(low, read.coefficients, low.coefficients_of({"jawOpen": 1.0})) < 1e-6


GOOD = {"format": "faceposer.weights", "version": 1, "rate": 30, "names": ["jawOpen", "tongueOut"], "frames": [[0, 1]]}


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"format": "faceposer.session"}, '"format"'),
        ({"version": 2}, "version is 2"),
        ({"names": []}, "names must be a list of 1 to"),
        ({"names": ["jawOpen", "jawOpen"]}, "'jawOpen' twice"),
        ({"names": ["jawOpen", "JawOpen"]}, "the shape jawOpen twice with different weights"),
        ({"names": ["hat", "scarf"]}, "none of the shapes of Low-poly head"),
        ({"frames": []}, "frames must be a list of at least 1"),
        ({"frames": [[0, 1], [0]]}, r"frames\[1\] must be a list of 2 weights"),
        ({"frames": [[0, "much"]]}, r"frames\[0\]\[1\] must be a number from -1000 to 1000, not 'much'"),
        ({"frames": [[0, float("nan")]]}, r"frames\[0\]\[1\] must be a number from -1000 to 1000, not NaN"),
        ({"frames": [[0, True]]}, r"frames\[0\]\[1\] must be a number from -1000 to 1000, not true"),
        ({"rate": 0}, "rate must be a number of frames per second .*, not 0"),
        ({"rate": "fast"}, "rate must be a number .*, not 'fast'"),
    ],
)
def test_broken_weights_get_one_sentence(change: dict[str, object], said: str, low: FaceModel, tmp_path: Path) -> None:
    path = tmp_path / "a.json"
    path.write_text(json.dumps(GOOD))
    read_performance(path, low)
    path.write_text(json.dumps(GOOD | change))
    with pytest.raises(FacePoserError, match=said) as error:
        read_performance(path, low)
    assert str(path) in str(error.value)
    assert str(error.value).endswith(".")


@pytest.mark.parametrize(
    ("text", "said"), [("{", "line 1, column 2"), ("[" * 100_000, "not valid JSON"), ("[]", 'no "format"')]
)
def test_what_is_no_json_gets_one_sentence(text: str, said: str, low: FaceModel, tmp_path: Path) -> None:
    (tmp_path / "a.json").write_text(text)
    with pytest.raises(FacePoserError, match=said):
        read_performance(tmp_path / "a.json", low)


def test_other_files_get_one_sentence(low: FaceModel, tmp_path: Path) -> None:
    with pytest.raises(FacePoserError, match="is not a pose"):
        read_pose(tmp_path / "a.fbx", low)
    with pytest.raises(FacePoserError, match="is not an animation"):
        read_performance(tmp_path / "a.obj", low)
    with pytest.raises(FacePoserError, match="cannot be read"):
        read_performance(tmp_path / "none.json", low)
    with pytest.raises(FacePoserError, match=r"must end in one of \.glb"):
        write(tmp_path / "a.fbx", low, low.neutral())
    with pytest.raises(FacePoserError, match="holds one pose, not 2"):
        write(tmp_path / "a.ply", low, Performance(np.zeros((2, low.n_coefficients)), 30.0))


def test_resampling_keeps_time_ends_and_straight_lines() -> None:
    ramp = Performance(np.arange(31.0)[:, None] * [1.0, -2.0], 30.0)
    film = resampled(ramp, 24.0)
    assert (len(film), film.rate) == (25, 24.0)
    np.testing.assert_allclose(film.coefficients[:, 0], np.arange(25) * 30.0 / 24.0)
    np.testing.assert_allclose(film.coefficients[-1], [30.0, -60.0])
    # The last pose is held, so that as many seconds are left.
    twice = resampled(ramp, 60.0)
    assert twice.seconds == pytest.approx(ramp.seconds)
    np.testing.assert_array_equal(twice.coefficients[-2:], [[30.0, -60.0]] * 2)
    with pytest.raises(FacePoserError, match=r"3e\+10 seconds at 24 frames per second give more than"):
        resampled(Performance(ramp.coefficients, 1e-9), 24.0)
    still = resampled(Performance(np.ones((1, 2)), 30.0), 24.0)
    assert (len(still), still.rate) == (1, 24.0)
