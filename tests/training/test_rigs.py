"""Rigs become characters: whatever their axes, units, spellings and seams, and back out as they came."""

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from faceposer.errors import FacePoserError
from faceposer.geometry.mesh_io import read_mesh
from faceposer.geometry.obj_io import write_obj
from faceposer.geometry.polygon_mesh import Group, MorphMesh, PolygonMesh
from faceposer.interchange.meshes import write_posed_obj
from faceposer.model.character_file import load_character, save_character
from faceposer.model.face_model import build_face_model
from faceposer.model.materials import BASE_COLOURS
from faceposer.progress import CancelledError, Progress
from faceposer.solve.problem import PoseProblem
from faceposer.training.parts import material_of
from faceposer.training.rigs import RigOptions, character_from_morphs, character_from_rig
from tests.training.faces import base, morph_mesh, rotation

OPTIONS = RigOptions("me", "Me")


def imported(rig: MorphMesh):  # type: ignore[no-untyped-def]
    return character_from_morphs(rig, "me.glb", OPTIONS, Progress())


def test_a_rig_in_the_programs_axes_stays_as_it_is() -> None:
    character, face = imported(morph_mesh()), base()
    assert [part.name for part in character.parts] == [part.name for part in face.parts]
    assert [part.material for part in character.parts] == [part.material for part in face.parts]
    man = load_character("man")
    # It is laid on the man, so that its own proportions may shift it a little.
    assert np.abs(character.vertices - face.vertices).max() < 0.12 * np.ptp(man.vertices[:, 1])
    assert character.origin is not None
    gram = character.origin.linear @ character.origin.linear.T
    np.testing.assert_allclose(gram, gram[0, 0] * np.eye(3), atol=1e-6)
    assert character.summary["missing"] == []


def test_turned_scaled_and_shifted_rigs_give_the_same_model() -> None:
    one = imported(morph_mesh())
    other = imported(morph_mesh(rotation(1), 0.01, np.array([3.0, -40.0, 7.0])))
    np.testing.assert_allclose(other.vertices, one.vertices, atol=1e-3)
    np.testing.assert_allclose(other.shapes, one.shapes, atol=1e-3)
    assert other.feature_points == one.feature_points
    models = build_face_model(one), build_face_model(other)
    assert models[0].n_coefficients == models[1].n_coefficients
    weights = {"mouthSmileLeft": 0.8, "browInnerUp": 0.4}
    first, second = (model.instance(model.coefficients_of(weights)) for model in models)
    np.testing.assert_allclose(second, first, atol=2e-3)


def test_a_pose_goes_back_in_the_files_axes_unit_and_order(tmp_path: Path) -> None:
    rig = morph_mesh(rotation(2), 0.013, np.array([1.0, 2.0, 3.0]))
    character = imported(rig)
    save_character(tmp_path / "me.npz", character)
    model = build_face_model(load_character(tmp_path / "me.npz"))
    weights = {"jawOpen": 0.5, "eyeBlinkLeft": 1.0}
    write_posed_obj(tmp_path / "pose.obj", model, model.coefficients_of(weights), contact=False)
    mesh = read_mesh(tmp_path / "pose.obj")
    expected = rig.mesh.vertices + sum(value * rig.targets[name] for name, value in weights.items())
    size = np.ptp(rig.mesh.vertices, axis=0).max()
    moved = np.linalg.norm(expected - rig.mesh.vertices, axis=1).max()
    assert np.linalg.norm(mesh.vertices - expected, axis=1).max() < 0.1 * moved
    np.testing.assert_array_equal(mesh.polygons, rig.mesh.polygons)
    np.testing.assert_array_equal(mesh.polygon_uvs, rig.mesh.polygon_uvs)
    np.testing.assert_allclose(mesh.uv, rig.mesh.uv, atol=1e-6)
    assert mesh.groups == rig.mesh.groups
    write_posed_obj(tmp_path / "neutral.obj", model, model.neutral())
    np.testing.assert_allclose(read_mesh(tmp_path / "neutral.obj").vertices, rig.mesh.vertices, atol=1e-7 * size)


def test_seams_are_closed_for_the_light_and_open_in_the_file(tmp_path: Path) -> None:
    rig = morph_mesh()
    # As in glTF, every corner of a face is a vertex of its own.
    used = rig.mesh.polygons >= 0
    ids = rig.mesh.polygons[used]
    soup = np.full(rig.mesh.polygons.shape, -1, dtype=np.int32)
    soup[used] = np.arange(len(ids))
    mesh = PolygonMesh(rig.mesh.vertices[ids], soup, groups=rig.mesh.groups)
    character = imported(MorphMesh(mesh, {name: offsets[ids] for name, offsets in rig.targets.items()}))
    whole = imported(rig)
    assert len(character.vertices) <= len(whole.vertices)
    assert len(character.vertices) > 0.9 * len(whole.vertices)
    write_posed_obj(
        tmp_path / "a.obj", build_face_model(character), np.zeros(build_face_model(character).n_coefficients)
    )
    back = read_mesh(tmp_path / "a.obj")
    np.testing.assert_array_equal(back.polygons, soup)
    np.testing.assert_allclose(back.vertices, mesh.vertices, atol=1e-5)
    assert not len(back.uv)


def test_large_faces_and_interleaved_groups_come_back(tmp_path: Path) -> None:
    rig = morph_mesh()
    skin = next(group for group in rig.mesh.groups if group.material == "skin")
    first, last = skin.polygons
    middle = (first + last) // 2
    groups = (
        *(group for group in rig.mesh.groups if group.polygons[1] <= first),
        Group("head", (first, middle), "skin"),
        Group("scalp", (middle, last), "skin"),
        *(group for group in rig.mesh.groups if group.polygons[0] >= last),
    )
    triangles = rig.mesh.triangles()[:1]
    wide = np.full((len(rig.mesh.polygons) + 1, 5), -1, dtype=np.int32)
    wide[:-1, : rig.mesh.polygons.shape[1]] = rig.mesh.polygons
    wide[-1] = [*triangles[0], *rig.mesh.polygons[1, :2]]
    mesh = PolygonMesh(rig.mesh.vertices, wide, groups=groups)
    character = imported(replace(rig, mesh=mesh))
    assert [part.name for part in character.parts].count("scalp") == 0, "head and scalp share vertices: one part"
    write_posed_obj(
        tmp_path / "a.obj", build_face_model(character), np.zeros(build_face_model(character).n_coefficients)
    )
    back = read_mesh(tmp_path / "a.obj")
    np.testing.assert_array_equal(back.polygons, wide)
    assert {"head", "scalp"} <= {group.name for group in back.groups}


def test_spellings_missing_empty_and_foreign_shapes_are_reported() -> None:
    rig = morph_mesh()
    spelled = {name: name.replace("Left", "_L").replace("Right", "_R") for name in rig.targets}
    targets = {f"Head.{spelled[name]}": shape for name, shape in rig.targets.items()}
    targets.pop("Head.tongueOut")
    targets["Head.jawForward"] = np.zeros_like(targets["Head.jawForward"])
    targets["Head.mySpecial"] = targets["Head.jawOpen"]
    character = imported(replace(rig, targets=targets))
    assert character.summary["missing"] == ["tongueOut"]
    assert character.summary["empty"] == ["jawForward"]
    assert character.summary["not_arkit"] == ["Head.mySpecial"]
    build_face_model(character)


def test_shapes_in_halves_can_be_moved_by_themselves() -> None:
    rig = morph_mesh()
    x = rig.mesh.vertices[:, :1]
    left = 1.0 / (1.0 + np.exp(-4.0 * x))
    targets = dict(rig.targets)
    for name in ("browInnerUp", "cheekPuff"):
        whole = targets.pop(name)
        targets |= {f"{name}_L": (left * whole).astype("f4"), f"{name}_R": ((1.0 - left) * whole).astype("f4")}
    character = imported(replace(rig, targets=targets))
    assert character.summary["missing"] == []
    assert len(character.shape_names) == 54
    model = build_face_model(character)
    raised = model.instance(model.coefficients_of({"browInnerUpLeft": 1.0})) - character.vertices
    up = raised[:, 1]
    assert up[character.vertices[:, 0] > 0.8].max() > 4.0 * up[character.vertices[:, 0] < -0.8].max()
    energy, gradient = PoseProblem(model, []).energy_and_gradient(model.neutral())
    assert np.isfinite(energy)
    np.testing.assert_allclose(gradient, 0.0, atol=1e-9)


def test_eyes_without_shapes_follow_the_gaze_and_get_a_look() -> None:
    rig = morph_mesh()
    eyes = {part.name: part for part in base().parts if part.material == "eye"}
    targets = {name: offsets.copy() for name, offsets in rig.targets.items()}
    for offsets in targets.values():
        for part in eyes.values():
            offsets[slice(*part.vertices)] = 0.0
    character = imported(replace(rig, targets=targets))
    assert sorted(character.summary["eyes_turned"]) == sorted(eyes)
    left = next(part for part in character.parts if part.name == "eye_left")
    ball = slice(*left.vertices)
    outward = character.shapes[character.shape_names.index("eyeLookOutLeft"), ball]
    front = character.vertices[ball, 2].argmax()
    assert outward[front, 0] > 0.3, "the front of the left eye turns to its left"
    assert character.shapes[character.shape_names.index("eyeLookUpLeft"), ball][front, 1] > 0.2
    assert character.textures["eye"]


def test_landmarks_lie_where_they_belong() -> None:
    face, character = base(), imported(morph_mesh())
    assert character.origin is not None
    for name in ("8.3", "8.4", "2.1", "3.1", "3.2", "4.1", "4.2"):
        found = character.feature_points[name]
        file_vertex = int(np.flatnonzero(character.origin.vertex_ids == found)[0])
        assert np.linalg.norm(face.vertices[file_vertex] - face.vertices[face.feature_points[name]]) < 1.2, name
    centre = {name: character.vertices[ids].mean(axis=0) for name, ids in character.regions.items()}
    assert centre["brow_left"][0] > 1.0 > -1.0 > centre["brow_right"][0]
    assert centre["brow_left"][1] > centre["mouth"][1]


def test_folders_of_shapes_are_rigs(tmp_path: Path) -> None:
    rig = morph_mesh()
    for name in ("neutral", "jawOpen", "mouthSmile_L", "mouthSmile_R", "browInnerUp", "eyeBlink_L", "eyeBlink_R"):
        ours = name.replace("_L", "Left").replace("_R", "Right")
        vertices = rig.mesh.vertices + (0.0 if name == "neutral" else rig.targets[ours])
        write_obj(tmp_path / f"face_{name}.obj", vertices, rig.mesh.polygons)
    character = character_from_rig(tmp_path, OPTIONS)
    assert set(character.shape_names) == {
        "jawOpen",
        "mouthSmileLeft",
        "mouthSmileRight",
        "browInnerUp",
        "eyeBlinkLeft",
        "eyeBlinkRight",
    }
    assert len(character.summary["missing"]) == 46
    build_face_model(character)


def test_rigs_of_few_shapes_are_refused() -> None:
    rig = morph_mesh()
    with pytest.raises(FacePoserError, match=r"me\.glb' has 1 of ARKit's 52 shapes.*'jawOpen', 'smug'"):
        imported(replace(rig, targets={"jawOpen": rig.targets["jawOpen"], "smug": rig.targets["mouthSmileLeft"]}))


def test_a_training_can_be_stopped() -> None:
    with pytest.raises(CancelledError, match="nothing was written"):
        character_from_morphs(morph_mesh(), "me.glb", OPTIONS, Progress(cancelled=lambda: True))


@pytest.mark.skipif("FACEPOSER_RIGS" not in os.environ, reason="FACEPOSER_RIGS does not name the folder of rigs")
def test_a_rig_of_another_program() -> None:
    path = Path(os.environ["FACEPOSER_RIGS"]) / "facecap_multi.glb"
    character = character_from_rig(path, OPTIONS)
    assert [part.name for part in character.parts] == [
        "eyeLeft",
        "eyeRight",
        "teeth",
        "head",
        "head_teeth",
        "head_mouth",
    ]
    assert [part.material for part in character.parts] == ["eye", "eye", "teeth", "skin", "teeth", "gums"]
    # Its exporter has lost the places of the eyes.
    assert "eyeLeft and eyeRight are in the same place" in character.summary["warnings"][0]
    assert character.summary["empty"] == ["tongueOut"]
    corners = character.vertices[[character.feature_points["8.3"], character.feature_points["8.4"]]]
    np.testing.assert_allclose(corners[0], corners[1] * [-1, 1, 1], atol=0.3)
    assert max(build_face_model(character).reconstruction_error().values()) < 0.15


def test_left_and_right_exchanged_is_noticed() -> None:
    assert imported(morph_mesh()).summary["warnings"] == []
    rig = morph_mesh()
    mirror = np.array([-1.0, 1.0, 1.0])
    faces = rig.mesh.polygons
    flipped = np.where(faces[:, 3:] >= 0, faces[:, ::-1], faces[:, [2, 1, 0, 3]])
    mesh = PolygonMesh(rig.mesh.vertices * mirror, flipped, groups=rig.mesh.groups)
    targets = {name: (offsets * mirror).astype(np.float32) for name, offsets in rig.targets.items()}
    character = imported(MorphMesh(mesh, targets))
    # With faces that point outwards, it cannot be told from a face with names of the viewer's side.
    assert "named from the viewer's side" in character.summary["warnings"][0]
    # The face still looks forward, with the mouth below the brows, and the left corner is on the left.
    corner, chin = (character.vertices[character.feature_points[name]] for name in ("8.3", "2.1"))
    assert corner[0] > 1.0
    assert chin[1] < corner[1]
    assert corner[2] > 4.0


@pytest.mark.parametrize(
    ("names", "material"),
    [
        (("teeth", "skin"), "teeth"),
        (("LowerTeeth_mesh",), "teeth"),
        (("tongue", ""), "tongue"),
        (("upper_gums", "skin"), "gums"),
        (("Mouth", "skin"), "gums"),
        (("head", "InnerMouth_mat"), "gums"),
        (("N00_FaceMouth_00_FACE",), "gums"),
        (("mouth_lips",), "skin"),
        (("head", "skin"), "skin"),
    ],
)
def test_what_lies_in_a_mouth_has_its_material_by_its_name(names: tuple[str, ...], material: str) -> None:
    assert material_of(*names) == material
    assert BASE_COLOURS[material] != BASE_COLOURS["skin"] or material == "skin"
