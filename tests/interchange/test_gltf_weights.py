"""Weights of morph targets come out of glTF files: our own exactly, and others' as the standard means them."""

from pathlib import Path

import numpy as np
import pygltflib
import pytest

from faceposer.errors import FacePoserError
from faceposer.interchange.glb import write_glb
from faceposer.interchange.gltf_weights import read_gltf_weights
from faceposer.interchange.reading import read_performance, read_pose
from faceposer.model.face_model import FaceModel
from faceposer.model.performance import Performance


def test_our_own_animation_comes_back(low: FaceModel, performance: Performance, tmp_path: Path) -> None:
    write_glb(tmp_path / "a.glb", low, performance)
    read = read_performance(tmp_path / "a.glb", low)
    assert read.note == ""
    assert read.performance.rate == pytest.approx(24.0)
    np.testing.assert_allclose(read.performance.coefficients, performance.coefficients, atol=1e-4)
    write_glb(tmp_path / "b.glb", low, performance.coefficients[2])
    pose = read_pose(tmp_path / "b.glb", low)
    np.testing.assert_allclose(pose.coefficients, performance.coefficients[2], atol=1e-4)


def write_curve(
    path: Path,
    times: list[float],
    weights: list[float],
    kind: str = "LINEAR",
    names: tuple[str, ...] = ("jawOpen", "eyeBlink_L"),
) -> None:
    """Write a triangle with two targets whose weights run as a curve."""
    points = np.zeros((3, 3), dtype="<f4")
    arrays = [points, np.array(times, dtype="<f4"), np.array(weights, dtype="<f4")]
    blob = b"".join(array.tobytes() for array in arrays)
    starts = np.cumsum([0, *(array.nbytes for array in arrays)]).tolist()
    file = pygltflib.GLTF2(
        buffers=[pygltflib.Buffer(byteLength=len(blob))],
        bufferViews=[
            pygltflib.BufferView(buffer=0, byteOffset=start, byteLength=array.nbytes)
            for start, array in zip(starts, arrays, strict=False)
        ],
        accessors=[
            pygltflib.Accessor(bufferView=0, componentType=5126, count=3, type="VEC3"),
            pygltflib.Accessor(bufferView=1, componentType=5126, count=len(times), type="SCALAR"),
            pygltflib.Accessor(bufferView=2, componentType=5126, count=len(weights), type="SCALAR"),
        ],
        meshes=[
            pygltflib.Mesh(
                primitives=[
                    pygltflib.Primitive(attributes=pygltflib.Attributes(POSITION=0), targets=[{"POSITION": 0}] * 2)
                ],
                weights=[0.25, 0.5],
                extras={"targetNames": list(names)},
            )
        ],
        nodes=[pygltflib.Node(mesh=0)],
        scenes=[pygltflib.Scene(nodes=[0])],
        scene=0,
    )
    if times:
        file.animations = [
            pygltflib.Animation(
                samplers=[pygltflib.AnimationSampler(input=1, output=2, interpolation=kind)],
                channels=[
                    pygltflib.AnimationChannel(
                        sampler=0, target=pygltflib.AnimationChannelTarget(node=0, path="weights")
                    )
                ],
            )
        ]
    file.set_binary_blob(blob)
    file.save_binary(str(path))


def test_uneven_keys_become_even_frames(tmp_path: Path) -> None:
    write_curve(tmp_path / "a.glb", [1.0, 1.1, 1.2, 1.6], [0, 0, 1, 0, 0, 1, 0.5, 1])
    read = read_gltf_weights(tmp_path / "a.glb")
    assert read.names == ("jawOpen", "eyeBlink_L")
    assert read.rate == pytest.approx(10.0)
    np.testing.assert_allclose(read.frames[:, 0], [0, 1, 0, 0.125, 0.25, 0.375, 0.5], atol=1e-5)
    np.testing.assert_allclose(read.frames[:, 1], [0, 0, 1, 1, 1, 1, 1], atol=1e-5)


def test_steps_hold_and_cubics_go_through_their_keys(tmp_path: Path) -> None:
    write_curve(tmp_path / "a.glb", [0.0, 0.1, 0.3], [0, 0, 1, 0.5, 0.2, 0], "STEP")
    np.testing.assert_allclose(read_gltf_weights(tmp_path / "a.glb").frames[:, 0][:3], [0, 1, 1], atol=1e-6)
    keys = [[9, 9, 0, 0.5, 9, 9], [9, 9, 1, 0.25, 9, 9]]
    write_curve(tmp_path / "b.glb", [0.0, 0.1], [value for key in keys for value in key], "CUBICSPLINE")
    np.testing.assert_allclose(read_gltf_weights(tmp_path / "b.glb").frames, [[0, 0.5], [1, 0.25]], atol=1e-6)


def test_names_are_understood_however_they_are_spelled(low: FaceModel, tmp_path: Path) -> None:
    write_curve(tmp_path / "a.glb", [], [0.0])
    pose = read_pose(tmp_path / "a.glb", low)
    expected = low.coefficients_of({"jawOpen": 0.25, "eyeBlinkLeft": 0.5})
    np.testing.assert_allclose(pose.coefficients, expected, atol=1e-9)


@pytest.mark.parametrize(
    ("times", "weights", "said"),
    [
        ([0.0, 0.1], [0.0, 0.0, 1.0], "3 weights for 2 key frames of 2 morph targets"),
        ([0.1, 0.0], [0.0] * 4, "are not increasing"),
        ([0.0, 0.1], [0.0, 0.0, 1.0, float("nan")], "not finite"),
        ([0.0, 0.001, 1e8], [0.0] * 6, "frames, more than"),
    ],
)
def test_broken_animations_get_one_sentence(
    times: list[float], weights: list[float], said: str, tmp_path: Path
) -> None:
    write_curve(tmp_path / "a.glb", times, weights)
    with pytest.raises(FacePoserError, match=said):
        read_gltf_weights(tmp_path / "a.glb")


def test_files_without_shapes_of_the_face_get_one_sentence(low: FaceModel, tmp_path: Path) -> None:
    write_curve(tmp_path / "a.glb", [], [0.0], names=("hat", "scarf"))
    with pytest.raises(FacePoserError, match="has none of the shapes of Low-poly head"):
        read_pose(tmp_path / "a.glb", low)
    write_curve(tmp_path / "b.glb", [], [0.0], names=())
    with pytest.raises(FacePoserError, match="no morph targets with names"):
        read_pose(tmp_path / "b.glb", low)
    (tmp_path / "c.glb").write_bytes(b"glTF" + bytes(10))
    with pytest.raises(FacePoserError, match="truncated"):
        read_pose(tmp_path / "c.glb", low)
    with pytest.raises(FacePoserError, match="cannot be read"):
        read_pose(tmp_path / "none.glb", low)


@pytest.mark.parametrize("hours", [10.0, 24.0])
def test_two_keys_far_apart_do_not_become_frames_for_hours(hours: float, low: FaceModel, tmp_path: Path) -> None:
    write_curve(tmp_path / "a.glb", [0.0, 0.5, 3600.0 * hours], [0.0, 0.0, 1.0, 0.0, 0.5, 0.0])
    said = r"has 3 keys in \d+ seconds, which would become \d+ frames|more than 1000000"
    with pytest.raises(FacePoserError, match=said):
        read_performance(tmp_path / "a.glb", low)
