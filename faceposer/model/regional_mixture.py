"""A prior that faces each region of the face separately, and couples the regions by one Gaussian.

One mixture over all of the face ties what its regions do together by the index of a component: once a drag of the brow
has made out the component, the mouth follows. Segments (Blanz and Vetter 1999, section 3) cut that tie, and lose what
regions do have to do with each other. Here every region has a mixture of its own, each free to choose its component,
and only second moments run between regions, as far as they are to be believed.
"""

import copy
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from faceposer.model.mixture import GaussianMixture

Array = NDArray[np.float64]

# Least eigenvalue of the correlation between regions that counts: rounding may leave less, or none.
_LEAST = 1e-3


class Density(Protocol):
    """A density of natural expressions over the coefficients, as the solver needs it."""

    @property
    def means(self) -> Array:
        """Where the components that compete for the start of a solve have their peaks, shape (K, r)."""
        ...

    @property
    def precisions(self) -> Array:
        """Inverse covariances of these, shape (K, r, r)."""
        ...

    def energy_and_gradient(self, p: Array) -> tuple[float, Array]:
        """Return -ln pr(p), up to a constant, and its gradient, shape (r,), at ``p`` of shape (r,)."""
        ...

    def curvature(self, p: Array) -> Array:
        """Return a positive definite estimate of the energy's second derivative at ``p``, shape (r, r)."""
        ...

    def moved_by(self, offset: Array) -> "Density":
        """Return the density of p + ``offset``, shape (r,)."""
        ...


@dataclass(frozen=True, eq=False)
class RigDensity:
    """A density over rig weights, and how these follow from the coefficients of a face.

    Attributes:
        mixture: Over W weights of shapes that move the face.
        directions: Weights per coefficient, shape (W, r).
        regions: Name of the region of the face that each weight belongs to.
        coupling: Factors on what the weights of different regions tell of each other, a correlation matrix of shape
            (W, W); within a region nothing is damped.
    """

    mixture: GaussianMixture
    directions: Array
    regions: tuple[str, ...]
    coupling: Array


class RegionalMixture:
    """Mixtures over the regions of a face, seen from one pose, and the Gaussian that couples them.

    Let z_g be the rig weights of region g relative to the start, D_g their second moment and R the correlation of the
    regions' whitened weights, with the blocks between regions damped by the coupling. The energy is

        E(z) = lambda sum_g -ln mix_g(z_g) + 1/2 z^T D^-1/2 (R^-1 - lambda I) D^-1/2 z,   lambda = 1 / max eig R.

    With a single component per region it is the coupled Gaussian, exactly. The second term is positive semi-definite by
    the choice of lambda and every -ln mix_g rises from the start outwards, so the start is the only minimum.
    """

    def __init__(self, density: RigDensity, start: Array) -> None:
        """Look at ``density`` from the pose with coefficients ``start``, shape (r,), region by region."""
        mixture, directions = density.mixture, density.directions
        groups = [np.flatnonzero(np.array(density.regions) == name) for name in dict.fromkeys(density.regions)]
        sizes = [len(group) for group in groups]
        self._first_rows = np.cumsum([0, *sizes[:-1]])
        self._region_of_row = np.repeat(np.arange(len(groups)), sizes)
        spread = mixture.spread_about(directions @ start)

        whiteners, peaks = [], []
        for group in groups:
            lower = np.linalg.cholesky(spread[:, group[:, None], group])
            log_roots = np.log(np.einsum("kii->ki", lower)).sum(axis=1)
            # All have their peak at the start, and the narrowest would outweigh the others there and hold the region
            # still until it snaps. The peaks therefore enter by the root of their height.
            peak = 0.5 * np.log(mixture.weights) - 0.5 * log_roots
            peaks.append(peak - np.log(np.exp(peak - peak.max()).sum()) - peak.max())
            whiteners.append(np.linalg.inv(lower) @ directions[group])
        self._peaks = np.stack(peaks, axis=1)
        self._whiteners = np.concatenate(whiteners, axis=1)
        self._stacked = np.ascontiguousarray(self._whiteners.reshape(-1, len(start)))
        self._start = start

        order = np.concatenate(groups)
        same = self._region_of_row[:, None] == self._region_of_row
        moment = np.einsum("k,kij->ij", mixture.weights, spread)[np.ix_(order, order)]
        damped = np.where(same, moment, moment * density.coupling[np.ix_(order, order)])
        precision, self._share = _between_regions(damped, same)
        self._between = directions[order].T @ precision @ directions[order]

    @property
    def n_components(self) -> int:
        """The number of components K of each region."""
        return len(self._peaks)

    @cached_property
    def means(self) -> Array:
        """The start once per component, shape (K, r)."""
        return np.broadcast_to(self._start, (self.n_components, len(self._start))).copy()

    @cached_property
    def precisions(self) -> Array:
        """Inverse covariances where all regions choose the same component, shape (K, r, r)."""
        return self._share * (self._whiteners.transpose(0, 2, 1) @ self._whiteners) + self._between

    def _shares(self, p: Array) -> tuple[Array, Array, Array]:
        """Return whitened deviations, (K, rows), and per region the components' posterior, (K, G), and energy, (G,)."""
        deviations = (self._stacked @ (p - self._start)).reshape(self.n_components, -1)
        log_joint = self._peaks - 0.5 * np.add.reduceat(deviations * deviations, self._first_rows, axis=1)
        top = log_joint.max(axis=0)
        shares = np.exp(log_joint - top)
        total = shares.sum(axis=0)
        return deviations, shares / total, -(top + np.log(total))

    def energy_and_gradient(self, p: Array) -> tuple[float, Array]:
        """Return the energy, 0 at the start, and its gradient, shape (r,), at ``p`` of shape (r,)."""
        deviations, shares, energies = self._shares(p)
        slope = self._between @ (p - self._start)
        gradient = (deviations * shares[:, self._region_of_row]).ravel() @ self._stacked
        energy = self._share * energies.sum() + 0.5 * slope @ (p - self._start)
        return float(energy), self._share * gradient + slope

    def curvature(self, p: Array) -> Array:
        """Return the precision of the components that most likely made each region's pose, shape (r, r)."""
        chosen = self._shares(p)[1].argmax(axis=0)
        rows = self._whiteners[chosen[self._region_of_row], np.arange(len(self._region_of_row))]
        product: Array = self._share * rows.T @ rows + self._between
        return product

    def moved_by(self, offset: Array) -> "RegionalMixture":
        """Return the density of p + ``offset``, shape (r,), without factoring anything again."""
        moved = copy.copy(self)
        moved.__dict__.pop("means", None)
        moved._start = self._start + offset
        return moved


def _between_regions(moment: Array, same: NDArray[np.bool_]) -> tuple[Array, float]:
    """Return D^-1/2 (R^-1 - lambda I) D^-1/2, shape (rows, rows), and lambda, for a ``moment`` with blocks ``same``."""
    variances, axes = np.linalg.eigh(np.where(same, moment, 0.0))
    whitener = (axes / np.sqrt(variances)) @ axes.T
    correlations, axes = np.linalg.eigh(whitener @ moment @ whitener)
    inverse = 1.0 / np.maximum(correlations, _LEAST)
    half = whitener @ axes
    return (half * (inverse - inverse[-1])) @ half.T, float(inverse[-1])
