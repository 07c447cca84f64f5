"""A morphable model of heads (Blanz and Vetter, "A morphable model for the synthesis of 3D faces", SIGGRAPH 1999).

With the mean S̄ and the orthonormal principal components s_i of m registered heads, with standard deviations d_i, a head
is (equation (1), whose coefficients are a_i = d_i b_i)

    S = S̄ + Σ_i d_i b_i s_i,      p(S) ∝ exp(-½ Σ_i b_i²)      (2).

Coefficients here are b, in standard deviations. What the K modes kept leave of the variance is taken as isotropic noise
of variance e², which makes it the probabilistic model of Tipping and Bishop ("Probabilistic principal component
analysis", J. R. Stat. Soc. B 61, 1999): x ~ N(S̄, Σ_i (d_i² - e²) s_i s_iᵀ + e² I).
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from faceposer.identity.segments import Segments
from faceposer.identity.template import HeadTemplate

Array = NDArray[np.float64]

# Share of the largest variance below which a component is rounding.
_LEAST_VARIANCE = 1e-12


@dataclass(frozen=True, eq=False)
class Projection:
    """A head in terms of the model.

    Attributes:
        coefficients: b in standard deviations, shape (K,).
        residual: Root mean square distance of the vertices used from those of the model's head.
    """

    coefficients: Array
    residual: float


class IdentityModel:
    """Heads of one topology: a mean, and modes in which people differ.

    The interface is that of scikit-learn's estimators, such as `sklearn.decomposition.PCA`, which is not imported.

    Attributes:
        mean: S̄, shape (3 C,).
        modes: s_i as rows, orthonormal, shape (K, 3 C).
        standard_deviations: d_i, descending, shape (K,).
        noise: e, the standard deviation of each coordinate that the modes leave.
        total_variance: Variance of the heads learned from, summed over coordinates.
        n_heads: Number of heads learned from.
        template: The topology that subdivides the C vertices to a skin, or None.
        segments: Segments with a partition of unity over the C vertices, or None.
        credits: Where the heads come from, and their licence.
    """

    mean: Array
    modes: Array
    standard_deviations: Array
    noise: float
    total_variance: float
    n_heads: int

    def __init__(
        self,
        n_modes: int | None = None,
        template: HeadTemplate | None = None,
        segments: Segments | None = None,
        credits: str = "",
    ) -> None:
        """Prepare a model of at most ``n_modes`` modes, of all if None."""
        self.n_modes = n_modes
        self.template = template
        self.segments = segments
        self.credits = credits

    def fit(self, heads: ArrayLike) -> Self:
        """Learn from registered ``heads``, shape (m, 3 C) or (m, C, 3), m > 1.

        The components are those of the Gram matrix of the centred heads, which has the size of their number.

        Raises:
            ValueError: If there are fewer than two heads, or a number is not finite.
        """
        given = np.asarray(heads, dtype=np.float64)
        rows = given.reshape(len(given), -1)
        if len(rows) < 2 or not np.isfinite(rows).all():
            raise ValueError("at least two heads are needed, of finite numbers")
        self.n_heads = len(rows)
        self.mean = rows.mean(axis=0)
        centred = rows - self.mean
        few = len(rows) <= centred.shape[1]
        gram = (centred @ centred.T if few else centred.T @ centred) / (len(rows) - 1)
        variances, vectors = np.linalg.eigh(gram)
        order = np.argsort(variances)[::-1]
        order = order[variances[order] > _LEAST_VARIANCE * max(float(variances[order[0]]), 0.0)]
        self.total_variance = float(variances[order].sum())
        kept = order[: self.n_modes]
        directions = vectors[:, kept].T @ centred if few else vectors[:, kept].T
        modes = directions / np.linalg.norm(directions, axis=1, keepdims=True)
        # The sign of a component is arbitrary: its largest coordinate is positive, on every machine.
        largest = np.abs(modes).argmax(axis=1)
        self.modes = modes * np.sign(modes[np.arange(len(modes)), largest])[:, None]
        self.standard_deviations = np.sqrt(variances[kept])
        left = self.total_variance - float(variances[kept].sum())
        self.noise = float(np.sqrt(max(left, 0.0) / max(len(self.mean) - len(kept), 1)))
        self.__dict__.pop("basis", None)
        self.__dict__.pop("skin_basis", None)
        return self

    @property
    def n_coefficients(self) -> int:
        """Number K of modes."""
        return len(self.standard_deviations)

    @cached_property
    def basis(self) -> Array:
        """B: offsets per standard deviation, shape (K, C, 3)."""
        return (self.standard_deviations[:, None] * self.modes).reshape(self.n_coefficients, -1, 3)

    @property
    def mean_vertices(self) -> Array:
        """The mean as positions, shape (C, 3)."""
        return self.mean.reshape(-1, 3)

    @cached_property
    def skin_basis(self) -> Array:
        """B on the skin, shape (K, N, 3); `basis` without a template."""
        if self.template is None:
            return self.basis
        return np.stack([self.template.skin(mode) for mode in self.basis])

    def vertices(self, coefficients: ArrayLike) -> Array:
        """Return the C vertices, shape (C, 3), of a head.

        Args:
            coefficients: b, shape (k,) with k ≤ K, or one row for each segment, shape (s, k).
        """
        given = np.asarray(coefficients, dtype=np.float64)
        if given.ndim == 2:
            if self.segments is None:
                raise ValueError("the model has no segments")
            offsets = np.tensordot(given, self.basis[: given.shape[1]], 1)
            return self.mean_vertices + self.segments.blend(offsets)
        offset: Array = np.tensordot(given, self.basis[: len(given)], 1)
        return self.mean_vertices + offset

    def instance(self, shape: ArrayLike) -> Array:
        """Return the skin, shape (N, 3), of a head with coefficients ``shape``, as in `vertices`."""
        control = self.vertices(shape)
        return control if self.template is None else self.template.skin(control)

    def sample(self, seed: int, n: int = 1) -> Array:
        """Return the coefficients of ``n`` random heads, shape (n, K), by the density (2)."""
        return np.random.default_rng(seed).standard_normal((n, self.n_coefficients))

    def log_prior(self, coefficients: ArrayLike) -> float:
        """Return the logarithm of (2), -½ ‖b‖², up to its constant; of segments the mean."""
        given = np.atleast_2d(np.asarray(coefficients, dtype=np.float64))
        return float(-0.5 * np.square(given).sum(axis=1).mean())

    def commonness(self, coefficients: ArrayLike) -> float:
        """Return the share of random heads that are farther from the mean, 0 to 1.

        ‖b‖² of heads drawn from (2) is distributed as χ² with K degrees of freedom.
        """
        # Imported late to shorten the start of the window.
        from scipy.special import gammaincc

        return float(gammaincc(0.5 * self.n_coefficients, -self.log_prior(coefficients)))

    def score_samples(self, heads: ArrayLike) -> Array:
        """Return the log density of ``heads``, (m, 3 C) or (m, C, 3), by the model with noise, shape (m,).

        With z = s_iᵀ (x - S̄), ln p = -½ (D ln 2π + Σ ln d_i² + (D - K) ln e² + Σ z_i²/d_i² + (‖x - S̄‖² - ‖z‖²)/e²).

        Raises:
            ValueError: If the modes explain the heads learned from completely, so that there is no density.
        """
        if self.noise <= 0.0:
            raise ValueError("the modes leave no variance, so that the model has no density")
        rows = np.asarray(heads, dtype=np.float64).reshape(-1, len(self.mean)) - self.mean
        along = rows @ self.modes.T
        left = np.maximum(np.square(rows).sum(axis=1) - np.square(along).sum(axis=1), 0.0)
        d, k = len(self.mean), self.n_coefficients
        constant = d * np.log(2.0 * np.pi) + 2.0 * np.log(self.standard_deviations).sum()
        constant += 2.0 * (d - k) * np.log(self.noise)
        near = np.square(along / self.standard_deviations).sum(axis=1)
        score: Array = -0.5 * (constant + near + left / self.noise**2)
        return score

    def score(self, heads: ArrayLike) -> float:
        """Return the mean of `score_samples`."""
        return float(self.score_samples(heads).mean())

    def project(
        self,
        vertices: ArrayLike,
        weights: ArrayLike | None = None,
        noise: float | None = None,
        n_modes: int | None = None,
    ) -> Projection:
        """Return the maximum a posteriori coefficients of a head that is registered and aligned.

        They minimise Σ_v w_v ‖x_v - S̄_v - (B b)_v‖² / noise² + ‖b‖², so that
        b = (B W Bᵀ / noise² + I)⁻¹ B W (x - S̄) / noise².

        Args:
            vertices: x, the C vertices or the N of the skin, shape (C, 3) or (N, 3).
            weights: w of each vertex, not negative, shape (C,) or (N,); all 1 if None. Vertices with 0 may be NaN.
            noise: Standard deviation of each coordinate of x; that of the model if None, 0 for least squares.
            n_modes: Number of leading modes to use; all if None.

        Raises:
            ValueError: If a shape does not match, or too few vertices have weight for least squares.
        """
        given = np.asarray(vertices, dtype=np.float64)
        basis, mean = self._basis_of(given)
        basis = basis[:n_modes]
        w = np.ones(len(given)) if weights is None else np.asarray(weights, dtype=np.float64)
        if w.shape != (len(given),) or (w < 0.0).any():
            raise ValueError(f"weights must be {len(given)} numbers that are not negative")
        used = np.flatnonzero(w)
        difference = (given[used] - mean[used]) * np.sqrt(w[used])[:, None]
        rows = (basis[:, used] * np.sqrt(w[used])[:, None]).reshape(len(basis), -1)
        sigma = self.noise if noise is None else noise
        gram, right = rows @ rows.T, rows @ difference.ravel()
        gram[np.diag_indices_from(gram)] += sigma**2
        if not np.isfinite(right).all():
            raise ValueError("vertices with weight must be finite")
        if sigma == 0.0 and np.linalg.matrix_rank(gram, hermitian=True) < len(gram):
            raise ValueError("too few vertices for least squares; give a noise")
        coefficients = np.linalg.solve(gram, right)
        left = difference.ravel() - coefficients @ rows
        residual = float(np.sqrt(np.square(left).sum() / max(w.sum(), 1e-300)))
        return Projection(np.concatenate([coefficients, np.zeros(self.n_coefficients - len(basis))]), residual)

    def project_segments(self, vertices: ArrayLike, noise: float | None = None, n_modes: int | None = None) -> Array:
        """Return coefficients of each segment, shape (s, K): `project` with the weights of its partition."""
        if self.segments is None:
            raise ValueError("the model has no segments")
        given = np.asarray(vertices, dtype=np.float64)
        weights = self.segments.weights
        if self.template is not None and len(given) == self.template.n_skin:
            weights = np.clip(self.template.skin(weights.T).T, 0.0, None)
        return np.stack([self.project(given, w, noise, n_modes).coefficients for w in weights])

    def compactness(self) -> Array:
        """Return the share of the total variance in the first 1, 2, ..., K modes, shape (K,)."""
        return np.cumsum(self.standard_deviations**2) / self.total_variance

    def generalization(
        self, heads: ArrayLike, counts: ArrayLike, noise: float | None = 0.0, counted: NDArray[np.bool_] | None = None
    ) -> Array:
        """Return the mean distance of vertices of ``heads``, not learned from, by number of modes.

        Args:
            heads: Registered heads, shape (m, C, 3) or (m, N, 3).
            counts: Numbers of modes, shape (n,).
            noise: As in `project`.
            counted: Mask of the vertices whose distances count; all if None.

        Returns:
            Mean distances in the unit of the model, shape (n,).
        """
        given = np.asarray(heads, dtype=np.float64)
        basis, mean = self._basis_of(given[0])
        errors = np.zeros((len(np.atleast_1d(counts)), len(given)))
        for row, count in enumerate(np.atleast_1d(counts).tolist()):
            for column, head in enumerate(given):
                found = self.project(head, noise=noise, n_modes=count).coefficients
                left = head - mean - np.tensordot(found, basis, 1)
                errors[row, column] = np.linalg.norm(left if counted is None else left[counted], axis=1).mean()
        return errors.mean(axis=1)

    def specificity(self, heads: ArrayLike, counts: ArrayLike, n_samples: int = 100, seed: int = 0) -> Array:
        """Return how far random heads of the model are from the nearest of ``heads``, by number of modes.

        Args:
            heads: Heads of people, shape (m, C, 3).
            counts: Numbers of modes, shape (n,).
            n_samples: Number of random heads.
            seed: Seed of their coefficients.

        Returns:
            Mean distances of vertices in the unit of the model, shape (n,) (Styner et al., "Evaluation of 3D
            correspondence methods for model building", IPMI 2003).
        """
        given = np.asarray(heads, dtype=np.float64)
        draws = self.sample(seed, n_samples)
        result = []
        for count in np.atleast_1d(counts).tolist():
            nearest = [np.linalg.norm(given - self.vertices(draw[:count]), axis=2).mean(axis=1).min() for draw in draws]
            result.append(float(np.mean(nearest)))
        return np.array(result)

    def _basis_of(self, vertices: Array) -> tuple[Array, Array]:
        """Return B and the mean for the C vertices or for those of the skin, whichever ``vertices``, (n, 3), are."""
        if vertices.shape == self.mean_vertices.shape:
            return self.basis, self.mean_vertices
        if self.template is not None and vertices.shape == (self.template.n_skin, 3):
            return self.skin_basis, self.template.skin(self.mean_vertices)
        raise ValueError(f"vertices of shape {vertices.shape} are not of this model")
