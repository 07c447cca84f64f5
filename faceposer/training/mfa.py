"""Mixture of factor analyzers as a scikit-learn estimator (Ghahramani and Hinton 1997; Lau et al. 2009, section 5).

scikit-learn is imported in training only, so that posing does not load it.
"""

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from numbers import Integral, Real
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sklearn.base import BaseEstimator, DensityMixin
from sklearn.cluster import KMeans
from sklearn.exceptions import ConvergenceWarning
from sklearn.utils import check_random_state
from sklearn.utils._param_validation import Interval, StrOptions
from sklearn.utils.validation import check_is_fitted, validate_data

from faceposer.model.mixture import GaussianMixture

Array = NDArray[np.float64]

# Responsibility below which a sample does not count for the covariance of a component.
_NEGLIGIBLE = 1e-16


class MixtureOfFactorAnalyzers(DensityMixin, BaseEstimator):  # type: ignore[misc]
    """The density sum over k of weight_k N(mean_k, A_k A_k^T + Psi_k), with loadings A_k and diagonal noise Psi_k.

    It is fitted by expectation-maximisation from a k-means start. With ``shrinkage`` the fit is maximum a posteriori:
    each component's covariance has an inverse Wishart prior around the covariance of all samples, with the weight of
    that share of an average component. Plain maximum likelihood overfits the neighbouring frames of a capture.

    Args:
        n_components: Number K of factor analyzers.
        n_factors: Number q of factors of each.
        noise: "shared" for one Psi (the paper's eq. (18)), "separate" for one per component.
        shrinkage: Weight of the prior as a share of an average component, below 1; 0 for maximum likelihood.
        reg_covar: Least noise variance.
        n_init: Number of initialisations, of which the best is kept.
        max_iter: Largest number of iterations per initialisation.
        tol: Convergence threshold: the fit ends when the mean objective rises by less.
        random_state: Seed or generator of the initialisations and of ``sample``.

    Attributes:
        weights_: Mixing proportions, shape (K,).
        means_: Shape (K, d).
        loadings_: A_k, shape (K, d, q).
        noise_variance_: Diagonals of Psi_k, shape (K, d); all rows equal if shared.
        covariances_: A_k A_k^T + Psi_k, shape (K, d, d).
        converged_: True if the objective of the best start rose by less than ``tol`` within ``max_iter`` iterations.
        n_iter_: Number of iterations of the best start, at most ``max_iter``.
        lower_bound_: Its objective per sample: the mean log-likelihood, plus the log-prior if there is shrinkage.
        lower_bounds_: The objective after each of its iterations.
    """

    _parameter_constraints: ClassVar[dict[str, list[Any]]] = {
        "n_components": [Interval(Integral, 1, None, closed="left")],
        "n_factors": [Interval(Integral, 1, None, closed="left")],
        "noise": [StrOptions({"shared", "separate"})],
        "shrinkage": [Interval(Real, 0.0, 1.0, closed="left")],
        "reg_covar": [Interval(Real, 0.0, None, closed="neither")],
        "n_init": [Interval(Integral, 1, None, closed="left")],
        "max_iter": [Interval(Integral, 1, None, closed="left")],
        "tol": [Interval(Real, 0.0, None, closed="left")],
        "random_state": ["random_state"],
    }

    def __init__(
        self,
        n_components: int = 1,
        n_factors: int = 1,
        *,
        noise: str = "separate",
        shrinkage: float = 0.0,
        reg_covar: float = 1e-6,
        n_init: int = 1,
        max_iter: int = 200,
        tol: float = 1e-4,
        random_state: Any = None,
    ) -> None:
        self.n_components = n_components
        self.n_factors = n_factors
        self.noise = noise
        self.shrinkage = shrinkage
        self.reg_covar = reg_covar
        self.n_init = n_init
        self.max_iter = max_iter
        self.tol = tol
        self.random_state = random_state

    def fit(self, X: ArrayLike, y: None = None) -> Self:
        """Fit the mixture to the samples ``X`` of shape (n, d).

        Warns with scikit-learn's ``ConvergenceWarning`` if the best start reaches ``max_iter`` before it converges.

        Raises:
            ValueError: If there are fewer samples than components, or not fewer factors than dimensions.
        """
        self._validate_params()
        samples: Array = validate_data(self, X, dtype=np.float64, ensure_min_samples=2)
        n_samples, n_features = samples.shape
        if n_samples < self.n_components:
            raise ValueError(f"n_components={self.n_components} needs as many samples, but there are {n_samples}")
        if self.n_factors > n_features:
            raise ValueError(f"n_factors={self.n_factors} exceeds the {n_features} dimensions of the samples")
        random_state = check_random_state(self.random_state)
        self._global_covariance = np.cov(samples.T, bias=True).reshape(n_features, n_features)
        self._prior_samples = self.shrinkage / (1.0 - self.shrinkage) * n_samples / self.n_components

        best = max((self._run(samples, random_state) for _ in range(self.n_init)), key=lambda run: run["lower_bound_"])
        for name, value in best.items():
            setattr(self, name, value)
        if not self.converged_:
            rise = self.lower_bounds_[-1] - self.lower_bounds_[-2] if self.n_iter_ > 1 else np.inf
            warnings.warn(
                f"MixtureOfFactorAnalyzers did not converge in {self.n_iter_} iterations: its objective still rose by "
                f"{rise:.3g}, and tol is {self.tol:g}. Increase max_iter or tol, or check the samples.",
                ConvergenceWarning,
                stacklevel=2,
            )
        return self

    def _run(self, samples: Array, random_state: np.random.RandomState) -> dict[str, Any]:
        """Return the fitted attributes of one start, after alternating expectation and maximisation to convergence."""
        self._start(samples, random_state)
        bounds: list[float] = []
        converged = False
        while not converged and len(bounds) < self.max_iter:
            log_likelihood, responsibilities = self._expect(samples)
            bounds.append(float(log_likelihood + self._log_prior() / len(samples)))
            converged = len(bounds) > 1 and bounds[-1] - bounds[-2] < self.tol
            if not converged:
                self._maximise(samples, responsibilities)
        return {
            "weights_": self.weights_,
            "means_": self.means_,
            "loadings_": self.loadings_,
            "noise_variance_": self.noise_variance_,
            "converged_": converged,
            "n_iter_": len(bounds),
            "lower_bound_": bounds[-1],
            "lower_bounds_": np.array(bounds),
        }

    @property
    def covariances_(self) -> Array:
        """A_k A_k^T + Psi_k, shape (K, d, d)."""
        return _covariances(self.loadings_, self.noise_variance_)

    def _start(self, X: Array, random_state: np.random.RandomState) -> None:
        """Initialise from k-means clusters: their means, and a factor analysis of each by its principal axes."""
        seed = random_state.randint(np.iinfo(np.int32).max)
        labels = KMeans(self.n_components, n_init=1, random_state=seed).fit_predict(X)
        responsibilities = np.eye(self.n_components)[labels]
        self._set_weights_and_means(X, responsibilities)
        scatter = self._scatter(X, responsibilities)
        loadings, noise = [], []
        for covariance in scatter:
            values, axes = np.linalg.eigh(covariance)
            values, axes = values[::-1], axes[:, ::-1]
            rest = float(values[self.n_factors :].mean()) if self.n_factors < len(values) else 0.0
            kept = np.sqrt(np.maximum(values[: self.n_factors] - rest, 1e-3 * max(values[0], self.reg_covar)))
            loading = axes[:, : self.n_factors] * kept
            loadings.append(loading)
            noise.append(np.diag(covariance) - np.einsum("dq,dq->d", loading, loading))
        floor = np.maximum(self.reg_covar, 1e-2 * np.diag(self._global_covariance))
        self.loadings_ = np.array(loadings)
        self.noise_variance_ = self._tied(np.maximum(noise, floor))

    def _set_weights_and_means(self, X: Array, responsibilities: Array) -> None:
        counts = responsibilities.sum(axis=0) + 10.0 * np.finfo(np.float64).eps
        self.weights_ = counts / counts.sum()
        self.means_ = (responsibilities.T @ X) / counts[:, None]

    def _scatter(self, X: Array, responsibilities: Array) -> Array:
        """Return each component's covariance with the prior's samples in it, shape (K, d, d)."""
        counts = responsibilities.sum(axis=0) + 10.0 * np.finfo(np.float64).eps
        scatter = np.empty((self.n_components, X.shape[1], X.shape[1]))
        for k, mean in enumerate(self.means_):
            # Most samples belong to few components.
            rows = np.flatnonzero(responsibilities[:, k] > _NEGLIGIBLE)
            difference = X[rows] - mean
            scatter[k] = (difference * responsibilities[rows, k, None]).T @ difference
        scatter += self._prior_samples * self._global_covariance
        scaled: Array = scatter / (counts + self._prior_samples)[:, None, None]
        return scaled

    def _tied(self, noise: Array) -> Array:
        if self.noise == "separate":
            return noise
        # Each component counts with its samples and with those of its prior.
        counts = self.weights_ + self.shrinkage / (1.0 - self.shrinkage) / self.n_components
        shared = counts @ noise / counts.sum()
        return np.broadcast_to(shared, noise.shape).copy()

    def _log_joint(self, X: Array) -> Array:
        """Return ln(weight_k N(x_i; k)), shape (n, K)."""
        columns = []
        for mean, covariance in zip(self.means_, self.covariances_, strict=True):
            lower = np.linalg.cholesky(covariance)
            # A product with the inverse takes a fraction of the time of solving for as many samples.
            whitened = (X - mean) @ np.linalg.inv(lower).T
            log_determinant = 2.0 * np.log(np.diag(lower)).sum()
            squared = np.einsum("nd,nd->n", whitened, whitened)
            columns.append(-0.5 * (squared + log_determinant + X.shape[1] * np.log(2.0 * np.pi)))
        with np.errstate(divide="ignore"):
            log_joint: Array = np.stack(columns, axis=1) + np.log(self.weights_)
        return log_joint

    def _expect(self, X: Array) -> tuple[float, Array]:
        log_joint = self._log_joint(X)
        log_density = np.logaddexp.reduce(log_joint, axis=1)
        return float(log_density.mean()), np.exp(log_joint - log_density[:, None])

    def _log_prior(self) -> float:
        """Return the log-density of the covariances under their inverse Wishart priors, up to a constant."""
        if self._prior_samples == 0:
            return 0.0
        total = 0.0
        for covariance in self.covariances_:
            trace = np.trace(np.linalg.solve(covariance, self._global_covariance))
            total += np.linalg.slogdet(covariance)[1] + float(trace)
        return -0.5 * self._prior_samples * total

    def _maximise(self, X: Array, responsibilities: Array) -> None:
        """Increase the expected objective: weights and means exactly, then one step of each factor analysis.

        For given responsibilities the optimal mean is the weighted mean for any covariance, so that the factors can be
        updated from the scatter about it (Ghahramani and Hinton, eqs. (8) to (12), with the mean removed).
        """
        self._set_weights_and_means(X, responsibilities)
        scatter = self._scatter(X, responsibilities)
        covariances = self.covariances_
        loadings, noise = np.empty_like(self.loadings_), np.empty_like(self.noise_variance_)
        for k, (loading, covariance, observed) in enumerate(zip(self.loadings_, covariances, scatter, strict=True)):
            beta = np.linalg.solve(covariance, loading).T
            cross = observed @ beta.T
            second_moment = np.eye(self.n_factors) - beta @ loading + beta @ cross
            loadings[k] = np.linalg.solve(second_moment, cross.T).T
            noise[k] = np.diag(observed) - np.einsum("dq,dq->d", loadings[k], cross)
        self.loadings_ = loadings
        self.noise_variance_ = np.maximum(self._tied(noise), self.reg_covar)

    def _validate(self, X: ArrayLike) -> Array:
        check_is_fitted(self, "loadings_")
        checked: Array = validate_data(self, X, dtype=np.float64, reset=False)
        return checked

    def score_samples(self, X: ArrayLike) -> Array:
        """Return the log-density of each of the samples ``X``, (n, d), shape (n,)."""
        log_density: Array = np.logaddexp.reduce(self._log_joint(self._validate(X)), axis=1)
        return log_density

    def score(self, X: ArrayLike, y: None = None) -> float:
        """Return the mean log-density of the samples ``X``, (n, d)."""
        return float(self.score_samples(X).mean())

    def predict_proba(self, X: ArrayLike) -> Array:
        """Return the probability of each component given each of the samples ``X``, (n, d), shape (n, K)."""
        return self._expect(self._validate(X))[1]

    def predict(self, X: ArrayLike) -> NDArray[np.intp]:
        """Return the likeliest component of each of the samples ``X``, (n, d), shape (n,)."""
        labels: NDArray[np.intp] = self.predict_proba(X).argmax(axis=1)
        return labels

    def sample(self, n_samples: int = 1) -> tuple[Array, NDArray[np.intp]]:
        """Return ``n_samples`` random samples, (n, d), and their components, (n,)."""
        check_is_fitted(self, "loadings_")
        if n_samples < 1:
            raise ValueError(f"n_samples={n_samples} must be at least 1")
        random_state = check_random_state(self.random_state)
        labels = np.sort(random_state.choice(len(self.weights_), size=n_samples, p=self.weights_))
        factors = random_state.normal(size=(n_samples, self.loadings_.shape[2]))
        noise = random_state.normal(size=(n_samples, self.means_.shape[1])) * np.sqrt(self.noise_variance_[labels])
        return self.means_[labels] + np.einsum("ndq,nq->nd", self.loadings_[labels], factors) + noise, labels

    def _n_parameters(self) -> int:
        """Return the number of free parameters, not counting rotations of the factors."""
        n_components, n_features, n_factors = self.loadings_.shape
        loadings = n_components * (n_features * n_factors - n_factors * (n_factors - 1) // 2)
        noise = n_features * (1 if self.noise == "shared" else n_components)
        return n_components - 1 + n_components * n_features + loadings + noise

    def bic(self, X: ArrayLike) -> float:
        """Return the Bayesian information criterion on the samples ``X``, (n, d); lower is better."""
        scores = self.score_samples(X)
        return float(-2.0 * scores.sum() + self._n_parameters() * np.log(len(scores)))

    def aic(self, X: ArrayLike) -> float:
        """Return Akaike's information criterion on the samples ``X``, (n, d); lower is better."""
        return float(-2.0 * self.score_samples(X).sum() + 2.0 * self._n_parameters())

    def as_mixture(self) -> GaussianMixture:
        """Return the density in the form used by the solver."""
        check_is_fitted(self, "loadings_")
        return GaussianMixture(self.weights_, self.means_, self.covariances_)


@contextmanager
def convergence_recorded() -> Iterator[list[str]]:
    """Collect the convergence warnings of fits in the block instead of showing them.

    Other warnings are shown when the block ends.
    """
    messages: list[str] = []
    with warnings.catch_warnings(record=True) as caught:
        warnings.filterwarnings("always", "MixtureOfFactorAnalyzers", ConvergenceWarning)
        yield messages
    for warning in caught:
        if str(warning.message).startswith("MixtureOfFactorAnalyzers"):
            messages.append(str(warning.message))
        else:
            warnings.warn_explicit(warning.message, warning.category, warning.filename, warning.lineno)


def _covariances(loadings: Array, noise_variance: Array) -> Array:
    covariances: Array = loadings @ loadings.transpose(0, 2, 1)
    diagonal = np.arange(loadings.shape[1])
    covariances[:, diagonal, diagonal] += noise_variance
    return covariances
