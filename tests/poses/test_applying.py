"""Poses at any strength, by region and side, mirrored and flipped."""

from dataclasses import replace

import numpy as np
import pytest

from faceposer.errors import FacePoserError
from faceposer.model.face_model import FaceModel
from faceposer.poses.applying import (
    REGIONS,
    Array,
    applied,
    flipped,
    flipped_pose,
    mirrored,
    pose_of,
    region_of,
    side_of,
    weights_on,
)
from faceposer.poses.library import found, starter_poses
from faceposer.poses.pose_file import Pose
from tests.rigs import with_wholes

CHARACTERS = ("man", "woman", "low", "creature")


@pytest.fixture(scope="module")
def models(man: FaceModel, woman: FaceModel, low: FaceModel, creature: FaceModel) -> dict[str, FaceModel]:
    return dict(zip(CHARACTERS, (man, woman, low, creature), strict=True))


def starter(model: FaceModel, name: str) -> Pose:
    fitting = [e for e in starter_poses() if e.pose is not None and weights_on(e.pose, model.character) is not None]
    pose = found(fitting, name, "here").pose
    assert pose is not None
    return pose


def weights(model: FaceModel, p: Array) -> dict[str, float]:
    return dict(zip(model.character.shape_names, model.weights_of(p).tolist(), strict=True))


def moved(model: FaceModel, p: Array, feature: str) -> Array:
    vertex = model.character.feature_points[feature]
    return (model.instance(p)[vertex] - model.character.vertices[vertex]).astype(np.float64)


def lopsided(model: FaceModel) -> Array:
    return model.coefficients_of(
        {"mouthSmileLeft": 0.8, "browOuterUpRight": 0.6, "jawLeft": 0.4, "jawOpen": 0.3, "eyeBlinkLeft": 0.7}
    )


def test_full_strength_on_any_start_is_the_pose_and_none_is_the_start(model: FaceModel) -> None:
    pose = starter(model, "anger")
    target = model.coefficients_of(dict(pose.weights))
    start = lopsided(model)
    np.testing.assert_allclose(applied(model, model.neutral(), pose), target, atol=1e-12)
    np.testing.assert_allclose(applied(model, start, pose), target, atol=1e-12)
    np.testing.assert_array_equal(applied(model, start, pose, 0.0), start)
    np.testing.assert_allclose(applied(model, model.neutral(), pose, -1.0), -target, atol=1e-12)
    np.testing.assert_allclose(applied(model, model.neutral(), pose, 2.0), 2.0 * target, atol=1e-12)
    np.testing.assert_allclose(applied(model, start, pose, 0.5, blend="add"), start + 0.5 * target, atol=1e-12)
    for strength in (-1.01, 2.01, float("nan")):
        with pytest.raises(FacePoserError, match="strength"):
            applied(model, start, pose, strength)


def test_a_kept_face_comes_back_on_the_face_itself(model: FaceModel) -> None:
    rng = np.random.default_rng(5)
    face = 0.2 * rng.standard_normal(model.n_coefficients)
    kept = Pose.from_json(pose_of(model, face, "Mine").to_json())
    again = applied(model, lopsided(model), kept)
    assert np.abs(model.instance(again) - model.instance(face)).max() < 1e-3


@pytest.mark.parametrize("region", REGIONS)
def test_a_region_takes_its_shapes_alone(model: FaceModel, region: str) -> None:
    start, pose = lopsided(model), starter(model, "fear")
    after = weights(model, applied(model, start, pose, regions=[region]))  # type: ignore[list-item]
    before, target = weights(model, start), weights(model, applied(model, start, pose))
    changed = {name for name in after if abs(after[name] - before[name]) > 0.05}
    assert changed <= {name for name in after if region_of(name) == region}
    assert all(abs(after[name] - target[name]) < 0.06 for name in after if region_of(name) == region)


def test_all_regions_together_are_the_whole_face(model: FaceModel) -> None:
    start, pose = lopsided(model), starter(model, "disgust")
    together = applied(model, start, pose, 0.7, REGIONS)
    np.testing.assert_allclose(together, applied(model, start, pose, 0.7), atol=1e-9)
    assert {region_of(name) for name in model.character.shape_names} == set(REGIONS)


def test_the_mouth_alone_leaves_the_brows_and_the_other_way_round(models: dict[str, FaceModel]) -> None:
    for model in models.values():
        pose = starter(model, "surprise")
        mouth = applied(model, model.neutral(), pose, regions=["mouth"])
        brows = applied(model, model.neutral(), pose, regions=["brows"])
        assert np.linalg.norm(moved(model, mouth, "2.3")) > 0.3
        assert np.linalg.norm(moved(model, mouth, "4.1")) < 0.1
        assert moved(model, brows, "4.1")[1] > 0.3
        assert np.linalg.norm(moved(model, brows, "2.3")) < 0.1


def test_a_side_leaves_the_other(model: FaceModel) -> None:
    pose = starter(model, "happiness")
    left = applied(model, model.neutral(), pose, side="left")
    assert moved(model, left, "8.3")[1] > 0.5
    assert np.linalg.norm(moved(model, left, "4.4")) < 0.05
    assert max(abs(w) for name, w in weights(model, left).items() if side_of(name) != "left") < 0.06
    right = applied(model, model.neutral(), pose, side="right")
    assert moved(model, right, "8.4")[1] > 0.5
    assert side_of("jawLeft") == side_of("jawOpen") == "both"
    assert (side_of("eye left 12"), side_of("brow right 1"), side_of("cheekPuffLeft")) == ("left", "right", "left")


def test_flipping_exchanges_the_sides(models: dict[str, FaceModel]) -> None:
    for name, model in models.items():
        face = 0.6 * model.coefficients_of(np.random.default_rng(3).uniform(*model.character.shape_limits.T))
        if name != "creature":
            face = lopsided(model)
        other = flipped(model, face)
        for here, there in (("8.3", "8.4"), ("4.3", "4.4"), ("3.1", "3.2"), ("2.1", "2.1")):
            np.testing.assert_allclose(
                moved(model, other, there), moved(model, face, here) * (-1.0, 1.0, 1.0), atol=0.08, err_msg=name
            )
        assert np.abs(flipped(model, other) - face).max() < 0.05 * np.abs(face).max()
        assert np.linalg.norm(moved(model, other, "8.3") - moved(model, face, "8.3")) > 0.1


@pytest.mark.parametrize(("source", "here", "there"), [("left", "8.3", "8.4"), ("right", "8.4", "8.3")])
def test_mirroring_makes_one_side_the_image_of_the_other(
    models: dict[str, FaceModel], source: str, here: str, there: str
) -> None:
    for name, model in models.items():
        face = 0.6 * model.coefficients_of(np.random.default_rng(2).uniform(*model.character.shape_limits.T))
        if name != "creature":
            face = lopsided(model)
        result = mirrored(model, face, source)  # type: ignore[arg-type]
        np.testing.assert_allclose(
            moved(model, result, there), moved(model, result, here) * (-1.0, 1.0, 1.0), atol=0.08, err_msg=name
        )
        assert np.abs(flipped(model, result) - result).max() < 0.1 * np.abs(result).max()
    man = weights(models["man"], mirrored(models["man"], lopsided(models["man"]), "left"))
    assert man["mouthSmileRight"] == pytest.approx(0.8, abs=0.05)
    assert man["browOuterUpRight"] == pytest.approx(0.0, abs=0.05)
    assert man["jawLeft"] == pytest.approx(0.0, abs=0.05)


def test_mirroring_leaves_the_eyes_looking_to_their_side(model: FaceModel) -> None:
    looking = model.coefficients_of({"eyeLookOutLeft": 0.7, "eyeLookInRight": 0.7, "eyeLookUpLeft": 0.4})
    after = weights(model, mirrored(model, looking))
    assert after["eyeLookInRight"] == pytest.approx(0.7, abs=0.05)
    assert after["eyeLookOutRight"] == pytest.approx(0.0, abs=0.05)
    assert after["eyeLookUpRight"] == pytest.approx(0.4, abs=0.05)
    other = weights(model, flipped(model, looking))
    assert other["eyeLookOutRight"] == pytest.approx(0.7, abs=0.05)


def test_poses_fit_by_the_names_of_shapes(models: dict[str, FaceModel]) -> None:
    people, goblin = models["man"].character, models["creature"].character
    own = pose_of(models["creature"], np.ones(models["creature"].n_coefficients), "Mine")
    assert weights_on(own, goblin) is not None
    assert weights_on(own, people) is None
    assert weights_on(replace(own, character="another"), goblin) is None, "its modes are not those of another face"
    smile = Pose("Smile", {"mouthSmileLeft": 1.0}, "woman")
    assert weights_on(smile, people) is not None
    with pytest.raises(FacePoserError, match="needs ARKit's shapes"):
        applied(models["creature"], models["creature"].neutral(), smile)
    with pytest.raises(FacePoserError, match="made on 'creature'"):
        applied(models["man"], models["man"].neutral(), own)


def test_halves_and_wholes_stand_for_each_other(model: FaceModel) -> None:
    halves = Pose("Half", {"browInnerUpLeft": 1.0, "browInnerUpRight": 0.5})
    whole = with_wholes(model.character)
    on_whole = weights_on(halves, whole)
    assert on_whole is not None
    assert on_whole[whole.shape_names.index("browInnerUp")] == pytest.approx(0.75)
    puffed = weights_on(Pose("Puff", {"cheekPuff": 0.6}), model.character)
    assert puffed is not None
    by_name = dict(zip(model.character.shape_names, puffed.tolist(), strict=True))
    assert {name for name, weight in by_name.items() if weight} == {"cheekPuffLeft", "cheekPuffRight"}
    assert by_name["cheekPuffLeft"] == by_name["cheekPuffRight"] == pytest.approx(0.6)


def test_a_flipped_pose_is_the_pose_on_the_other_side(model: FaceModel) -> None:
    wink = Pose("Wink", {"eyeBlinkLeft": 1.0, "mouthSmileLeft": 0.5}, "man")
    other = flipped_pose(model, wink)
    assert other.weights["eyeBlinkRight"] == pytest.approx(1.0, abs=0.05)
    assert abs(other.weights["eyeBlinkLeft"]) < 0.05


# What the starter set must do, on every shipped face


def test_expressions_move_what_their_action_units_say(models: dict[str, FaceModel]) -> None:
    for name, model in models.items():
        faces = {pose: applied(model, model.neutral(), starter(model, pose)) for pose in EXPRESSIONS}

        def rise(pose: str, feature: str, model: FaceModel = model, faces: dict[str, Array] = faces) -> float:
            return float(moved(model, faces[pose], feature)[1]) / model.character.height

        assert rise("happiness", "8.3") > 0.015, name
        assert rise("sadness", "8.3") < -0.01, name
        assert rise("sadness", "4.1") > 0.008, name
        assert rise("surprise", "4.3") > 0.01, name
        assert rise("surprise", "2.1") < -0.01, name
        assert rise("fear", "3.1") > 0.002, name
        assert rise("anger", "4.1") < -0.008, name
        assert rise("disgust", "8.1") > 0.008, name


EXPRESSIONS = ("happiness", "sadness", "surprise", "fear", "anger", "disgust")


def test_visemes_open_and_close_the_lips(models: dict[str, FaceModel]) -> None:
    for name, model in models.items():

        def gap(pose: str, model: FaceModel = model) -> float:
            vertices = model.instance(applied(model, model.neutral(), starter(model, pose)))
            upper, lower = (vertices[model.character.feature_points[key]][1] for key in ("2.2", "2.3"))
            return float(upper - lower) / model.character.height

        rest = model.character.vertices
        at_rest = (
            float(rest[model.character.feature_points["2.2"], 1] - rest[model.character.feature_points["2.3"], 1])
            / model.character.height
        )
        closed = gap("M B P")
        assert -0.006 < closed < at_rest + 0.004, (name, closed, at_rest)
        assert gap("D S T N") > closed + 0.005, name
        assert gap("AH") > 2.0 * gap("K G NG") > 0.0, name
        assert gap("AH") > gap("EH") > gap("D S T N") * 0.9, name

        def width(pose: str, model: FaceModel = model) -> float:
            vertices = model.instance(applied(model, model.neutral(), starter(model, pose)))
            left, right = (vertices[model.character.feature_points[key]][0] for key in ("8.3", "8.4"))
            return float(left - right) / model.character.height

        assert width("EE") > width("AH") > width("OH") > 0.0, name
        assert width("W OO") < width("M B P"), name
