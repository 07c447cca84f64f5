"""Weights of morph targets come out of glTF files: our own exactly, and others' as the standard means them."""

from pathlib import Path

import numpy as np
import pygltflib
import pytest

from faceposer.errors import FacePoserError
from faceposer.interchange.glb import write_glb
from faceposer.interchange.reading import read_performance, read_pose
from faceposer.model.face_model import FaceModel
from faceposer.model.performance import Performance
from faceposer.training.gltf_weights import read_gltf_weights
from faceposer.training.named_weights import NamedWeights


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
    read = read_gltf_weights(tmp_path / "a.glb")
    np.testing.assert_allclose(read.frames[:, 0], [0, 0, 0, 1, 1, 1, 1, 1, 1, 0.2], atol=1e-6)
    keys = [[9, 9, 0, 0.5, 0, 0], [0, 0, 1, 0.25, 9, 9]]
    write_curve(tmp_path / "b.glb", [0.0, 1.0], [value for key in keys for value in key], "CUBICSPLINE")
    t = np.arange(31) / 30.0
    smooth = 3.0 * t**2 - 2.0 * t**3
    read = read_gltf_weights(tmp_path / "b.glb")
    np.testing.assert_allclose(read.frames, np.stack([smooth, 0.5 - 0.25 * smooth], axis=1), atol=1e-6)
    keys[1][0] = 3.0
    write_curve(tmp_path / "c.glb", [0.0, 1.0], [value for key in keys for value in key], "CUBICSPLINE")
    bent = read_gltf_weights(tmp_path / "c.glb").frames[:, 0]
    np.testing.assert_allclose(bent, smooth + 3.0 * (t**3 - t**2), atol=1e-6)


@pytest.mark.parametrize(
    ("frames", "rate", "found"),
    [
        ([0, 59], 24.0, 24.0),
        ([0, 10, 13, 30, 37, 59], 30.0, 30.0),
        ([0, 7, 20, 26, 59], 24.0, 24.0),
        ([0, 13, 17, 40], 25.0, 25.0),
        ([0, 7, 31], 60.0, 60.0),
        ([0, 2, 2.5, 6], 1.0, 30.0),
        ([0, 1, 2, 10, 11, 12, 40, 59], 24.0, 24.0),
        ([0, 1.234, 3.777], 1.0, 30.0),
    ],
)
@pytest.mark.parametrize("kind", ["LINEAR", "STEP"])
def test_no_key_is_lost(frames: list[float], rate: float, found: float, kind: str, tmp_path: Path) -> None:
    times = [2.0 + frame / rate for frame in frames]
    weights = [0.1 * (i + 1) for i in range(len(times))]
    write_curve(tmp_path / "a.glb", times, [value for weight in weights for value in (weight, 0.0)], kind)
    read = read_gltf_weights(tmp_path / "a.glb")
    assert read.rate == pytest.approx(found, rel=1e-3)
    assert read.frames[-1, 0] == pytest.approx(weights[-1])
    assert len(read.frames) == np.ceil((times[-1] - times[0]) * found - 1e-2) + 1
    if float(frames[-1]) != 3.777:
        at = np.rint((np.array(times) - 2.0) * found).astype(int)
        np.testing.assert_allclose(read.frames[at, 0], weights, atol=1e-4)


def test_percentages_are_told_from_large_weights(tmp_path: Path) -> None:
    times = [i / 24.0 for i in range(10)]

    def read(most: float, names: tuple[str, ...] = ("jawOpen", "eyeBlink_L")) -> NamedWeights:
        weights = [value for i in range(10) for value in (most * i / 9.0, 0.5 * most)]
        write_curve(tmp_path / "a.glb", times, weights, names=names)
        return read_gltf_weights(tmp_path / "a.glb")

    percent = read(100.0)
    assert percent.frames.max() == pytest.approx(1.0)
    assert percent.notes == ("The weights reach 100 and were read as percentages.",)
    for most in (1.0, 1.05, 1.9):
        assert read(most).frames.max() == pytest.approx(most)
        assert read(most).notes == ()
    assert read(100.0, ("hat", "scarf")).frames.max() == pytest.approx(100.0)
    for most in (4.0, 5000.0):
        with pytest.raises(FacePoserError, match=r"of 'jawOpen' in .* which is neither of 0 to 1 nor of 0 to 100"):
            read(most)


def test_names_are_understood_however_they_are_spelled(low: FaceModel, tmp_path: Path) -> None:
    write_curve(tmp_path / "a.glb", [], [0.0])
    pose = read_pose(tmp_path / "a.glb", low)
    expected = low.coefficients_of({"jawOpen": 0.25, "eyeBlinkLeft": 0.5})
    np.testing.assert_allclose(pose.coefficients, expected, atol=1e-9)


@pytest.mark.parametrize(
    ("times", "weights", "said"),
    [
        ([0.0, 0.1], [0.0, 0.0, 1.0], "3 weights for 2 key frames of 2 morph targets"),
        ([0.1, 0.0], [0.0] * 4, "are not increasing: key 2 is at 0 s after 0.1 s"),
        ([0.0, 0.1], [0.0, 0.0, 1.0, float("nan")], "a weight of its key 2 is not finite"),
        ([0.0, float("nan")], [0.0] * 4, "the time of its key 2 is not finite"),
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
