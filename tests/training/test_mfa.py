"""The mixture of factor analyzers against scikit-learn, against known mixtures and against itself."""

import warnings

import numpy as np
import pytest
from scipy.special import logsumexp
from scipy.stats import multivariate_normal
from sklearn.base import clone
from sklearn.decomposition import FactorAnalysis
from sklearn.exceptions import ConvergenceWarning, NotFittedError

from faceposer.training.mfa import MixtureOfFactorAnalyzers, convergence_recorded


@pytest.fixture
def samples() -> np.ndarray:
    """Three well separated factor analyzers in 6 dimensions, 2 factors each, 1,500 samples."""
    rng = np.random.default_rng(0)
    parts = []
    for centre in ([8, 0, 0, 0, 0, 0], [0, 8, 0, 0, 0, 0], [0, 0, 8, 0, 0, 0]):
        loading = rng.normal(size=(6, 2))
        parts.append(np.array(centre) + rng.normal(size=(500, 2)) @ loading.T + 0.3 * rng.normal(size=(500, 6)))
    return np.concatenate(parts)


def test_one_component_agrees_with_factor_analysis(samples: np.ndarray) -> None:
    ours = MixtureOfFactorAnalyzers(1, 2, tol=1e-7, max_iter=5000, random_state=0).fit(samples)
    theirs = FactorAnalysis(2, tol=1e-4, max_iter=5000, svd_method="lapack").fit(samples)
    assert ours.score(samples) == pytest.approx(theirs.score(samples), abs=1e-3)
    np.testing.assert_allclose(ours.covariances_[0], theirs.get_covariance(), atol=0.02)
    np.testing.assert_allclose(ours.means_[0], theirs.mean_)


@pytest.mark.parametrize("noise", ["shared", "separate"])
def test_a_known_mixture_is_found(samples: np.ndarray, noise: str) -> None:
    mixture = MixtureOfFactorAnalyzers(3, 2, noise=noise, n_init=3, random_state=0).fit(samples)
    assert mixture.converged_
    np.testing.assert_allclose(np.sort(mixture.weights_), 1 / 3, atol=0.01)
    labels = mixture.predict(samples)
    for part in range(3):
        own = labels[500 * part : 500 * (part + 1)]
        assert (own == np.bincount(own).argmax()).mean() > 0.99
        estimate = mixture.covariances_[np.bincount(own).argmax()]
        np.testing.assert_allclose(estimate, np.cov(samples[500 * part : 500 * (part + 1)].T), atol=0.3)
    np.testing.assert_allclose(mixture.noise_variance_, 0.09, atol=0.06)


@pytest.mark.parametrize("noise", ["shared", "separate"])
@pytest.mark.parametrize("shrinkage", [0.0, 0.3])
def test_the_objective_never_falls(samples: np.ndarray, noise: str, shrinkage: float) -> None:
    mixture = MixtureOfFactorAnalyzers(5, 3, noise=noise, shrinkage=shrinkage, tol=0, max_iter=60, random_state=1)
    with pytest.warns(ConvergenceWarning, match="did not converge in 60 iterations"):
        bounds = mixture.fit(samples).lower_bounds_
    assert np.diff(bounds).min() > -1e-9
    assert bounds[-1] > bounds[0]


def test_more_starts_are_never_worse(samples: np.ndarray) -> None:
    one = MixtureOfFactorAnalyzers(4, 2, n_init=1, random_state=3).fit(samples)
    five = MixtureOfFactorAnalyzers(4, 2, n_init=5, random_state=3).fit(samples)
    assert five.lower_bound_ >= one.lower_bound_


def test_a_fit_that_does_not_converge_says_so(samples: np.ndarray) -> None:
    mixture = MixtureOfFactorAnalyzers(5, 3, tol=1e-9, max_iter=7, n_init=2, random_state=0)
    with pytest.warns(
        ConvergenceWarning, match="7 iterations: its objective still rose by .*, and tol is 1e-09"
    ) as said:
        mixture.fit(samples)
    assert len(said) == 1, "one sentence, however many starts"
    assert not mixture.converged_
    assert (mixture.n_iter_, len(mixture.lower_bounds_)) == (7, 7)
    assert said[0].filename == __file__


def test_a_fit_that_converges_is_silent(samples: np.ndarray) -> None:
    # Warnings are errors here.
    mixture = MixtureOfFactorAnalyzers(3, 2, random_state=0).fit(samples)
    assert mixture.converged_
    assert mixture.n_iter_ == len(mixture.lower_bounds_) < mixture.max_iter
    assert (
        mixture.lower_bounds_[-1] - mixture.lower_bounds_[-2] < mixture.tol <= np.diff(mixture.lower_bounds_[:-1]).min()
    )


def test_one_iteration_does_not_converge(samples: np.ndarray) -> None:
    with pytest.warns(ConvergenceWarning, match="in 1 iterations: its objective still rose by inf"):
        assert not MixtureOfFactorAnalyzers(2, 1, max_iter=1, random_state=0).fit(samples).converged_


def test_convergence_is_recorded_and_other_warnings_are_not(samples: np.ndarray) -> None:
    with warnings.catch_warnings(record=True) as others:
        warnings.simplefilter("always")
        with convergence_recorded() as messages:
            MixtureOfFactorAnalyzers(3, 2, max_iter=2, random_state=0).fit(samples)
            warnings.warn("another thing", UserWarning, stacklevel=1)
    assert [str(other.message) for other in others] == ["another thing"]
    assert len(messages) == 1
    with convergence_recorded() as messages:
        MixtureOfFactorAnalyzers(3, 2, random_state=0).fit(samples)
    assert messages == []


def test_shrinkage_helps_where_data_is_short() -> None:
    rng = np.random.default_rng(1)
    loading = rng.normal(size=(20, 3))
    data = rng.normal(size=(2060, 3)) @ loading.T + 0.2 * rng.normal(size=(2060, 20))
    train, test = data[:60], data[60:]
    plain, shrunk = (MixtureOfFactorAnalyzers(4, 5, shrinkage=s, random_state=0).fit(train) for s in (0.0, 0.5))
    assert plain.score(train) > shrunk.score(train)
    assert plain.score(test) < shrunk.score(test)


def test_density_and_probabilities_agree_with_scipy(samples: np.ndarray) -> None:
    mixture = MixtureOfFactorAnalyzers(3, 2, random_state=0).fit(samples)
    parts = np.stack(
        [
            np.log(w) + multivariate_normal(m, c).logpdf(samples[::50])
            for w, m, c in zip(mixture.weights_, mixture.means_, mixture.covariances_, strict=True)
        ],
        axis=1,
    )
    np.testing.assert_allclose(mixture.score_samples(samples[::50]), logsumexp(parts, axis=1))
    np.testing.assert_allclose(
        mixture.predict_proba(samples[::50]), np.exp(parts - logsumexp(parts, axis=1, keepdims=True)), atol=1e-9
    )
    runtime = mixture.as_mixture()
    for x in samples[::300]:
        assert runtime.log_density(x) == pytest.approx(mixture.score_samples([x])[0])


def test_samples_have_the_moments_of_the_density(samples: np.ndarray) -> None:
    mixture = MixtureOfFactorAnalyzers(3, 2, random_state=0).fit(samples)
    drawn, labels = mixture.sample(40_000)
    mean, covariance = mixture.as_mixture().moments()
    np.testing.assert_allclose(drawn.mean(axis=0), mean, atol=0.1)
    np.testing.assert_allclose(np.cov(drawn.T), covariance, atol=0.4)
    np.testing.assert_allclose(np.bincount(labels) / 40_000, mixture.weights_, atol=0.02)


def test_bic_prefers_the_true_number_of_components(samples: np.ndarray) -> None:
    scores = {
        k: MixtureOfFactorAnalyzers(k, 2, n_init=3, random_state=0).fit(samples).bic(samples) for k in (1, 2, 3, 5)
    }
    assert min(scores, key=scores.__getitem__) == 3


def test_aic_and_bic_count_parameters(samples: np.ndarray) -> None:
    mixture = MixtureOfFactorAnalyzers(2, 2, random_state=0).fit(samples)
    # 1 weight, 2 x 6 means, 2 x (12 - 1) loadings, 2 x 6 noise variances.
    assert mixture.aic(samples) == pytest.approx(-2 * mixture.score_samples(samples).sum() + 2 * 47)


def test_same_seed_same_fit(samples: np.ndarray) -> None:
    a, b = (MixtureOfFactorAnalyzers(4, 2, random_state=7).fit(samples) for _ in range(2))
    np.testing.assert_array_equal(a.means_, b.means_)


def test_behaves_as_an_estimator(samples: np.ndarray) -> None:
    mixture = MixtureOfFactorAnalyzers(3, 2, shrinkage=0.1)
    assert clone(mixture).get_params() == mixture.get_params()
    with pytest.raises(NotFittedError):
        mixture.score_samples(samples)
    mixture.fit(samples)
    with pytest.raises(ValueError, match="features"):
        mixture.score_samples(samples[:, :3])


@pytest.mark.parametrize(
    ("parameters", "said"),
    [
        ({"n_components": 0}, "n_components"),
        ({"n_factors": 7}, "n_factors=7 exceeds the 6"),
        ({"n_components": 2000}, "n_components=2000 needs"),
        ({"shrinkage": 1.0}, "shrinkage"),
        ({"noise": "none"}, "noise"),
        ({"reg_covar": 0.0}, "reg_covar"),
    ],
)
def test_impossible_parameters_are_refused(samples: np.ndarray, parameters: dict, said: str) -> None:
    with pytest.raises(ValueError, match=said):
        MixtureOfFactorAnalyzers(**parameters).fit(samples)


def test_wrong_data_is_refused() -> None:
    with pytest.raises(ValueError, match="NaN"):
        MixtureOfFactorAnalyzers().fit([[1.0, np.nan], [2.0, 3.0]])
