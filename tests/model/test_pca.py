"""PCA in a rig's weights is the PCA of the meshes that the rig makes."""

import numpy as np
import pytest
from sklearn.decomposition import PCA

from faceposer.model.pca import reconstruction_error, rig_pca, smallest_reaching


@pytest.fixture
def rig() -> tuple[np.ndarray, np.ndarray]:
    """Shapes (6, 90), of very different sizes, and weights of 400 examples (400, 6)."""
    rng = np.random.default_rng(0)
    shapes = rng.normal(size=(6, 90)) * np.array([5, 2, 1, 1, 0.3, 0.1])[:, None]
    return shapes, rng.gamma(1.0, 0.2, size=(400, 6))


def test_agrees_with_the_pca_of_explicit_meshes(rig: tuple[np.ndarray, np.ndarray]) -> None:
    shapes, weights = rig
    subspace = rig_pca(shapes @ shapes.T, np.cov(weights.T))
    explicit = PCA(n_components=6).fit(weights @ shapes)
    np.testing.assert_allclose(subspace.variances, explicit.explained_variance_, rtol=1e-6)
    basis = subspace.directions.T @ shapes
    np.testing.assert_allclose(np.abs(np.sum(basis * explicit.components_, axis=1)), 1.0, atol=1e-6)


def test_basis_is_orthonormal_in_the_metric_and_projection_inverts_it(rig: tuple[np.ndarray, np.ndarray]) -> None:
    shapes, weights = rig
    metric = np.random.default_rng(1).uniform(0.1, 3.0, 90)
    subspace = rig_pca((shapes * metric) @ shapes.T, np.cov(weights.T))
    basis = subspace.directions.T @ shapes
    np.testing.assert_allclose((basis * metric) @ basis.T, np.eye(6), atol=1e-8)
    np.testing.assert_allclose(subspace.projection @ subspace.directions, np.eye(6), atol=1e-8)


def test_empty_and_repeated_shapes_add_no_dimension(rig: tuple[np.ndarray, np.ndarray]) -> None:
    shapes, _ = rig
    shapes = np.concatenate([shapes, np.zeros((1, 90)), shapes[:1]])
    subspace = rig_pca(shapes @ shapes.T, np.eye(8))
    assert len(subspace.variances) == 6


def test_the_reconstruction_error_is_what_a_least_squares_fit_leaves(rig: tuple[np.ndarray, np.ndarray]) -> None:
    shapes, weights = rig
    subspace = rig_pca(shapes @ shapes.T, np.cov(weights.T)).truncated(3)
    basis = (subspace.directions.T @ shapes).T
    for shape, share in zip(shapes, reconstruction_error(subspace.directions, shapes @ shapes.T), strict=True):
        rest = shape - basis @ np.linalg.lstsq(basis, shape, rcond=None)[0]
        assert share == pytest.approx(np.linalg.norm(rest) / np.linalg.norm(shape), abs=1e-6)


def test_smallest_reaching_is_the_smallest(rig: tuple[np.ndarray, np.ndarray]) -> None:
    shapes, weights = rig
    gram = shapes @ shapes.T
    everything = rig_pca(gram, np.cov(weights.T))
    chosen = smallest_reaching(everything, gram, np.array([0, 1, 2]), 0.15)
    r = chosen.directions.shape[1]
    assert r < 6
    assert reconstruction_error(chosen.directions, gram)[:3].max() <= 0.15
    assert reconstruction_error(everything.truncated(r - 1).directions, gram)[:3].max() > 0.15
