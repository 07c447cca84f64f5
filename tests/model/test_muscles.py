"""The muscles behind ARKit's shapes, also on rigs with halves and on those that lack shapes."""

import numpy as np
import pytest

from faceposer.model.character import ARKIT_SHAPES
from faceposer.model.muscles import (
    CO_CONTRACTIONS,
    DEPENDENT_SHAPES,
    co_contraction,
    dependent_pairs,
    independence,
    mirrored_pairs,
    muscle_of_shape,
    nearest_correlation,
    side_of_shape,
)

HALVES = tuple(
    half
    for name in ARKIT_SHAPES
    for half in ((f"{name}Left", f"{name}Right") if name in ("browInnerUp", "cheekPuff") else (name,))
)


def test_every_shape_of_arkit_belongs_to_a_muscle() -> None:
    groups = {name: muscle_of_shape(name) for name in ARKIT_SHAPES}
    assert len(ARKIT_SHAPES) == 52
    assert not [name for name, group in groups.items() if group == name]
    assert len(set(groups.values())) >= 14
    assert groups["mouthSmileLeft"] == groups["mouthDimpleRight"] == "smile"
    assert groups["mouthClose"] == groups["jawOpen"] == "jaw"
    assert groups["mouthLowerDownLeft"] != groups["mouthUpperUpLeft"]


def test_halves_belong_to_the_muscle_of_the_whole() -> None:
    for name in ("browInnerUp", "cheekPuff"):
        assert {muscle_of_shape(name + side) for side in ("", "Left", "Right")} == {muscle_of_shape(name)}
    assert muscle_of_shape("antennaWiggle") == "antennaWiggle"


def test_sides() -> None:
    assert side_of_shape("mouthSmileLeft") == "Left"
    assert side_of_shape("browInnerUpRight") == "Right"
    assert side_of_shape("jawOpen") == ""
    # These move all of the jaw or the mouth, but are named for the side that they go to.
    assert side_of_shape("jawLeft") == "Left"


@pytest.mark.parametrize("names", [ARKIT_SHAPES, HALVES, HALVES[::-1], ("jawOpen",), ("bumpLeft", "bumpRight", "dip")])
def test_independence_is_a_correlation_matrix(names: tuple[str, ...]) -> None:
    factors = independence(names)
    np.testing.assert_allclose(factors, factors.T)
    np.testing.assert_allclose(np.diag(factors), 1.0)
    assert np.linalg.eigvalsh(factors)[0] > -1e-9


def test_opposite_brows_and_the_jaw_are_told_apart_more_than_the_rest() -> None:
    names = list(HALVES)
    factors = independence(names)

    def between(one: str, other: str) -> float:
        return float(factors[names.index(one), names.index(other)])

    assert between("browOuterUpLeft", "browOuterUpRight") < 0.6
    assert between("browInnerUpLeft", "browInnerUpRight") < 0.6
    assert 0.8 < between("mouthSmileLeft", "mouthSmileRight") < 1.0
    assert between("mouthSmileLeft", "cheekSquintLeft") > 0.99
    assert between("jawOpen", "mouthClose") == pytest.approx(1.0)
    assert between("jawOpen", "mouthFunnel") < 0.7


def test_mirrored_pairs() -> None:
    names = ("mouthSmileLeft", "mouthSmileRight", "jawOpen")
    np.testing.assert_array_equal(mirrored_pairs(names), [[1, 1, 0], [1, 1, 0], [0, 0, 1]])


def test_a_smile_takes_the_cheek_of_its_side_along() -> None:
    names = list(HALVES)
    along = co_contraction(names)
    weights = np.zeros(len(names))
    weights[names.index("mouthSmileLeft")] = 1.0
    moved = along @ weights
    assert moved[names.index("cheekSquintLeft")] > 0.3
    assert moved[names.index("cheekSquintRight")] == 0.0
    back = along @ np.eye(len(names))[names.index("cheekSquintLeft")]
    assert np.count_nonzero(back) == 1, "a cheek alone is no smile"
    assert abs(np.linalg.det(along)) == pytest.approx(1.0)


def test_shapes_that_are_missing_are_passed_over() -> None:
    muscle, follower, _ = CO_CONTRACTIONS[0]
    for names in ((muscle + "Left",), (follower + "Left",), (muscle + "Left", follower + "Right"), ()):
        np.testing.assert_array_equal(co_contraction(names), np.eye(len(names)))
    shape, other, beyond = DEPENDENT_SHAPES[0]
    assert dependent_pairs((shape,)) == []
    assert dependent_pairs(("x", other, shape)) == [(2, 1, beyond)]


def test_the_nearest_correlation_of_one_is_itself() -> None:
    rng = np.random.default_rng(0)
    factor = rng.normal(size=(6, 6))
    covariance = factor @ factor.T
    scale = 1.0 / np.sqrt(np.diag(covariance))
    correlation = covariance * np.outer(scale, scale)
    np.testing.assert_allclose(nearest_correlation(correlation), correlation, atol=1e-12)
    broken = np.array([[1.0, 0.95, 0.0], [0.95, 1.0, 0.95], [0.0, 0.95, 1.0]])
    assert np.linalg.eigvalsh(broken)[0] < 0.0
    mended = nearest_correlation(broken)
    assert np.linalg.eigvalsh(mended)[0] > -1e-12
    np.testing.assert_allclose(np.diag(mended), 1.0)
