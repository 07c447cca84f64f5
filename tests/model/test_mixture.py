"""The mixture's density and derivative against SciPy and finite differences."""

import numpy as np
import pytest
from scipy.optimize import approx_fprime
from scipy.special import logsumexp
from scipy.stats import multivariate_normal

from faceposer.model.mixture import GaussianMixture, PrecisionGaussian


@pytest.fixture
def mixture() -> GaussianMixture:
    rng = np.random.default_rng(0)
    loadings = rng.normal(size=(4, 5, 2))
    return GaussianMixture(
        rng.dirichlet(np.ones(4)), rng.normal(size=(4, 5)), loadings @ loadings.transpose(0, 2, 1) + 0.3 * np.eye(5)
    )


def test_density_agrees_with_scipy(mixture: GaussianMixture) -> None:
    for p in np.random.default_rng(1).normal(size=(10, 5)):
        parts = [
            np.log(w) + multivariate_normal(m, c).logpdf(p)
            for w, m, c in zip(mixture.weights, mixture.means, mixture.covariances, strict=True)
        ]
        assert mixture.log_density(p) == pytest.approx(logsumexp(parts))
        assert mixture.energy_and_gradient(p)[0] == pytest.approx(-logsumexp(parts))
        np.testing.assert_allclose(mixture.responsibilities(p), np.exp(parts - logsumexp(parts)), atol=1e-9)


def test_gradient_agrees_with_finite_differences(mixture: GaussianMixture) -> None:
    for p in np.random.default_rng(2).normal(size=(10, 5)):
        numeric = approx_fprime(p, lambda x: mixture.energy_and_gradient(x)[0], 1e-7)
        np.testing.assert_allclose(mixture.energy_and_gradient(p)[1], numeric, atol=1e-4)


def test_far_away_points_do_not_underflow(mixture: GaussianMixture) -> None:
    energy, gradient = mixture.energy_and_gradient(np.full(5, 1e3))
    assert np.isfinite(energy)
    assert np.isfinite(gradient).all()


def test_transformed_density_is_that_of_transformed_samples(mixture: GaussianMixture) -> None:
    rng = np.random.default_rng(3)
    matrix = rng.normal(size=(3, 5))
    mean, covariance = mixture.transformed(matrix).moments()
    expected_mean, expected_covariance = mixture.moments()
    np.testing.assert_allclose(mean, matrix @ expected_mean)
    np.testing.assert_allclose(covariance, matrix @ expected_covariance @ matrix.T)


def test_as_gaussian_keeps_the_moments(mixture: GaussianMixture) -> None:
    single = mixture.as_gaussian()
    assert single.n_components == 1
    for ours, theirs in zip(single.moments(), mixture.moments(), strict=True):
        np.testing.assert_allclose(ours, theirs)


def test_densities_of_many_points_are_those_of_each() -> None:
    rng = np.random.default_rng(7)
    roots = rng.standard_normal((3, 4, 4))
    mixture = GaussianMixture(
        np.array([0.2, 0.3, 0.5]), rng.standard_normal((3, 4)), roots @ roots.transpose(0, 2, 1) + np.eye(4)
    )
    points = rng.standard_normal((9, 4))
    np.testing.assert_allclose(mixture.log_densities(points), [mixture.log_density(point) for point in points])


def test_a_gaussian_known_by_its_precision_is_the_one_known_by_its_covariance() -> None:
    rng = np.random.default_rng(4)
    rows = rng.normal(size=(20, 5))
    precision, mean, p = rows.T @ rows, rng.normal(size=5), rng.normal(size=5)
    by_precision = PrecisionGaussian(mean, precision)
    by_covariance = GaussianMixture(np.ones(1), mean[None], np.linalg.inv(precision)[None])
    for one, other, at in (
        (by_precision, by_covariance, p),
        (by_precision.translated_by(p), by_covariance.translated_by(p), mean),
    ):
        assert one.log_density(at) == pytest.approx(other.log_density(at))
        np.testing.assert_allclose(one.energy_and_gradient(at)[1], other.energy_and_gradient(at)[1])
        np.testing.assert_allclose(one.covariances, other.covariances)
        np.testing.assert_allclose(one.precisions, other.precisions)
