"""The contact step corrects what penetrates and nothing else, alike on both sides, and steadily."""

import dataclasses
import os
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from faceposer.model.character_file import load_character
from faceposer.model.contact import lid_contact
from faceposer.model.contact.arch_contact import ArchContact
from faceposer.model.contact.arches import find_arches
from faceposer.model.contact.lips import find_covering
from faceposer.model.contact.measure import penetration_mm
from faceposer.model.contact.spreading import Spreading, hinge
from faceposer.model.contact.step import ContactStep
from faceposer.model.face_model import FaceModel, build_face_model
from faceposer.poses.applying import applied, weights_on
from faceposer.poses.library import starter_poses

Array = NDArray[np.float64]

ALLOWED_MM = 0.1
BLINK = {"eyeBlinkLeft": 1.6, "eyeBlinkRight": 1.6}
GRIN = {
    "mouthSmileLeft": 2.0,
    "mouthSmileRight": 2.0,
    "cheekSquintLeft": 2.0,
    "cheekSquintRight": 2.0,
    "eyeSquintLeft": 1.6,
    "eyeSquintRight": 1.6,
    "jawOpen": 0.4,
}


def test_lids_meet_beside_a_far_corner_of_the_eye(woman: FaceModel) -> None:
    mean, _ = woman.mixture.moments()
    pose = mean + 1.5 * (woman.mixture.draws(300, np.random.default_rng(5))[140] - mean)
    assert penetration_mm(woman, woman.instance(pose))["lid_lid"] > 1.0
    assert penetration_mm(woman, woman.surface(pose))["lid_lid"] < 0.05


@pytest.mark.parametrize("name", ["man", "woman", "low", "creature"])
def test_the_neutral_face_stays_bit_by_bit(name: str) -> None:
    character = load_character(name)
    step = ContactStep.of(character)
    assert step.parts
    np.testing.assert_array_equal(step.apply(character.vertices.copy()), character.vertices)


def test_a_pose_without_penetration_stays_bit_by_bit(model: FaceModel) -> None:
    p = model.coefficients_of({"browInnerUp": 0.8, "eyeWideLeft": 0.4, "noseSneerRight": 0.3})
    np.testing.assert_array_equal(model.surface(p), model.instance(p))


@pytest.mark.parametrize(("weights", "kind"), [(BLINK, "lid_lid"), (GRIN, "lids_eyeballs"), (GRIN, "lips_teeth")])
def test_what_penetrates_is_kept_apart(model: FaceModel, weights: dict[str, float], kind: str) -> None:
    p = model.coefficients_of(weights)
    assert penetration_mm(model, model.surface(p, contact=False))[kind] > 0.3
    assert max(penetration_mm(model, model.surface(p)).values()) <= ALLOWED_MM


@pytest.mark.parametrize(("pose", "strength"), [("W OO", -0.6), ("EE", 1.5), ("Happiness", 1.5)])
def test_no_lip_lies_behind_the_triangles_of_the_teeth(woman: FaceModel, pose: str, strength: float) -> None:
    fitting = (
        e.pose for e in starter_poses() if e.pose is not None and weights_on(e.pose, woman.character) is not None
    )
    chosen = next(each for each in fitting if each.name == pose)
    p = applied(woman, woman.neutral(), chosen, strength)
    deepest = dict.fromkeys((False, True), 0.0)
    for arch in find_arches(woman.character):
        lips = find_covering(woman.character, arch).lips
        corners = woman.character.vertices[arch.triangles].astype(np.float64)
        for contact in deepest:
            vertices = woman.surface(p, contact)
            resting = arch.resting(vertices[lips].astype(np.float64), vertices)
            near = resting[arch.gap(resting) < 0.1]
            deepest[contact] = max(
                deepest[contact], 10.0 * _depths_along_rays(corners, arch.axis, near).max(initial=0.0)
            )
    assert deepest[False] > 2.0 * ALLOWED_MM
    assert deepest[True] <= ALLOWED_MM


def _depths_along_rays(corners: Array, axis: tuple[float, float], points: Array) -> Array:
    """Return how far beyond ``points``, (n, 3), rays to them from an upright axis leave the triangles, or 0, (n,)."""
    depth = np.zeros(len(points))
    low, high = corners[..., 1].min(axis=1), corners[..., 1].max(axis=1)
    for i, point in enumerate(points):
        a, b, c = np.moveaxis(corners[(low <= point[1]) & (high >= point[1])], 1, 0)
        start = np.array([axis[0], point[1], axis[1]])
        radius = float(np.linalg.norm(point - start))
        normal = np.cross(point - start, c - a)
        scale = np.einsum("nd,nd->n", b - a, normal)
        scale[np.abs(scale) < 1e-14] = np.inf
        u = np.einsum("nd,nd->n", start - a, normal) / scale
        across = np.cross(start - a, b - a)
        v = across @ (point - start) / scale
        reached = np.einsum("nd,nd->n", c - a, across) / scale
        met = (u >= 0.0) & (v >= 0.0) & (u + v <= 1.0)
        depth[i] = radius * max(0.0, float((reached[met] - 1.0).max(initial=0.0)))
    return depth


def test_a_lip_that_rests_between_two_teeth_lies_behind_none_elsewhere(model: FaceModel) -> None:
    man = model.character
    arch = find_arches(man)[0]
    vertices = man.vertices.copy()
    resting = vertices[[9777]].astype(np.float64)
    inwards = resting[0, ::2] - arch.axis
    vertices[9777, ::2] -= (float(arch.gap(resting)[0]) - 0.002) * inwards / np.linalg.norm(inwards)
    assert arch.depth(vertices[[9777]].astype(np.float64)) == 0.0
    character = dataclasses.replace(man, vertices=vertices)
    step = ContactStep([ArchContact(character, find_arches(character)[0])])
    np.testing.assert_array_equal(step.apply(vertices.copy()), vertices)
    smile = sum(man.shapes[man.shape_names.index(f"mouthSmile{side}")] for side in ("Left", "Right"))
    posed = vertices + smile + 0.4 * man.shapes[man.shape_names.index("jawOpen")]
    assert penetration_mm(character, posed)["lips_teeth"] > 1.0
    assert penetration_mm(character, step.apply(posed))["lips_teeth"] < 0.02


@pytest.mark.slow
def test_a_goblin_without_arkit_shapes_is_kept_apart(creature: FaceModel) -> None:
    rng = np.random.default_rng(2)
    deepest = 0.0
    for p in 1.5 * creature.mixture.draws(12, rng):
        deepest = max(deepest, *penetration_mm(creature, creature.instance(p)).values())
        assert max(penetration_mm(creature, creature.surface(p)).values()) <= ALLOWED_MM
    assert deepest > 1.0


def test_gaze_takes_the_cornea_along(model: FaceModel) -> None:
    closed = {"eyeBlinkLeft": 1.0, "eyeBlinkRight": 1.0}
    straight, aside = (
        model.surface(model.coefficients_of(closed | look))
        for look in ({}, {"eyeLookOutLeft": 1.0, "eyeLookInRight": 1.0})
    )
    skin = slice(*model.character.part("skin").vertices)
    moved = (aside - straight)[skin] - (
        model.instance(model.coefficients_of(closed | {"eyeLookOutLeft": 1.0, "eyeLookInRight": 1.0}))
        - model.instance(model.coefficients_of(closed))
    )[skin]
    assert 0.0 < np.abs(moved).max() < 0.1


def test_both_sides_are_corrected_alike(model: FaceModel) -> None:
    character = model.character
    p = model.coefficients_of(BLINK | GRIN)
    moved = (model.surface(p) - model.instance(p)).astype(np.float64)
    from faceposer.geometry.mirror import SurfaceMirror

    skin = np.arange(*character.part("skin").vertices)
    across = SurfaceMirror(character.vertices, character.triangles, 1e-3).vertices[skin]
    paired = across >= 0
    assert paired.mean() > 0.99
    difference = np.abs(moved[skin[paired]] * [-1.0, 1.0, 1.0] - moved[across[paired]]).max()
    assert np.abs(moved).max() > 0.2
    assert difference < 0.02


def test_neighbouring_poses_stay_neighbours(model: FaceModel) -> None:
    start, end = (model.coefficients_of(weights) for weights in ({"jawOpen": 0.3}, BLINK | GRIN))
    before: tuple[Array, Array] | None = None
    for share in np.linspace(0.0, 1.0, 41):
        p = (1.0 - share) * start + share * end
        shape = model.instance(p).astype(np.float64)
        moved = model.surface(p) - shape
        if before is not None:
            step = np.linalg.norm(shape - before[0], axis=1).max()
            assert np.linalg.norm(moved - before[1], axis=1).max() < 2.5 * step
        before = shape, moved


def test_what_was_corrected_before_makes_no_difference(model: FaceModel) -> None:
    poses = [model.coefficients_of(weights) for weights in (BLINK, GRIN, {"jawOpen": 0.7}, BLINK | GRIN)]
    first = [model.surface(p) for p in poses]
    for p, vertices in reversed(list(zip(poses, first, strict=True))):
        np.testing.assert_array_equal(model.surface(p), vertices)
    np.testing.assert_array_equal(ContactStep.of(model.character).apply(model.instance(poses[-1])), first[-1])


def test_each_eye_is_corrected_as_if_it_were_alone(model: FaceModel, monkeypatch: pytest.MonkeyPatch) -> None:
    both, left, right = (
        model.instance(model.coefficients_of(dict.fromkeys(names, 1.6)))
        for names in (("eyeBlinkLeft", "eyeBlinkRight"), ("eyeBlinkLeft",), ("eyeBlinkRight",))
    )
    moves = [model.contact.apply(vertices.copy()) - vertices for vertices in (both, left, right)]
    assert all(np.abs(moved).max() > 0.2 for moved in moves)
    np.testing.assert_allclose(moves[0], moves[1] + moves[2], atol=1e-4)
    # Eyes whose surroundings meet are looked at one after another, with the same result where they do not.
    monkeypatch.setattr(lid_contact, "_surroundings", lambda character, eye: np.zeros(1, dtype=np.intp))
    apart = ContactStep.of(model.character)
    assert len(apart.parts) == len(model.contact.parts) + 1
    np.testing.assert_allclose(apart.apply(both.copy()) - both, moves[0], atol=1e-5)


def test_what_would_move_too_far_stays_where_the_pose_has_it(model: FaceModel) -> None:
    vertices = model.instance(model.coefficients_of(BLINK | GRIN))
    moved = np.linalg.norm(model.contact.apply(vertices.copy()) - vertices, axis=1)
    most = 0.5 * float(moved.max())
    kept = ContactStep(model.contact.parts, most).apply(vertices.copy())
    np.testing.assert_array_equal(kept[moved > 1.001 * most], vertices[moved > 1.001 * most])
    assert np.abs(kept - vertices).max() > 0.0
    assert np.linalg.norm(kept - vertices, axis=1).max() < 1.001 * most


@pytest.mark.parametrize("scale", [np.nan, np.inf, 1e20, 0.0])
def test_vertices_that_are_no_face_stay_as_they_are(model: FaceModel, scale: float) -> None:
    with np.errstate(invalid="ignore"):
        vertices = (model.character.vertices * scale).astype(np.float32)
    np.testing.assert_allclose(model.contact.apply(vertices.copy()), vertices, atol=1e-6)


def test_lashes_go_with_their_lid(model: FaceModel) -> None:
    p = model.coefficients_of({"eyeBlinkLeft": 1.6})
    moved = model.surface(p) - model.instance(p)
    lashes = moved[slice(*model.character.part("lashes_left").vertices), 1]
    assert lashes.max() > 0.2
    assert not moved[slice(*model.character.part("lashes_right").vertices)].any()


def test_pushes_begin_softly_and_end_outside() -> None:
    depth = np.array([-1.0, 0.0, 1e-4, 0.01, 1.0])
    push = hinge(depth, 1e-3, 0.02)
    np.testing.assert_array_equal(push[:2], 0.0)
    assert push[2] < depth[2]
    assert (push[3:] > depth[3:]).all()
    assert (push[3:] < depth[3:] + 0.02).all()


def test_spread_pushes_do_not_grow_and_fade() -> None:
    x, y = (grid.ravel() for grid in np.meshgrid(np.linspace(0, 6, 25), np.linspace(0, 4, 17)))
    spreading = Spreading.over(x, y, np.full(len(x), 0.5), np.where(x > 5.0, 0.0, 1.0), np.arange(len(x)))
    rng = np.random.default_rng(0)
    one, other = rng.random((2, len(x)))
    field = spreading(one)
    assert field.max() <= one.max()
    assert (field[x > 5.0] == 0.0).all()
    assert np.abs(field - spreading(other)).max() <= np.abs(one - other).max()


def test_layers_hand_nothing_to_each_other() -> None:
    x, y = (grid.ravel() for grid in np.meshgrid(np.linspace(0, 3, 13), np.linspace(0, 3, 13)))
    upper = np.tile([1.0, 0.0], len(x))
    spreading = Spreading.over(np.repeat(x, 2), np.repeat(y, 2), upper, np.ones(2 * len(x)), np.arange(2 * len(x)))
    field = spreading(np.where(upper > 0.5, 1.0, 0.0))
    assert field[upper > 0.5].min() > 0.9
    assert field[upper < 0.5].max() == 0.0


@pytest.mark.skipif(not os.environ.get("FACEPOSER_RIGS"), reason="FACEPOSER_RIGS names no folder of rigs")
@pytest.mark.parametrize("name", ["facecap_multi", "facecap"])
def test_imported_rigs_use_the_parts_they_have(name: str) -> None:
    from faceposer.training.request import TrainingRequest, train

    path = Path(os.environ["FACEPOSER_RIGS"]) / f"{name}.glb"
    rig = build_face_model(train(TrainingRequest("rig", path, name, name)))
    p = rig.coefficients_of({"mouthRollUpper": 2.0, "mouthRollLower": 2.0, "mouthPressLeft": 1.5, "jawOpen": 0.2})
    before, after = (penetration_mm(rig, rig.surface(p, contact)) for contact in (False, True))
    assert "lid_lid" not in before, "its eyes are not behind the lids"
    np.testing.assert_array_equal(rig.surface(rig.neutral()), rig.character.vertices)
    assert before["lips_teeth"] > 0.5
    assert max(after.values()) <= ALLOWED_MM
