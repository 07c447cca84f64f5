"""How far and which way the shipped heads' re-sculpted shapes move, in millimetres."""

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from faceposer.model.character import Character
from faceposer.model.character_file import load_character

Array = NDArray[np.float64]
PEOPLE = ("man", "woman")


@pytest.fixture(scope="module", params=(*PEOPLE, "low"))
def character(request: pytest.FixtureRequest) -> Character:
    return load_character(request.param)


@pytest.fixture(scope="module", params=PEOPLE)
def person(request: pytest.FixtureRequest) -> Character:
    return load_character(request.param)


def shape(character: Character, name: str) -> Array:
    """Return the offsets of the shape ``name`` in millimetres, shape (N, 3)."""
    return 10.0 * character.shapes[character.shape_names.index(name)].astype(np.float64)


def move(character: Character, name: str, point: str) -> Array:
    return shape(character, name)[character.feature_points[point]]


#: Points along the inner edges of upper and lower lip, from the right corner to the left one.
UPPER_LIP, LOWER_LIP = ("2.5", "2.7", "2.2", "2.6", "2.4"), ("2.5", "2.9", "2.3", "2.8", "2.4")


def length(points: Array) -> float:
    return float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())


def test_every_shape_is_the_mirror_image_of_its_partner(character: Character) -> None:
    distance, across = cKDTree(character.vertices).query(character.vertices * np.float32([-1, 1, 1]))
    assert distance.max() < 1e-4
    for name in character.shape_names:
        other = name.replace("Left", "?").replace("Right", "Left").replace("?", "Right")
        mirrored = shape(character, other)[across] * [-1.0, 1.0, 1.0]
        assert np.abs(shape(character, name) - mirrored).max() < 0.02, name


@pytest.mark.parametrize("whole", ["browInnerUp", "cheekPuff"])
def test_halves_move_their_side_alone(character: Character, whole: str) -> None:
    left, right = (np.linalg.norm(shape(character, whole + side), axis=1) for side in ("Left", "Right"))
    x = character.vertices[:, 0]
    assert not left[x < -2.3].any()
    assert not right[x > 2.3].any()
    far = np.abs(x) > 2.3
    assert left[x > 2.3].max() > 2.0
    np.testing.assert_allclose((left + right)[far], np.maximum(left, right)[far])
    if whole == "browInnerUp":
        assert left[character.feature_points["4.1"]] > 5.0
        assert right[character.feature_points["4.1"]] == 0.0


def test_brow_down_lowers_the_inner_brow(character: Character) -> None:
    inwards, up, _ = move(character, "browDownLeft", "4.1") * [-1.0, 1.0, 1.0]
    assert -7.2 < up < -5.8
    assert 0.0 < inwards < -up / 3.0
    assert -move(character, "browDownLeft", "4.5")[1] < 0.6 * -up, "most at its inner end"
    assert move(character, "browDownLeft", "3.1")[1] > -1.2, "the lid stays open"
    assert np.linalg.norm(move(character, "noseSneerLeft", "4.1")) < 1.2
    assert move(character, "noseSneerLeft", "9.1")[1] > 3.0


def test_the_frown_draws_the_corner_down(character: Character) -> None:
    out, down, _ = move(character, "mouthFrownLeft", "8.3") * [1.0, -1.0, 1.0]
    assert 9.0 < down < 10.5
    assert 0.0 < out < 0.4 * down
    assert move(character, "mouthFrownLeft", "8.7")[1] < -2.0
    assert np.linalg.norm(move(character, "mouthFrownLeft", "8.2")) < 1.0, "the middle of the lower lip stays"
    assert np.linalg.norm(move(character, "mouthFrownLeft", "8.4")) < 1.0


def test_the_smile_takes_the_cheek_along(character: Character) -> None:
    out, up, ahead = move(character, "mouthSmileLeft", "8.3")
    assert up > 7.5
    assert out > 5.0
    assert ahead < -3.0
    cheek = move(character, "mouthSmileLeft", "5.1")
    assert cheek[1] > 4.0
    assert cheek[2] > 1.0
    both = [
        sum(move(character, f"mouthSmile{side}", point)[1] for side in ("Left", "Right")) for point in ("2.2", "8.1")
    ]
    assert both[0] > 2.0, "the upper lip rises from the teeth"
    assert both[0] > both[1], "and is thinner"
    lid = move(character, "cheekSquintLeft", "3.3")
    assert lid[1] > 1.0
    assert move(character, "cheekSquintLeft", "5.3")[1] > 3.0


def test_the_chin_goes_down_and_back_about_the_hinge(character: Character) -> None:
    opened, rest = shape(character, "jawOpen"), 10.0 * character.vertices.astype(np.float64)
    corner = move(character, "jawOpen", "8.3")
    assert 5.0 < -corner[1] < 6.3
    points = [character.feature_points[name] for name in ("2.10", "2.1", "2.11", "2.12")]
    assert (opened[points, 1] < -15.0).all()
    assert (opened[points, 2] < -25.0).all()
    y, z = rest[points, 1:].T
    dy, dz = opened[points, 1:].T
    # Of a turn by an angle a: dy = (cos a - 1) y - sin a z + t, dz = sin a y + (cos a - 1) z + t'.
    system = np.concatenate([np.stack([y, -z, np.ones(4), 0 * y], 1), np.stack([z, y, 0 * y, np.ones(4)], 1)])
    found, *_ = np.linalg.lstsq(system, np.concatenate([dy, dz]), rcond=None)
    assert np.degrees(np.arctan2(found[1], 1.0 + found[0])) == pytest.approx(22.0, abs=1.5)
    assert np.hypot(found[1], 1.0 + found[0]) == pytest.approx(1.0, abs=0.03)
    np.testing.assert_allclose(system @ found, np.concatenate([dy, dz]), atol=1.0)


def test_the_lips_keep_their_length(person: Character) -> None:
    upper, lower = ([person.feature_points[name] for name in names] for names in (UPPER_LIP, LOWER_LIP))
    rest = person.vertices.astype(np.float64)
    at_rest = length(rest[upper]) + length(rest[lower])
    lengths = []
    for weight in np.linspace(0.0, 0.6, 7):
        posed = rest + 0.1 * weight * shape(person, "jawOpen")
        lengths.append((length(posed[upper]) + length(posed[lower])) / at_rest)
    assert max(lengths) < 1.12
    assert min(lengths) > 0.88
    assert np.abs(np.diff(lengths, 2)).max() < 0.02, "smoothly"


def test_closed_lips_stay_closed_over_a_jaw_that_opens(person: Character) -> None:
    for weight in (0.3, 0.6, 1.0):
        gap = [move(person, "jawOpen", point)[1] + move(person, "mouthClose", point)[1] for point in ("2.2", "2.3")]
        assert abs(weight * (gap[0] - gap[1])) < 1.5, weight


def test_the_lower_lip_goes_forward_less_than_the_chin(character: Character) -> None:
    chin, lip = (move(character, "jawForward", point) for point in ("2.10", "8.2"))
    assert chin[2] > 7.0
    assert 0.6 * chin[2] < lip[2] < chin[2]
    assert abs(lip[1]) < 0.5, "and the lips stay shut"


def test_scalp_ears_and_neck_stay_where_they_are(character: Character) -> None:
    rest = character.vertices
    skin = np.arange(*character.part("skin").vertices)
    base = skin[rest[skin, 1] < rest[skin, 1].min() + 2.0]
    crown = skin[rest[skin, 1] > rest[character.feature_points["11.1"], 1] + 2.0]
    ears = np.concatenate([character.regions["ear_left"], character.regions["ear_right"]])
    for name in character.shape_names:
        moved = np.linalg.norm(shape(character, name), axis=1)
        assert moved[np.concatenate([base, crown, ears])].max() < 0.5, name


def posed(character: Character, weights: dict[str, float]) -> Array:
    """Return the vertices of a pose in millimetres; a name without a side means both sides."""
    result = 10.0 * character.vertices.astype(np.float64)
    for name, weight in weights.items():
        for each in (name,) if name in character.shape_names else (f"{name}Left", f"{name}Right"):
            result += weight * shape(character, each)
    return result


def test_lips_that_pucker_come_forward_with_their_corners(character: Character) -> None:
    rest, pucker = posed(character, {}), posed(character, {"mouthPucker": 1.0})
    points = character.feature_points
    width = [one[points["8.3"], 0] - one[points["8.4"], 0] for one in (rest, pucker)]
    assert width[1] < 0.72 * width[0]
    ahead = pucker - rest
    for point in ("8.1", "2.2", "2.3", "8.3", "8.4"):
        assert ahead[points[point], 2] > 5.0, point
    assert ahead[points["8.2"], 2] > 3.5


def test_the_funnel_opens_a_round_mouth_forward(character: Character) -> None:
    rest, funnel = posed(character, {}), posed(character, {"mouthFunnel": 1.0})
    points = character.feature_points
    gap = [one[points["2.2"], 1] - one[points["2.3"], 1] for one in (rest, funnel)]
    assert gap[1] - gap[0] > 7.0
    width = [one[points["8.3"], 0] - one[points["8.4"], 0] for one in (rest, funnel)]
    assert width[1] < 0.8 * width[0]
    edge, border = (funnel - rest)[points["2.2"], 2], (funnel - rest)[points["8.1"], 2]
    assert edge > border + 1.0, "lips turn outwards"


@pytest.mark.parametrize("name", ["mouthRollUpper", "mouthRollLower"])
def test_a_lip_that_rolls_in_shows_less_red_and_stays_shut(person: Character, name: str) -> None:
    rest, rolled = posed(person, {}), posed(person, {name: 1.0})
    points = person.feature_points
    outer, inner = ("8.1", "2.2") if name == "mouthRollUpper" else ("8.2", "2.3")
    moved, inwards = rolled - rest, -1.0 if name == "mouthRollUpper" else 1.0
    assert inwards * moved[points[outer], 1] > 4.0
    assert inwards * moved[points[outer], 1] > inwards * moved[points[inner], 1] + 1.5
    assert moved[points[inner], 2] < -2.5
    assert rolled[points["2.2"], 1] - rolled[points["2.3"], 1] < rest[points["2.2"], 1] - rest[points["2.3"], 1] + 0.5


def test_lips_are_stretched_aside_around_the_teeth(character: Character) -> None:
    for name in ("mouthStretchLeft", "mouthDimpleLeft"):
        out, _, ahead = move(character, name, "8.3")
        assert ahead < -0.6 * out, name
    out, up, _ = move(character, "mouthStretchLeft", "8.3")
    assert out > 6.0
    assert abs(up) < 0.4 * out, "level"


def test_the_upper_lip_rises_and_a_sneer_leaves_the_mouth_shut(character: Character) -> None:
    both = sum(move(character, f"mouthUpperUp{side}", "2.2")[1] for side in ("Left", "Right"))
    assert both > 3.0
    assert move(character, "mouthUpperUpLeft", "8.5")[1] > 3.5
    assert abs(move(character, "mouthUpperUpLeft", "2.3")[1]) < 0.3
    rest, sneer = posed(character, {}), posed(character, {"noseSneer": 1.0})
    points = character.feature_points
    moved = sneer - rest
    assert moved[points["8.1"], 1] > moved[points["2.2"], 1] + 0.3, "the border of the red more than its edge"
    assert abs(moved[points["2.2"], 1] - moved[points["2.3"], 1]) < 0.5


def test_lids_follow_an_eye_that_looks_up_or_down(character: Character) -> None:
    eye = np.arange(*character.part("eye_left").vertices)
    for name, upper_share, lower_share in (("eyeLookUpLeft", 0.4, 0.02), ("eyeLookDownLeft", 0.2, 0.1)):
        moved = shape(character, name)
        pupil = moved[eye[0], 1]
        upper, lower = (moved[character.feature_points[point], 1] / pupil for point in ("3.1", "3.3"))
        assert upper_share < upper < 1.0, name
        assert lower_share < lower < upper, name
    corners = [shape(character, "eyeLookUpLeft")[character.feature_points[point]] for point in ("3.7", "3.11")]
    assert np.linalg.norm(corners, axis=1).max() < 0.6, "the corners of the eye stay"
