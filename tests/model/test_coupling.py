"""Coupling is learned where one region tells of another, and only there."""

import numpy as np
import pytest

from faceposer.model.coupling import independent, learn_coupling, region_of_shape


def test_only_what_predicts_is_coupled() -> None:
    rng = np.random.default_rng(0)
    folds = []
    for _ in range(6):
        examples = rng.normal(size=(2, 800, 3))
        examples[:, :, 1] = examples[:, :, 0] + 0.1 * examples[:, :, 1]
        folds.append((examples[0], examples[1]))
    matrix = learn_coupling(folds, ["a", "b", "c"])
    np.testing.assert_allclose(np.diag(matrix), 1.0)
    assert np.linalg.eigvalsh(matrix).min() > -1e-9
    assert matrix[0, 1] > 0.9
    assert matrix[0, 2] < 0.1
    with pytest.raises(ValueError, match="two folds"):
        learn_coupling(folds[:1], ["a", "b", "c"])


def test_independent_regions() -> None:
    np.testing.assert_array_equal(independent(["a", "b", "a"]), [[1, 0, 1], [0, 1, 0], [1, 0, 1]])


def test_every_shape_has_a_region() -> None:
    assert region_of_shape("eyeLookInLeft") == "gaze"
    assert region_of_shape("eyeSquintRight") == "lids"
    assert region_of_shape("cheekPuff") == "mouth"
