"""Where faces like those asked for usually go: second moments of the prior about a pose, near to the constraints.

A mixture of factor analyzers knows which expressions there are. What an artist asks for picks some of them, and how
these lie about the pose that is edited says in which directions it should move. One mixture over all of the face also
holds its performer's coincidences; what regions tell of each other is therefore damped (covariance tapering).
"""

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from faceposer.model.mixture import GaussianMixture

Array = NDArray[np.float64]

_DRAWS = 4000
# Variance that every weight keeps, as a share of their mean second moment: no draw moves all of them.
_FAINT = 3e-3


@dataclass(frozen=True, eq=False)
class RigDensity:
    """A density over rig weights, and how these follow from the coefficients of a face.

    Attributes:
        mixture: Over W weights of shapes that move the face.
        directions: Weights per coefficient, shape (W, r).
        projection: Coefficients per weight, shape (r, W).
        limits: Least and greatest value of each weight, shape (W, 2); the same twice where there are none.
        regions: Name of the region of the face that each weight belongs to.
        coupling: Factors on what the weights of different regions tell of each other, a correlation matrix of shape
            (W, W); within a region nothing is damped.
    """

    mixture: GaussianMixture
    directions: Array
    projection: Array
    limits: Array
    regions: tuple[str, ...]
    coupling: Array

    @cached_property
    def draws(self) -> Array:
        """Expressions drawn from the mixture, always the same, their weights within the limits, shape (n, W)."""
        rng = np.random.default_rng(0)
        drawn = self.mixture.draws(_DRAWS, rng)
        lower, upper = self.limits.T
        bounded = upper > lower
        drawn[:, bounded] = drawn[:, bounded].clip(lower[bounded], upper[bounded])
        return drawn

    def seen_from(self, start: Array, whole: bool = False) -> "LocalMoments":
        """Return how the density looks from the pose with coefficients ``start``, shape (r,); see ``LocalMoments``."""
        return LocalMoments(self, start, whole)


class LocalMoments:
    """A density of natural expressions as it looks from one pose, in the light of constraints.

    The start pose is the peak of every density that this returns, so that a face nobody pulls stays as it is. The
    spread about it is the second moment of those draws from the mixture that come nearest to the constraints, weighed
    as in locally weighted regression (Cleveland 1979; tricube of the root energy relative to that of the k-th
    nearest). It follows the targets without jumps.

    Attributes:
        share: Of the draws that the constraints leave: small enough to be specific, large enough to be smooth.
    """

    share: ClassVar[float] = 1.0 / 6.0

    def __init__(self, density: RigDensity, start: Array, whole: bool = False) -> None:
        """Look at ``density`` from the pose with coefficients ``start``, shape (r,).

        Args:
            density: Of natural expressions.
            start: The pose that an untouched face has.
            whole: Whether regions tell of each other all that the mixture says, or only as far as ``coupling`` allows.
        """
        self._directions = density.directions
        self._offsets = density.draws - density.directions @ start
        self._coefficients = np.ascontiguousarray(self._offsets @ density.projection.T, dtype=np.float32)
        self._factors = np.ones_like(density.coupling) if whole else density.coupling
        moments = np.mean(self._offsets * self._offsets, axis=0)
        self._faint = _FAINT * float(moments.mean()) + 1e-12
        self._start = start

    def near(self, rows: Array, residual: Array) -> GaussianMixture:
        """Return one Gaussian about the start, from the draws z where |``rows`` z + ``residual``|^2 is least.

        Args:
            rows: Derivatives of the constraints' residuals by the coefficients at the start, each divided by its
                standard deviation, shape (m, r).
            residual: The residuals at the start, divided likewise, shape (m,).
        """
        offsets, shares = self.nearest(rows, residual)
        weighted = offsets * np.sqrt(shares)[:, None]
        return self.gaussian(weighted.T @ weighted)

    def nearest(self, rows: Array, residual: Array) -> tuple[Array, Array]:
        """Return the draws nearest to the constraints, less the start, (n, W), and their shares of 1, (n,)."""
        if not len(rows):
            return self._offsets, np.full(len(self._offsets), 1.0 / len(self._offsets))
        off = self._coefficients @ rows.T.astype(np.float32)
        off += residual.astype(np.float32)
        energies = np.einsum("nm,nm->n", off, off).astype(np.float64)
        k = min(int(self.share * len(energies)), len(energies) - 1)
        order = np.argpartition(energies, k)[:k]
        relative = np.sqrt(energies[order] / max(float(energies[order].max()), 1e-12))
        shares = (1.0 - np.minimum(relative, 1.0) ** 3) ** 3 + 1e-9
        return self._offsets[order], shares / shares.sum()

    def gaussian(self, moment: Array, shift: Array | None = None) -> GaussianMixture:
        """Return the Gaussian over coefficients whose spread is the ``moment`` of the weights, (W, W), damped.

        Args:
            moment: About the mean.
            shift: Of the mean from the start, in the weights, shape (W,); none if None.
        """
        damped = self._factors * moment
        damped[np.diag_indices_from(damped)] += self._faint
        root = np.linalg.cholesky(damped)
        # In the face's subspace a Gaussian over the weights is the Gaussian of what its coefficients reach.
        whitened = np.linalg.solve(root, self._directions)
        precision = whitened.T @ whitened
        mean = self._start
        if shift is not None:
            mean = mean + np.linalg.solve(precision, whitened.T @ np.linalg.solve(root, shift))
        return GaussianMixture.from_precision(mean, np.linalg.cholesky(precision))
