"""Mixtures of PPCA: EM, the closed form, and completion of partial samples."""

import numpy as np
import pytest

from faceposer.sketch.ppca import PPCAMixture


def _two_clusters(n: int = 60, d: int = 9, seed: int = 0) -> np.ndarray:
    rng = np.random.default_rng(seed)
    parts = [
        rng.normal(size=(n, 3)) @ rng.normal(size=(3, d)) + 0.1 * rng.normal(size=(n, d)) + shift
        for shift in (0.0, 4.0)
    ]
    return np.concatenate(parts)


@pytest.mark.parametrize("components", [2, 3])
def test_em_increases_the_likelihood(components: int) -> None:
    fitted = PPCAMixture.fit(_two_clusters(), components, 3)
    history = np.array(fitted.log_likelihoods)
    assert len(history) > 2
    assert np.diff(history).min() > -1e-9
    assert history[-1] == pytest.approx(fitted.log_densities(_two_clusters()).mean())


def test_em_increases_the_likelihood_at_the_least_variance() -> None:
    # The bound on sigma holds in every component, and the likelihood still rises.
    fitted = PPCAMixture.fit(_two_clusters(), 3, 3, least_variance=0.5)
    assert fitted.variances.min() == pytest.approx(0.5)
    assert np.diff(fitted.log_likelihoods).min() > -1e-9


def test_one_component_is_the_closed_form() -> None:
    data, q = _two_clusters()[:60], 2
    fitted = PPCAMixture.fit(data, 1, q)
    spreads, axes = np.linalg.eigh(np.cov(data.T, bias=True))
    spreads, axes = spreads[::-1], axes[:, ::-1]
    variance = spreads[q:].mean()
    expected = axes[:, :q] * (spreads[:q] - variance) @ axes[:, :q].T + variance * np.eye(data.shape[1])
    assert fitted.variances[0] == pytest.approx(variance)
    assert fitted.means[0] == pytest.approx(data.mean(axis=0))
    assert fitted.covariances[0] == pytest.approx(expected)


def test_more_dimensions_than_samples() -> None:
    # 12 samples in 40 dimensions: sigma^2 averages the 40 - q remaining eigenvalues, most of which are 0.
    data = np.random.default_rng(1).normal(size=(12, 40))
    fitted = PPCAMixture.fit(data, 1, 5)
    spreads = np.linalg.eigvalsh(np.cov(data.T, bias=True))[::-1]
    assert fitted.variances[0] == pytest.approx(spreads[5:].sum() / 35)
    deviations = data - fitted.means[0]
    _, log_determinant = np.linalg.slogdet(fitted.covariances[0])
    distance = np.einsum("nd,de,ne->n", deviations, np.linalg.inv(fitted.covariances[0]), deviations)
    direct = -0.5 * (distance + log_determinant + 40 * np.log(2 * np.pi))
    assert fitted.log_densities(data) == pytest.approx(direct)


def test_completion_is_the_conditional_gaussian_of_the_most_probable_component() -> None:
    data = _two_clusters()
    fitted = PPCAMixture.fit(data, 2, 3)
    observed, missing = np.array([0, 4, 7]), np.array([1, 2, 3, 5, 6, 8])
    values = data[::7][:, observed] + 0.2
    completed = fitted.completed(observed, values)
    chosen = set()
    for sample, given in zip(completed, values, strict=True):
        best, greatest = np.zeros(9), -np.inf
        for k in range(2):
            mean, covariance = fitted.means[k], fitted.covariances[k]
            # Equation (6) as printed, with the blocks of the precision matrix.
            precision = np.linalg.inv(covariance)
            whole = np.zeros(9)
            whole[observed] = given
            whole[missing] = mean[missing] - np.linalg.solve(
                precision[np.ix_(missing, missing)], precision[np.ix_(missing, observed)] @ (given - mean[observed])
            )
            distance = (whole - mean) @ precision @ (whole - mean)
            chance = np.log(fitted.weights[k]) - 0.5 * (distance + np.linalg.slogdet(covariance)[1])
            if chance > greatest:
                best, greatest, of = whole, chance, k
        chosen.add(of)
        assert sample == pytest.approx(best, abs=1e-9)
    assert chosen == {0, 1}


def test_expected_values_also_replace_observed_ones() -> None:
    data = _two_clusters()[:60]
    fitted = PPCAMixture.fit(data, 1, 3, least_variance=0.3)
    observed = np.arange(5)
    noisy = data[:, observed] + 0.5 * np.random.default_rng(2).normal(size=(60, 5))
    kept, expected = (fitted.completed(observed, noisy, keep) for keep in (True, False))
    assert np.array_equal(kept[:, observed], noisy)
    assert kept[:, 5:] == pytest.approx(expected[:, 5:])
    assert np.abs(expected - data)[:, observed].mean() < 0.8 * np.abs(noisy - data[:, observed]).mean()


def test_repeated_samples_do_not_break_the_clustering() -> None:
    data = np.repeat(_two_clusters(2), 4, axis=0)
    fitted = PPCAMixture.fit(data, 3, 2)
    assert np.isfinite(fitted.log_densities(data)).all()
