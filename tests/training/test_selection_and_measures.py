"""The size of a prior follows the data; the curves of a model have their known values and directions."""

import numpy as np

from faceposer.progress import Progress
from faceposer.training.measures import contiguous_blocks, curves_of
from faceposer.training.selection import block_folds, choose_mixture


def clusters(count: int, spread: float, seed: int = 0) -> np.ndarray:
    rng = np.random.default_rng(seed)
    centres = 8.0 * np.eye(4)[:, :3]
    return centres[rng.integers(0, 4, count)] + spread * rng.standard_normal((count, 3))


def test_as_many_components_are_taken_as_there_are_clusters() -> None:
    choice = choose_mixture(block_folds(clusters(600, 0.3), 3), Progress())
    assert choice.n_components >= 4
    assert choice.held_out > choice.one_gaussian + 0.5
    assert len(choice.tried) > 3


def test_one_gaussian_is_enough_for_one_cloud_and_for_few_samples() -> None:
    rng = np.random.default_rng(1)
    assert choose_mixture(block_folds(rng.standard_normal((400, 5)), 3), Progress()).n_components <= 2
    assert choose_mixture(block_folds(clusters(30, 0.3), 5), Progress()).n_components == 1


def test_the_user_may_fix_the_size() -> None:
    choice = choose_mixture(block_folds(clusters(200, 0.5), 3), Progress(), n_components=3, n_factors=2)
    assert (choice.n_components, choice.n_factors, choice.fixed) == (3, 2, True)


def test_curves_of_data_of_known_rank() -> None:
    rng = np.random.default_rng(2)
    data = rng.standard_normal((40, 3)) @ rng.standard_normal((3, 90))
    curves = curves_of(data @ data.T, 30, 10)
    np.testing.assert_allclose(curves.compactness[2:], 1.0, atol=1e-9)
    assert curves.compactness[1] < 0.999
    # Three directions are all there is: examples left out lie in them too.
    np.testing.assert_allclose(curves.generalization[2:], 0.0, atol=1e-6)
    assert curves.generalization[0] > 0.1
    expected = np.sqrt((data**2).sum(axis=1) / 30).mean()
    np.testing.assert_allclose(curves.neutral, expected)
    assert all(value >= 0.0 for value in curves.specificity)


def test_data_that_generalizes_badly_shows_it() -> None:
    rng = np.random.default_rng(3)
    noise = rng.standard_normal((12, 300))
    curves = curves_of(noise @ noise.T, 100, 12)
    assert curves.generalization[-1] > 0.8 * curves.neutral


def test_blocks_are_contiguous_and_cover_everything() -> None:
    blocks = contiguous_blocks(21, 8)
    np.testing.assert_array_equal(np.concatenate(blocks), np.arange(21))
    assert len(contiguous_blocks(3, 8)) == 3
