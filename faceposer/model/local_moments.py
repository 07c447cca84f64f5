"""Local second moments of the prior about a pose, from the examples nearest to the constraints.

A mixture of factor analyzers models all natural expressions. Constraints select some of them, and the spread of these
about the edited pose determines the directions in which it should move. A mixture over the whole face also contains
coincidences of its performer; covariances between regions are therefore damped (covariance tapering).
"""

from copy import copy
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.blas import dtrsm

from faceposer.model.mixture import GaussianMixture, PrecisionGaussian

Array = NDArray[np.float64]
Singles = NDArray[np.float32]

_DRAWS = 4000
# Least variance of each weight, as a share of the mean second moment, since no draw moves all of them.
_LEAST_VARIANCE = 3e-3
# Least energy and least share of an example, which keep sums above 0.
_TINY, _LEAST_SHARE = np.float32(1e-12), np.float32(1e-9)


@dataclass(frozen=True, eq=False)
class RigDensity:
    """A density over rig weights, and the linear maps between these and the coefficients of a face.

    Attributes:
        mixture: Density over the W weights of shapes that move the face.
        directions: Weights per coefficient, shape (W, r).
        projection: Coefficients per weight, shape (r, W).
        limits: Least and greatest value of each weight, shape (W, 2); equal values mean no limit.
        shape_rows: Index of each weight's shape among the character's, shape (W,).
        regions: Name of the region of the face, or of the muscle, of each weight.
        coupling: Factors on the covariances of weights, a correlation matrix of shape (W, W).
        along: Matrix L of co-contraction, shape (W, W): a Gaussian over the weights of single muscles with covariance C
            becomes one with covariance L C L^T.
        largest: Largest displacement of any vertex by each weight's shape, in any unit, shape (W,).
        examples: Weights that represent the mixture, shape (n, W); draws from it if None.
        usual: The ``coupling`` of a face whose sides move together as they usually do, a correlation matrix of shape
            (W, W); ``coupling`` itself if None.
        mirror: Index of each weight's mirror image, shape (W,); unknown if None.
    """

    mixture: GaussianMixture
    directions: Array
    projection: Array
    limits: Array
    shape_rows: NDArray[np.intp]
    regions: tuple[str, ...]
    coupling: Array
    along: Array
    largest: Array
    examples: Array | None = None
    usual: Array | None = None
    mirror: NDArray[np.intp] | None = None

    @cached_property
    def draws(self) -> Array:
        """The examples, or reproducible draws from the mixture, clipped to the limits, shape (n, W)."""
        given = self.examples
        drawn = self.mixture.draws(_DRAWS, np.random.default_rng(0)) if given is None else given.copy()
        lower, upper = self.limits.T
        bounded = upper > lower
        drawn[:, bounded] = drawn[:, bounded].clip(lower[bounded], upper[bounded])
        return drawn

    def conditioned_on(self, start: Array, wholeness: float = 0.0) -> "LocalMoments":
        """Return the local moments about the pose with coefficients ``start``, shape (r,); see ``LocalMoments``."""
        return LocalMoments(self, start, wholeness)


class LocalMoments:
    """A density of natural expressions about one pose, conditioned on constraints.

    Without constraints that pull, the start pose is the peak of the density, so that an untouched face does not change.
    The spread about it is the second moment of the examples nearest to the constraints, weighted as in locally weighted
    regression (Cleveland 1979; tricube of the root energy relative to that of the k-th nearest): with M the moment, F
    the coupling, L the co-contraction and e a small variance, the covariance of the rig weights is
    L G (F o M) G L^T + e I. It follows the targets continuously. The diagonal matrix G is the relevance of each muscle:
    with f the force of the constraints on a weight, s the norm of its column in the constraints' Jacobian, r the
    residual and m the largest displacement by its shape, the ratio (f + s |r|) / m relative to its maximum separates
    the muscles that are meant from those that merely move the constrained place along.

    A coverage c from 0 to 1 states that the constraints determine much of the face (``faceposer.solve.coverage``), so
    that the relevant muscles need not be guessed: F becomes F + c (F1 - F) with F1 the coupling of sides that move
    together as usual, and G becomes G + c (1 - G).

    The nearest of a finite number of examples are not the same on both sides. Where the forces on the weights are
    mirror images of each other, M is replaced by its mean with its mirror image P M P; with a the norm of their
    differences relative to that of the forces, by a share that falls smoothly from 1 to 0 between two values of a.

    A wholeness s from 0 to 1 blends towards the unmodified expressions of the examples: F becomes F + s (1 - F), G
    likewise, L becomes I + (1 - s) (L - I), the share of P M P is multiplied by 1 - s, and the peak moves by s g
    towards the mean of the nearest examples, where g = E / (2 (E + E0)) and E is the constraints' energy at the start,
    so that it does not move if nothing pulls.

    Attributes:
        start: The pose about which the moments are, shape (r,).
        share: Share of the examples that is used: small enough to be specific, large enough to be smooth.
        noise_energy: E0, the energy of constraints caused by the tremor of a hand.
        least_relevance: Least value of G.
        relevance_range: Values of the ratio at which G begins to rise and at which it reaches 1.
        asymmetry_range: Values of a between which P M P counts less and less.
        peak_shift: Shift of the peak towards the mean of the nearest examples at a wholeness of 1 and large energy.
    """

    share: ClassVar[float] = 1.0 / 6.0
    noise_energy: ClassVar[float] = 8.0
    least_relevance: ClassVar[float] = 0.6
    relevance_range: ClassVar[tuple[float, float]] = (0.1, 0.4)
    peak_shift: ClassVar[float] = 0.5
    asymmetry_range: ClassVar[tuple[float, float]] = (0.1, 0.4)

    def __init__(self, density: RigDensity, start: Array, wholeness: float = 0.0) -> None:
        """Prepare the moments of ``density`` about the pose with coefficients ``start``.

        Args:
            density: Density of natural expressions.
            start: Coefficients of the pose without constraints, shape (r,).
            wholeness: From 0, covariances damped by ``coupling``, to 1, those of the examples.
        """
        self._directions = density.directions
        offsets = density.draws - density.directions @ start
        # Single precision suffices for sums over examples, to which a small variance is added.
        self._offsets = offsets.astype(np.float32)
        self._coefficients = np.ascontiguousarray((offsets @ density.projection.T).T, dtype=np.float32)
        usual = density.coupling if density.usual is None else density.usual
        self._factors, self._usual_factors = (f + wholeness * (1.0 - f) for f in (density.coupling, usual))
        self._along = density.along + wholeness * (np.eye(len(density.along)) - density.along)
        self._wholeness = wholeness
        self._mean, self._second_moment = offsets.mean(axis=0), float(np.mean(offsets * offsets))
        self._least_variance = _LEAST_VARIANCE * self._second_moment + 1e-12
        self.start, self._mirror = start, density.mirror
        self._projection, self._largest = density.projection, density.largest

    def about(self, start: Array) -> "LocalMoments":
        """Return the moments about another pose ``start``, shape (r,), in a fraction of the time."""
        moved = copy(self)
        change = self._directions @ (start - self.start)
        moved.start, moved._mean = start, self._mean - change
        moved._second_moment = self._second_moment + float(np.mean(change * (change - 2.0 * self._mean)))
        moved._least_variance = _LEAST_VARIANCE * moved._second_moment + 1e-12
        moved._offsets = self._offsets - change.astype(np.float32)
        moved._coefficients = self._coefficients - (self._projection @ change).astype(np.float32)[:, None]
        return moved

    def near(self, rows: Array, residual: Array, covered: float = 0.0) -> GaussianMixture:
        """Return one Gaussian, from the examples z with the least |``rows`` z + ``residual``|^2.

        Args:
            rows: Jacobian of the constraints' residuals at the start, each row divided by the standard deviation of its
                residual, shape (m, r).
            residual: Residuals at the start, divided likewise, shape (m,).
            covered: Coverage of the face by the constraints, from 0 to 1.
        """
        offsets, shares = self.nearest(rows, residual)
        shift = None
        if self._wholeness > 0.0 and len(rows):
            energy = float(residual @ residual)
            share = self.peak_shift * self._wholeness * energy / (energy + self.noise_energy)
            shift = share * (shares @ offsets).astype(np.float64)
            offsets = offsets - shift.astype(np.float32)
        weighted = offsets * np.sqrt(shares)[:, None]
        moment = (weighted.T @ weighted).astype(np.float64)
        if len(rows):
            relevance = self._relevance(rows, residual, covered)
            moment *= relevance * relevance[:, None]
            if self._mirror is not None:
                image = moment[self._mirror[:, None], self._mirror]
                moment += 0.5 * self._symmetry(rows, residual, self._mirror) * (image - moment)
        return self.gaussian(moment, shift, covered)

    def usual(self) -> GaussianMixture:
        """Return one Gaussian from all examples, with F1 for F and without G."""
        moment = (self._offsets.T @ self._offsets).astype(np.float64) / len(self._offsets)
        return self._damped(moment, self._usual_factors)

    def _relevance(self, rows: Array, residual: Array, covered: float) -> Array:
        """Return the diagonal of G, shape (W,)."""
        by_weight = rows @ self._projection
        first, last = self.relevance_range
        t = ((attribution(by_weight, residual, self._largest) - first) / (last - first)).clip(0.0, 1.0)
        least = 1.0 - (1.0 - self.least_relevance) * (1.0 - self._wholeness) * (1.0 - covered)
        relevance: Array = least + (1.0 - least) * t * t * (3.0 - 2.0 * t)
        return relevance

    def _symmetry(self, rows: Array, residual: Array, mirror: NDArray[np.intp]) -> float:
        """Return the share from 0 to 1 by which the constraints ask for the same on both sides."""
        force = (residual @ (rows @ self._projection)) / self._largest
        asymmetry = float(np.linalg.norm(force - force[mirror])) / max(float(np.linalg.norm(force)), 1e-12)
        least, most = self.asymmetry_range
        t = min(max((most - asymmetry) / (most - least), 0.0), 1.0)
        return (1.0 - self._wholeness) * t * t * (3.0 - 2.0 * t)

    def nearest(self, rows: Array, residual: Array) -> tuple[Singles, Singles]:
        """Return the examples nearest to the constraints, relative to the start, (n, W), and their weights, (n,).

        The weights sum to 1; both arrays are in single precision.
        """
        count = len(self._offsets)
        if not len(rows):
            return self._offsets, np.full(count, 1.0 / count, dtype=np.float32)
        residuals = rows.astype(np.float32) @ self._coefficients
        residuals += residual.astype(np.float32)[:, None]
        energies = np.einsum("mn,mn->n", residuals, residuals)
        k = max(1, min(int(self.share * count), count - 1))
        order = np.argpartition(energies, k)[:k]
        chosen = energies.take(order)
        relative = np.sqrt(chosen / np.maximum(chosen.max(), _TINY))
        shares = (1.0 - relative * relative * relative).clip(0.0, 1.0)
        shares = shares * shares * shares + _LEAST_SHARE
        return self._offsets.take(order, axis=0), shares / shares.sum()

    def gaussian(self, moment: Array, shift: Array | None = None, covered: float = 0.0) -> GaussianMixture:
        """Return the Gaussian over coefficients with the damped ``moment`` of the weights as its covariance.

        Args:
            moment: Second moment of the weights about the mean, shape (W, W).
            shift: Shift of the mean from the start, in weights, shape (W,); none if None.
            covered: Coverage of the face by the constraints, from 0 to 1.
        """
        factors = self._factors + covered * (self._usual_factors - self._factors)
        return self._damped(moment, factors, shift)

    def _damped(self, moment: Array, factors: Array, shift: Array | None = None) -> GaussianMixture:
        """Return the Gaussian over coefficients with ``factors`` as F, shape (W, W)."""
        damped = self._along @ (factors * moment) @ self._along.T
        damped.flat[:: len(damped) + 1] += self._least_variance
        root = np.linalg.cholesky(damped)
        # The Gaussian over the weights is restricted to the subspace. BLAS is column-major, so that it sees transposes:
        # it solves X root^T = directions^T.
        whitened = dtrsm(1.0, root.T, self._directions.T, side=1).T
        precision = whitened.T @ whitened
        mean = self.start
        if shift is not None:
            mean = mean + np.linalg.solve(precision, whitened.T @ np.linalg.solve(root, shift))
        return PrecisionGaussian(mean, precision)


def attribution(by_weight: Array, residual: Array, largest: Array) -> Array:
    """Return to what extent constraints mean each weight, relative to the weight that they mean most, shape (W,).

    Args:
        by_weight: Jacobian of the constraints' residuals with respect to the weights, shape (m, W).
        residual: The residuals, shape (m,).
        largest: Largest displacement of any vertex by each weight's shape, shape (W,).
    """
    force, reach = np.abs(residual @ by_weight), np.sqrt(np.einsum("mw,mw->w", by_weight, by_weight))
    share: Array = (force + reach * np.sqrt(residual @ residual)) / largest
    return share / max(float(share.max()), 1e-12)
