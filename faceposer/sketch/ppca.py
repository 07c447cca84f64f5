"""Mixtures of probabilistic principal component analysers (PPCA), and completion of partial data by them.

Tipping and Bishop (1999): each component is a Gaussian with mean mu and covariance C = W W^T + sigma^2 I, where W has q
columns. The mixture is fitted by EM; the M-step is exact, by the eigenvectors of each component's weighted covariance.
All computations take place in the span of the data, of at most n dimensions, and are exact in d dimensions.

Completion is equations (6) and (7) of Gunnarsson and Maddock (2010). As printed, (6) is headed by p(t_o | t_m); what it
computes, and what is meant, is p(t_m | t_o): the missing values given the observed ones. With n = 36 samples in 138
dimensions the sample covariance has rank 35; sigma^2 makes C invertible.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Ids = NDArray[np.intp]

# EM stops when the mean log likelihood per sample rises by less than this, or after so many rounds.
_RISE, _ROUNDS = 1e-4, 60
# Least variance as a share of the mean variance per dimension, where the data leave none.
_LEAST_VARIANCE = 1e-6
# Starts and rounds of the initial clustering.
_STARTS, _CLUSTER_ROUNDS = 4, 20


@dataclass(frozen=True, eq=False)
class PPCAMixture:
    """The density sum over k of weight_k N(t; mean_k, W_k W_k^T + sigma_k^2 I).

    Attributes:
        weights: Mixing coefficients, shape (K,).
        means: Shape (K, d).
        factors: W of each component, shape (K, d, q), with orthogonal columns; a column of zeros for a direction in
            which a component varies no more than sigma.
        variances: sigma^2 of each component, shape (K,).
        log_likelihoods: Mean log likelihood per sample before each round of EM and after the last.
    """

    weights: Array
    means: Array
    factors: Array
    variances: Array
    log_likelihoods: tuple[float, ...] = ()

    @classmethod
    def fit(
        cls, data: Array, components: int = 1, dimensions: int = 1, seed: int = 0, least_variance: float | None = None
    ) -> "PPCAMixture":
        """Fit the mixture to samples by EM, from an initial clustering by k-means.

        Args:
            data: Samples, shape (n, d).
            components: Number K of components, at most n.
            dimensions: Number q of columns of W, less than d.
            seed: Seed of the initial clustering.
            least_variance: Lower bound of sigma^2; a millionth of the mean variance per dimension if None.
        """
        n, d = data.shape
        center = data.mean(axis=0)
        _, lengths, axes = np.linalg.svd(data - center, full_matrices=False)
        kept = lengths > 1e-10 * max(float(lengths[0]), 1e-300)
        axes = axes[kept]
        samples = (data - center) @ axes.T
        if least_variance is None:
            least_variance = _LEAST_VARIANCE * float((lengths**2).sum()) / (n * d)
        least_variance = max(least_variance, 1e-12)
        fitting = _Fitting(samples, d, min(dimensions, d - 1), least_variance)
        shares = np.eye(components)[_clusters(samples, components, seed)]
        history: list[float] = []
        for _ in range(_ROUNDS if components > 1 else 1):
            fitting.maximise(shares)
            likelihood, shares = fitting.expect()
            history.append(likelihood)
            if len(history) > 1 and history[-1] - history[-2] < _RISE:
                break
        factors = np.zeros((components, d, fitting.dimensions))
        present = fitting.factors.shape[2]
        factors[:, :, :present] = axes.T @ fitting.factors
        return cls(fitting.weights, center + fitting.means @ axes, factors, fitting.variances, tuple(history))

    @property
    def n_components(self) -> int:
        """The number K of components."""
        return len(self.weights)

    @cached_property
    def covariances(self) -> Array:
        """Covariance C of each component, shape (K, d, d)."""
        d = self.means.shape[1]
        return np.asarray(
            self.factors @ self.factors.transpose(0, 2, 1) + self.variances[:, None, None] * np.eye(d)[None]
        )

    def log_joint(self, data: Array) -> Array:
        """Return ln(weight_k p(t | k)) of each sample of ``data``, shape (n, d), for each component, shape (n, K)."""
        d = data.shape[1]
        result = np.empty((len(data), self.n_components))
        for k, (factors, variance) in enumerate(zip(self.factors, self.variances, strict=True)):
            deviations = data - self.means[k]
            lengths = np.einsum("dq,dq->q", factors, factors)
            squares = (deviations @ factors) ** 2
            # The inverse of C by the orthogonality of the columns of W.
            inner = squares @ (1.0 / (variance * (lengths + variance)))
            distance = np.einsum("nd,nd->n", deviations, deviations) / variance - inner
            determinant = np.log1p(lengths / variance).sum() + d * np.log(variance)
            result[:, k] = np.log(self.weights[k]) - 0.5 * (distance + determinant + d * np.log(2.0 * np.pi))
        return result

    def log_densities(self, data: Array) -> Array:
        """Return ln p(t) of each sample of ``data``, shape (n, d), shape (n,) (equation (2))."""
        return np.asarray(np.logaddexp.reduce(self.log_joint(data), axis=1))

    def completed(self, observed: Ids, values: Array, keep: bool = True) -> Array:
        """Return samples whose missing values are the expected ones given the observed ones (equations (6) and (7)).

        Each component gives t_m = mu_m + C_mo C_oo^-1 (t_o - mu_o); the completion with the greatest
        rho_k = weight_k p(t | k) is kept. The inverse is that of a (q, q) matrix, by Woodbury's identity.

        Args:
            observed: Indices of the observed dimensions, shape (o,).
            values: Their values in each sample, shape (n, o).
            keep: True to keep the observed values, as in the paper; False for their expectations W x + mu as well,
                which by (1) are the values without noise.
        """
        d = self.means.shape[1]
        candidates = np.empty((self.n_components, len(values), d))
        kept = np.empty_like(candidates)
        chances = np.empty((len(values), self.n_components))
        for k, (factors, variance) in enumerate(zip(self.factors, self.variances, strict=True)):
            seen = factors[observed]
            latent = np.linalg.solve(
                variance * np.eye(factors.shape[1]) + seen.T @ seen, seen.T @ (values - self.means[k, observed]).T
            )
            candidates[k] = self.means[k] + latent.T @ factors.T
            kept[k] = candidates[k]
            kept[k][:, observed] = values
            chances[:, k] = self.log_joint(kept[k])[:, k]
        best = chances.argmax(axis=1), np.arange(len(values))
        return np.asarray((kept if keep else candidates)[best])

    def expected(self, observed: Ids, values: Array) -> Array:
        """Return the missing values that are expected given the observed ones, shape (n, d - o).

        The expectation is over all components, and therefore a continuous function of ``values``; ``completed`` takes
        the likeliest component.

        Args:
            observed: Indices of the observed dimensions, shape (o,).
            values: Their values in each sample, shape (n, o).
        """
        missing = np.setdiff1d(np.arange(self.means.shape[1]), observed)
        expectations = np.empty((self.n_components, len(values), len(missing)))
        logs = np.empty((self.n_components, len(values)))
        for k, (factors, variance) in enumerate(zip(self.factors, self.variances, strict=True)):
            seen, deviations = factors[observed], values - self.means[k, observed]
            inner = variance * np.eye(factors.shape[1]) + seen.T @ seen
            projected = seen.T @ deviations.T
            latent = np.linalg.solve(inner, projected)
            expectations[k] = self.means[k, missing] + latent.T @ factors[missing].T
            distance = (np.einsum("no,no->n", deviations, deviations) - (projected * latent).sum(axis=0)) / variance
            determinant = np.linalg.slogdet(inner)[1] + (len(observed) - factors.shape[1]) * np.log(variance)
            logs[k] = np.log(self.weights[k]) - 0.5 * (distance + determinant)
        shares = np.exp(logs - np.logaddexp.reduce(logs, axis=0))
        return np.asarray(np.einsum("kn,knm->nm", shares, expectations))


class _Fitting:
    """EM in the span of the samples, whose deviations from it are zero in the remaining dimensions."""

    def __init__(self, samples: Array, d: int, dimensions: int, least_variance: float) -> None:
        self._samples, self._d, self.dimensions, self._least = samples, d, dimensions, least_variance
        self.weights = self.variances = np.zeros(0)
        self.means = np.zeros((0, 0))
        self.factors = np.zeros((0, 0, 0))

    def maximise(self, shares: Array) -> None:
        """Set the parameters from the responsibilities ``shares``, shape (n, K)."""
        samples, span = self._samples, self._samples.shape[1]
        total = shares.sum(axis=0) + 1e-12
        self.weights = total / total.sum()
        self.means = (shares.T @ samples) / total[:, None]
        q = min(self.dimensions, span)
        self.factors = np.zeros((len(total), span, q))
        self.variances = np.empty(len(total))
        for k in range(len(total)):
            weighted = (samples - self.means[k]) * np.sqrt(shares[:, k] / total[k])[:, None]
            spreads, axes = np.linalg.eigh(weighted.T @ weighted)
            spreads, axes = spreads[::-1].clip(0.0), axes[:, ::-1]
            # The remaining d - span eigenvalues are zero. The likelihood falls on both sides of this maximum, so that
            # with the lower bound it still rises in every round.
            variance = max(float(spreads[q:].sum()) / (self._d - self.dimensions), self._least)
            self.variances[k] = variance
            self.factors[k] = axes[:, :q] * np.sqrt((spreads[:q] - variance).clip(0.0))

    def expect(self) -> tuple[float, Array]:
        """Return the mean log likelihood per sample and the responsibilities, shape (n, K)."""
        mixture = PPCAMixture(self.weights, self.means, self.factors, self.variances)
        joint = mixture.log_joint(self._samples)
        # The dimensions outside the span contribute constants.
        joint -= 0.5 * (self._d - self._samples.shape[1]) * np.log(2.0 * np.pi * self.variances)
        evidence = np.logaddexp.reduce(joint, axis=1)
        return float(evidence.mean()), np.exp(joint - evidence[:, None])


def _clusters(samples: Array, count: int, seed: int) -> Ids:
    """Return the cluster of each of ``samples``, (n, d), by the best of a few runs of k-means, shape (n,)."""
    if count == 1:
        return np.zeros(len(samples), dtype=np.intp)
    rng = np.random.default_rng(seed)
    best, least = np.zeros(len(samples), dtype=np.intp), np.inf
    for _ in range(_STARTS):
        centers = samples[[int(rng.integers(len(samples)))]]
        while len(centers) < count:
            squared = _squared_distances(samples, centers).min(axis=1)
            chances = squared + 1e-12
            centers = np.concatenate([centers, samples[[int(rng.choice(len(samples), p=chances / chances.sum()))]]])
        for _ in range(_CLUSTER_ROUNDS):
            nearest = _squared_distances(samples, centers).argmin(axis=1)
            moved = np.stack(
                [samples[nearest == k].mean(axis=0) if (nearest == k).any() else c for k, c in enumerate(centers)]
            )
            if np.array_equal(moved, centers):
                break
            centers = moved
        squared = _squared_distances(samples, centers)
        if (inertia := float(squared.min(axis=1).sum())) < least:
            best, least = squared.argmin(axis=1), inertia
    return best


def _squared_distances(a: Array, b: Array) -> Array:
    """Return the squared distances of points ``a``, (n, d), from points ``b``, (m, d), shape (n, m)."""
    cross = (a**2).sum(axis=1)[:, None] + (b**2).sum(axis=1)[None] - 2.0 * a @ b.T
    return np.asarray(cross.clip(0.0))
