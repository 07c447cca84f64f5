"""Mixtures of Gaussians for evaluation, the form of a trained mixture of factor analyzers."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class GaussianMixture:
    """Density over coefficients: sum over k of weight_k N(p; mean_k, covariance_k) (Lau et al. 2009, eq. (18)).

    Attributes:
        weights: Mixing proportions, shape (K,), summing to one.
        means: Shape (K, r).
        covariances: Shape (K, r, r), positive definite.
    """

    weights: Array
    means: Array
    covariances: Array

    @property
    def n_components(self) -> int:
        """The number of components K."""
        return len(self.weights)

    @cached_property
    def whiteners(self) -> Array:
        """Triangular W_k with W_k^T W_k the precision of component k, shape (K, r, r)."""
        lower = np.linalg.cholesky(self.covariances)
        return np.linalg.inv(lower)

    def draws(self, n: int, rng: np.random.Generator) -> Array:
        """Draw ``n`` points from the density with ``rng``, shape (n, r), ordered by component.

        The number of draws per component is its share of ``n`` to within one (stratified sampling).
        """
        ends = np.cumsum(self.weights) / self.weights.sum()
        chosen = np.searchsorted(ends, (np.arange(n) + 0.5) / n).clip(max=self.n_components - 1)
        points = rng.standard_normal((n, self.means.shape[1]))
        for k in np.unique(chosen):
            of_k = chosen == k
            points[of_k] = self.means[k] + points[of_k] @ np.linalg.cholesky(self.covariances[k]).T
        return points

    @cached_property
    def _stacked(self) -> tuple[Array, Array, Array]:
        """All whiteners as one (K r, r) matrix, the whitened means, (K, r), and the components' log peaks, (K,)."""
        n_components, r = self.means.shape
        stacked = np.ascontiguousarray(self.whiteners.reshape(n_components * r, r))
        offsets = np.einsum("kij,kj->ki", self.whiteners, self.means)
        log_determinants = np.log(np.einsum("kii->ki", self.whiteners)).sum(axis=1)
        peaks = np.log(self.weights) + log_determinants - 0.5 * r * np.log(2.0 * np.pi)
        return stacked, offsets, peaks

    def _log_joint(self, p: Array) -> tuple[Array, Array]:
        """Return the log of each component's contribution to the density, (K,), and whitened deviations, (K, r)."""
        stacked, offsets, peaks = self._stacked
        deviations = (stacked @ p).reshape(offsets.shape) - offsets
        return peaks - 0.5 * np.einsum("kr,kr->k", deviations, deviations), deviations

    def log_density(self, p: Array) -> float:
        """Return ln pr(p) for one ``p`` of shape (r,)."""
        log_joint, _ = self._log_joint(p)
        top = log_joint.max()
        return float(top + np.log(np.exp(log_joint - top).sum()))

    def log_densities(self, points: Array) -> Array:
        """Return ln pr(p), shape (n,), for each p of ``points``, shape (n, r)."""
        _, offsets, peaks = self._stacked
        log_joint = np.empty((len(points), self.n_components))
        for k, (whitener, offset) in enumerate(zip(self.whiteners, offsets, strict=True)):
            deviations = points @ whitener.T - offset
            log_joint[:, k] = peaks[k] - 0.5 * np.einsum("nr,nr->n", deviations, deviations)
        densities: Array = np.logaddexp.reduce(log_joint, axis=1)
        return densities

    def responsibilities(self, p: Array) -> Array:
        """Return the posterior probability of each component given ``p`` of shape (r,), shape (K,)."""
        log_joint, _ = self._log_joint(p)
        shares = np.exp(log_joint - log_joint.max())
        total: Array = shares / shares.sum()
        return total

    def energy_and_gradient(self, p: Array) -> tuple[float, Array]:
        """Return -ln pr(p) and its gradient, shape (r,) (paper, eqs. (19) and (31), by log-sum-exp)."""
        log_joint, deviations = self._log_joint(p)
        top = log_joint.max()
        shares = np.exp(log_joint - top)
        total = shares.sum()
        gradient = (deviations * (shares / total)[:, None]).ravel() @ self._stacked[0]
        return -float(top + np.log(total)), gradient

    @cached_property
    def precisions(self) -> Array:
        """Inverse covariances, shape (K, r, r)."""
        precisions: Array = self.whiteners.transpose(0, 2, 1) @ self.whiteners
        return precisions

    def curvature(self, p: Array) -> Array:
        """Return the precision of the most probable component given ``p``, shape (r, r)."""
        precision: Array = self.precisions[int(np.argmax(self.responsibilities(p)))]
        return precision

    def transformed(self, matrix: Array) -> "GaussianMixture":
        """Return the density of ``matrix @ p``, for a ``matrix`` of shape (r', r) of full row rank."""
        covariances = np.einsum("ij,kjl,ml->kim", matrix, self.covariances, matrix, optimize=True)
        return GaussianMixture(
            self.weights, self.means @ matrix.T, 0.5 * (covariances + covariances.transpose(0, 2, 1))
        )

    def translated_by(self, offset: Array) -> "GaussianMixture":
        """Return the density of p + ``offset``, shape (r,), without factorising the covariances again."""
        moved = GaussianMixture(self.weights, self.means + offset, self.covariances)
        moved.__dict__.update(whiteners=self.whiteners, precisions=self.precisions)
        return moved

    def moments(self) -> tuple[Array, Array]:
        """Return the mean, shape (r,), and the covariance, shape (r, r), of the whole mixture."""
        mean = self.weights @ self.means
        deviations = self.means - mean
        within = np.einsum("k,kij->ij", self.weights, self.covariances)
        between = np.einsum("k,ki,kj->ij", self.weights, deviations, deviations)
        return mean, within + between

    def as_gaussian(self) -> "GaussianMixture":
        """Return the single Gaussian with the same mean and covariance (as a prior of probabilistic PCA)."""
        mean, covariance = self.moments()
        return GaussianMixture(np.ones(1), mean[None], covariance[None])


class PrecisionGaussian(GaussianMixture):
    """A mixture of one Gaussian, given by its precision; its other attributes are computed on demand."""

    def __init__(self, mean: Array, precision: Array) -> None:
        """Initialise from the ``mean``, shape (r,), and the positive definite ``precision``, shape (r, r)."""
        self.__dict__.update(weights=np.ones(1), means=mean[None], precisions=precision[None])

    @cached_property
    def whiteners(self) -> Array:
        """Upper triangular W with W^T W the precision, shape (1, r, r)."""
        return np.asarray(np.linalg.cholesky(self.precisions).transpose(0, 2, 1), dtype=np.float64)

    @cached_property
    def covariances(self) -> Array:
        """The inverse of the precision, shape (1, r, r)."""
        return np.asarray(np.linalg.inv(self.precisions), dtype=np.float64)

    def translated_by(self, offset: Array) -> "PrecisionGaussian":
        """Return the density of p + ``offset``, shape (r,)."""
        return PrecisionGaussian(self.means[0] + offset, self.precisions[0])
