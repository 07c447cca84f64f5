"""The GLB is the face, as independent readers see it: its geometry under weights, its animation, pictures and names."""

import io
import json
import os
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pygltflib
import pytest
import trimesh
from PIL import Image

from faceposer.errors import FacePoserError
from faceposer.geometry.gltf_io import read_gltf
from faceposer.interchange.glb import write_glb
from faceposer.interchange.gltf_builder import GltfBuilder
from faceposer.model.character import ARKIT_SHAPES
from faceposer.model.character_file import load_character
from faceposer.model.face_model import FaceModel, build_face_model
from faceposer.model.performance import Performance
from faceposer.training.rigs import RigOptions, character_from_rig
from tests.interchange.gltf_checks import check

SCRIPT = Path(__file__).parents[2] / "scripts" / "validate_gltf.mjs"


@pytest.fixture(scope="module")
def animated(low: FaceModel, performance: Performance, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("glb") / "low.glb"
    write_glb(path, low, performance)
    return path


class Reader:
    """The file as pygltflib has it, with the mathematics of the standard on top."""

    def __init__(self, path: Path) -> None:
        self.file = pygltflib.GLTF2().load(str(path))

    def array(self, number: int) -> np.ndarray:
        accessor = self.file.accessors[number]
        view = self.file.bufferViews[accessor.bufferView]
        columns = {"SCALAR": 1, "VEC2": 2, "VEC3": 3}[accessor.type]
        dtype = {5123: "<u2", 5125: "<u4", 5126: "<f4"}[accessor.componentType]
        begin = (view.byteOffset or 0) + (accessor.byteOffset or 0)
        flat = np.frombuffer(self.file.binary_blob(), dtype, accessor.count * columns, begin)
        return flat.reshape(accessor.count, columns)

    def soup(self, weights: np.ndarray | None = None) -> np.ndarray:
        """Return the corners of all triangles, (T, 3, 3), under ``weights`` or the default ones."""
        corners = []
        for node in self.file.nodes:
            if node.mesh is None:
                continue
            assert node.matrix is None
            assert node.scale is None
            mesh = self.file.meshes[node.mesh]
            for primitive in mesh.primitives:
                points = self.array(primitive.attributes.POSITION).astype(np.float64)
                used = mesh.weights if weights is None else weights
                for weight, target in zip([] if used is None else used, primitive.targets or [], strict=False):
                    points += weight * self.array(target["POSITION"])
                corners.append(points[self.array(primitive.indices)[:, 0]])
        return np.concatenate(corners).reshape(-1, 3, 3)


def expected_soup(model: FaceModel, pose: np.ndarray) -> np.ndarray:
    return 0.01 * model.instance(pose)[model.triangles].astype(np.float64)


def moving_parts(model: FaceModel) -> set[str]:
    character = model.character
    return {part.name for part in character.parts if character.shapes[:, slice(*part.vertices)].any()}


def test_the_structure_is_as_the_standard_asks(animated: Path, low: FaceModel) -> None:
    document = check(animated)
    names = [list(mesh["extras"]["targetNames"]) for mesh in document["meshes"] if "extras" in mesh]
    assert names
    assert all(name == [*low.character.shape_names, "browInnerUp", "cheekPuff"] for name in names)
    assert [mesh["name"] for mesh in document["meshes"]] == [part.name for part in low.character.parts]
    assert document["asset"]["generator"].startswith("Face Poser")
    assert document["asset"]["copyright"] == " ".join(low.character.credits.split())
    assert {mesh["name"] for mesh in document["meshes"] if "targets" in mesh["primitives"][0]} == moving_parts(low)


def test_what_never_moves_has_no_targets(low: FaceModel, performance: Performance, tmp_path: Path) -> None:
    shapes = low.character.shapes.copy()
    for name in ("teeth_upper", "eye_left"):
        shapes[:, slice(*low.character.part(name).vertices)] = 0.0
    model = build_face_model(replace(low.character, shapes=shapes))
    frames = np.zeros((len(performance), model.n_coefficients))
    write_glb(tmp_path / "a.glb", model, Performance(frames, performance.rate))
    document = check(tmp_path / "a.glb")
    still = {mesh["name"] for mesh in document["meshes"] if "targets" not in mesh["primitives"][0]}
    assert {"teeth_upper", "eye_left"} <= still
    assert still == {part.name for part in low.character.parts} - moving_parts(model)
    moved = {document["nodes"][channel["target"]["node"]]["name"] for channel in document["animations"][0]["channels"]}
    assert moved == moving_parts(model)


def test_every_frame_is_our_face_in_metres(animated: Path, low: FaceModel, performance: Performance) -> None:
    reader = Reader(animated)
    (animation,) = reader.file.animations
    (sampler,) = animation.samplers
    assert sampler.interpolation == "LINEAR"
    np.testing.assert_allclose(reader.array(sampler.input)[:, 0], np.arange(9) / 24.0, atol=1e-6)
    frames = reader.array(sampler.output).reshape(9, -1)
    assert frames.min() < -0.01, "weights beyond the limits are what this is about"
    for weights, pose in zip(frames, performance.coefficients, strict=True):
        np.testing.assert_allclose(reader.soup(weights), expected_soup(low, pose), atol=2e-6)
    assert {channel.target.node for channel in animation.channels} == {
        i for i, node in enumerate(reader.file.nodes) if node.mesh is not None and node.name in moving_parts(low)
    }


def test_a_pose_is_the_default_weights(low: FaceModel, tmp_path: Path) -> None:
    pose = low.coefficients_of({"jawOpen": 0.7, "mouthSmileLeft": 1.0, "eyeBlinkRight": 1.0})
    write_glb(tmp_path / "a.glb", low, pose)
    reader = Reader(tmp_path / "a.glb")
    assert not reader.file.animations
    np.testing.assert_allclose(reader.soup(), expected_soup(low, pose), atol=2e-6)
    np.testing.assert_allclose(reader.soup(np.zeros(56)), expected_soup(low, low.neutral()), atol=2e-6)


def test_what_halves_have_in_common_is_under_arkits_name(low: FaceModel, tmp_path: Path) -> None:
    pose = low.coefficients_of({"browInnerUpLeft": 0.9, "browInnerUpRight": 0.4, "cheekPuff": 0.5})
    write_glb(tmp_path / "a.glb", low, pose)
    reader = Reader(tmp_path / "a.glb")
    names = reader.file.meshes[0].extras["targetNames"]
    weights = dict(zip(names, reader.file.meshes[0].weights, strict=True))
    assert {name for name in ARKIT_SHAPES if name not in names} == set()
    assert weights["browInnerUp"] == pytest.approx(0.4, abs=0.05)
    assert weights["browInnerUpLeft"] == pytest.approx(0.5, abs=0.1)
    assert weights["browInnerUpRight"] == pytest.approx(0.0, abs=1e-9)
    assert weights["cheekPuff"] == pytest.approx(0.5, abs=0.05)
    np.testing.assert_allclose(reader.soup(), expected_soup(low, pose), atol=2e-6)


def test_normals_turn_with_the_shapes(animated: Path, low: FaceModel) -> None:
    reader = Reader(animated)
    primitive = reader.file.meshes[0].primitives[0]
    jaw = low.character.shape_names.index("jawOpen")
    turned = reader.array(primitive.attributes.NORMAL) + reader.array(primitive.targets[jaw]["NORMAL"])
    np.testing.assert_allclose(np.linalg.norm(turned, axis=1), 1.0, atol=1e-3)
    points = reader.array(primitive.attributes.POSITION) + reader.array(primitive.targets[jaw]["POSITION"])
    faces = reader.array(primitive.indices).reshape(-1, 3)
    flat = np.cross(points[faces[:, 1]] - points[faces[:, 0]], points[faces[:, 2]] - points[faces[:, 0]])
    flat /= np.maximum(np.linalg.norm(flat, axis=1, keepdims=True), 1e-20)
    assert np.median(np.einsum("ij,ij->i", flat, turned[faces[:, 0]])) > 0.95


def test_pictures_and_their_places_come_along(animated: Path, low: FaceModel) -> None:
    reader, character = Reader(animated), low.character
    skin = reader.file.meshes[0].primitives[0]
    texture = reader.file.materials[skin.material].pbrMetallicRoughness.baseColorTexture.index
    view = reader.file.bufferViews[reader.file.images[reader.file.textures[texture].source].bufferView]
    picture = reader.file.binary_blob()[view.byteOffset : view.byteOffset + view.byteLength]
    assert picture == character.textures["skin"]
    assert Image.open(io.BytesIO(picture)).size[0] > 8
    uv = reader.array(skin.attributes.TEXCOORD_0)[reader.array(skin.indices)[:, 0]]
    first, last = character.part_triangles(character.part("skin"))
    expected = character.uv[character.triangle_uvs[first:last]].reshape(-1, 2)
    np.testing.assert_allclose(uv[:, 0], expected[:, 0], atol=1e-6)
    np.testing.assert_allclose(uv[:, 1], 1.0 - expected[:, 1], atol=1e-6)


def test_parts_without_pictures_have_colours(low: FaceModel, tmp_path: Path) -> None:
    plain = build_face_model(replace(low.character, textures={}))
    write_glb(tmp_path / "a.glb", plain, plain.neutral())
    document = check(tmp_path / "a.glb")
    assert "images" not in document
    colours = {m["name"]: m["pbrMetallicRoughness"]["baseColorFactor"] for m in document["materials"]}
    assert colours["skin"] != colours["teeth"]


def test_trimesh_opens_it(animated: Path, low: FaceModel) -> None:
    scene = trimesh.load(animated)
    assert sum(len(mesh.faces) for mesh in scene.geometry.values()) == len(low.triangles)
    low_corner, high_corner = 0.01 * low.character.vertices.min(axis=0), 0.01 * low.character.vertices.max(axis=0)
    np.testing.assert_allclose(scene.bounds, [low_corner, high_corner], atol=1e-5)


def test_our_own_reader_has_the_same_shapes_and_parts(animated: Path, low: FaceModel) -> None:
    morphs, character = read_gltf(animated), low.character
    assert tuple(morphs.targets) == (*character.shape_names, "browInnerUp", "cheekPuff")
    assert [group.name for group in morphs.mesh.groups] == [part.name for part in character.parts]
    assert morphs.textures == dict(character.textures)
    corners = morphs.mesh.triangles()
    halves = morphs.targets["browInnerUpLeft"] + morphs.targets["browInnerUpRight"]
    np.testing.assert_allclose(morphs.targets["browInnerUp"], halves, atol=1e-6)
    np.testing.assert_allclose(morphs.mesh.vertices[corners], 0.01 * character.vertices[character.triangles], atol=1e-6)
    for name, shape in zip(character.shape_names, character.shapes, strict=True):
        np.testing.assert_allclose(morphs.targets[name][corners], 0.01 * shape[character.triangles], atol=1e-6)


def test_it_trains_the_same_face_again(animated: Path, low: FaceModel) -> None:
    again = character_from_rig(animated, RigOptions("again", "Again"))
    assert set(again.shape_names) == set(low.character.shape_names)
    # Training makes all heads alike in size.
    scales = np.ptp(again.vertices, axis=0) / np.ptp(low.character.vertices, axis=0)
    np.testing.assert_allclose(scales, scales[0], rtol=0.02)
    for name in ("jawOpen", "mouthSmileLeft", "browInnerUpLeft"):
        ours = low.character.shapes[low.character.shape_names.index(name)]
        theirs = again.shapes[again.shape_names.index(name)]
        assert np.linalg.norm(theirs, axis=1).max() == pytest.approx(
            scales[0] * np.linalg.norm(ours, axis=1).max(), rel=0.02
        )


@pytest.mark.parametrize("name", ["creature", "woman"])
def test_other_characters_are_well_formed(name: str, tmp_path: Path) -> None:
    model = build_face_model(load_character(name))
    write_glb(tmp_path / "a.glb", model, Performance(np.zeros((2, model.n_coefficients)), 30.0))
    document = check(tmp_path / "a.glb")
    wholes = [] if name == "creature" else ["browInnerUp", "cheekPuff"]
    assert document["meshes"][0]["extras"]["targetNames"] == [*model.character.shape_names, *wholes]


@pytest.mark.skipif(
    shutil.which("node") is None or not os.environ.get("GLTF_VALIDATOR"),
    reason="needs node, and the folder of the npm package gltf-validator in GLTF_VALIDATOR",
)
def test_the_validator_of_khronos_finds_nothing(animated: Path, tmp_path: Path) -> None:
    def validate(path: Path) -> subprocess.CompletedProcess[str]:
        return subprocess.run(["node", str(SCRIPT), str(path)], capture_output=True, text=True, check=False)

    result = validate(animated)
    assert result.returncode == 0, result.stdout + result.stderr
    assert "0 errors, 0 warnings" in result.stdout
    (tmp_path / "broken.glb").write_bytes(animated.read_bytes().replace(b'"max":[', b'"max":[9', 1))
    assert validate(tmp_path / "broken.glb").returncode == 1, "or else it checks nothing"


def test_a_folder_that_is_not_there_gets_a_sentence(low: FaceModel, tmp_path: Path) -> None:
    with pytest.raises(FacePoserError, match=r"The model '.*a\.glb' cannot be written: No such file"):
        write_glb(tmp_path / "none" / "a.glb", low, low.neutral())
    assert not [*tmp_path.iterdir()]


def test_a_file_beyond_four_gigabytes_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    builder = GltfBuilder({})
    builder.view(b"abc")
    assert len(builder.to_bytes()) % 4 == 0
    assert json.loads(builder.to_bytes()[20:].split(b"]}")[0] + b"]}")["bufferViews"][0]["byteLength"] == 3
    monkeypatch.setattr("faceposer.interchange.gltf_builder._MAX_BYTES", 64)
    with pytest.raises(FacePoserError, match="4 GB"):
        builder.to_bytes()
