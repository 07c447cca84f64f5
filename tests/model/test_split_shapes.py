"""Rigs with halves of a shape get statistics for both."""

import numpy as np

from faceposer.model.character import ARKIT_SHAPES
from faceposer.model.expression_statistics import load_expression_statistics
from faceposer.model.split_shapes import split_to_match


def test_halves_move_as_the_whole_does_but_not_always_together() -> None:
    shipped = load_expression_statistics()
    names = (*(name for name in ARKIT_SHAPES if name != "browInnerUp"), "browInnerUpLeft", "browInnerUpRight")
    split = split_to_match(shipped, names)
    left, right = (split.shape_names.index(f"browInnerUp{side}") for side in ("Left", "Right"))
    whole, jaw = shipped.shape_names.index("browInnerUp"), shipped.shape_names.index("jawOpen")
    assert len(split.shape_names) == 53
    assert "cheekPuff" in split.shape_names
    np.testing.assert_allclose(split.means[:, [left, right]], shipped.means[:, [whole, whole]])
    np.testing.assert_allclose(split.covariance[left, jaw], shipped.covariance[whole, jaw])
    assert 0.5 < split.covariance[left, right] / split.covariance[left, left] < 0.8
    np.linalg.cholesky(split.covariances)
    np.linalg.cholesky(split.covariance)
    assert split.regions[right] == split.regions[left] == shipped.regions[whole]
    np.testing.assert_allclose(split.factors[right], split.factors[left])


def test_nothing_changes_for_the_52() -> None:
    shipped = load_expression_statistics()
    assert split_to_match(shipped, ARKIT_SHAPES) is shipped
