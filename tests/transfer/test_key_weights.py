"""Weights of keys: cardinal, linear where keys are, and robust."""

import numpy as np
import pytest

from faceposer.transfer.key_parameters import feature_matrix
from faceposer.transfer.key_weights import KeyWeights, cubic_b_spline


def test_the_spline_is_smooth_and_ends_at_two() -> None:
    x = np.linspace(-3.0, 3.0, 601)
    values = cubic_b_spline(x)
    assert values.max() == pytest.approx(2.0 / 3.0)
    assert cubic_b_spline(1.0) == pytest.approx(1.0 / 6.0)
    assert not values[np.abs(x) >= 2.0].any()
    assert np.trapezoid(values, x) == pytest.approx(1.0)
    # Second derivatives are continuous.
    assert np.abs(np.diff(values, 3)).max() < 4.0 * 0.01**3


@pytest.mark.parametrize(("count", "dimensions"), [(2, 1), (5, 9), (19, 5), (84, 18)])
def test_each_weight_is_one_at_its_key_and_zero_at_all_others(count: int, dimensions: int) -> None:
    places = np.random.default_rng(count).normal(size=(count, dimensions))
    weights = KeyWeights(places)
    np.testing.assert_allclose(weights(places), np.eye(count), atol=1e-9)
    np.testing.assert_allclose(weights(places[:1]).sum(), 1.0)
    others = weights(np.random.default_rng(1).normal(size=(50, dimensions)))
    assert np.isfinite(others).all()


def test_linear_relations_are_found_exactly_with_few_keys() -> None:
    rng = np.random.default_rng(3)
    places, matrix = np.vstack([np.zeros(6), np.eye(6)]), rng.normal(size=(6, 4))
    new = rng.normal(size=(20, 6))
    np.testing.assert_allclose(KeyWeights(places)(new) @ (places @ matrix), new @ matrix, atol=1e-9)


def test_many_keys_follow_a_curved_relation_better_than_a_line() -> None:
    places = np.linspace(-1.0, 1.0, 17)[:, None]
    truth = np.abs(places[:, 0])
    new = np.linspace(-0.95, 0.95, 200)[:, None]
    weights = KeyWeights(places)
    curved = np.abs(weights(new) @ truth - np.abs(new[:, 0])).mean()
    line = np.polynomial.Polynomial.fit(places[:, 0], truth, 1)(new[:, 0])
    assert curved < 0.25 * np.abs(line - np.abs(new[:, 0])).mean()


def test_keys_at_one_place_and_single_keys_are_refused() -> None:
    with pytest.raises(ValueError, match="at the same place"):
        KeyWeights([[0.0, 0.0], [1.0, 0.0], [1.0, 0.0]])
    with pytest.raises(ValueError, match="two keys or more"):
        KeyWeights([[0.0, 0.0]])


def test_many_keys_at_nearly_the_same_distance_can_be_solved() -> None:
    # The corners of a simplex, at equal distances of each other, and points between them.
    places = np.vstack([np.zeros(40), np.eye(40), 0.5 * np.eye(40)])
    weights = KeyWeights(places)
    np.testing.assert_allclose(weights(places), np.eye(81), atol=1e-7)


def test_components_are_orthonormal_and_small_ones_are_dropped() -> None:
    rng = np.random.default_rng(0)
    places = rng.normal(size=(30, 2)) @ rng.normal(size=(2, 60)) + 1e-6 * rng.normal(size=(30, 60))
    matrix = feature_matrix(places)
    assert matrix.shape == (2, 60)
    np.testing.assert_allclose(matrix @ matrix.T, np.eye(2), atol=1e-12)
    assert len(feature_matrix(places, 1e-15)) > 2
