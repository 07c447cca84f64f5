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
from scipy.linalg.blas import dtrsm

from faceposer.model.mixture import GaussianMixture, PrecisionGaussian

Array = NDArray[np.float64]
Singles = NDArray[np.float32]

_DRAWS = 4000
# Variance that every weight keeps, as a share of their mean second moment: no draw moves all of them.
_FAINT = 3e-3
# Energy, and share of the farthest examples, that keep sums above 0.
_TINY, _LEAST_SHARE = np.float32(1e-12), np.float32(1e-9)


@dataclass(frozen=True, eq=False)
class RigDensity:
    """A density over rig weights, and how these follow from the coefficients of a face.

    Attributes:
        mixture: Over W weights of shapes that move the face.
        directions: Weights per coefficient, shape (W, r).
        projection: Coefficients per weight, shape (r, W).
        limits: Least and greatest value of each weight, shape (W, 2); the same twice where there are none.
        shape_rows: Index of each weight's shape among the face's, shape (W,).
        regions: Name of the region of the face, or of the muscle, that each weight belongs to.
        coupling: Factors on what the weights tell of each other, a correlation matrix of shape (W, W).
        along: L, shape (W, W): what contracts along with each weight; a Gaussian over single muscles' weights with
            covariance C becomes one with L C L^T.
        largest: How far each weight's shape moves any place of the skin, in any unit, shape (W,).
        examples: Weights that stand for the mixture, shape (n, W); draws from it if None.
        usual: The ``coupling`` of a face that moves both sides as people usually do, a correlation matrix of shape
            (W, W); the coupling itself if None.
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

    @cached_property
    def draws(self) -> Array:
        """The examples, or draws from the mixture, always the same, their weights within the limits, shape (n, W)."""
        given = self.examples
        drawn = self.mixture.draws(_DRAWS, np.random.default_rng(0)) if given is None else given.copy()
        lower, upper = self.limits.T
        bounded = upper > lower
        drawn[:, bounded] = drawn[:, bounded].clip(lower[bounded], upper[bounded])
        return drawn

    def conditioned_on(self, start: Array, wholeness: float = 0.0) -> "LocalMoments":
        """Return how the density looks from the pose with coefficients ``start``, shape (r,); see ``LocalMoments``."""
        return LocalMoments(self, start, wholeness)


class LocalMoments:
    """A density of natural expressions as it looks from one pose, given constraints.

    The start pose is the peak of the density where nothing pulls, so that a face nobody touches stays as it is. The
    spread about it is the second moment of those examples that come nearest to the constraints, weighed as in locally
    weighted regression (Cleveland 1979; tricube of the root energy relative to that of the k-th nearest): with M the
    moment, F the coupling, L what contracts along and e a faint variance, the covariance of the rig weights is
    L G (F o M) G L^T + e I. It follows the targets without jumps. G is a diagonal of what each muscle has to do with
    the pull: with f the force of the constraints on a weight, s the length of its column in the rows of their
    derivatives and m how far its shape moves any place, (f + s |r|) / m relative to the largest tells muscles that are
    meant from those that only take the pulled place along.

    Covered c from 0 to 1 says that the constraints speak of much of the face (``faceposer.solve.coverage``), so that
    they need no guess which muscles they mean: F becomes F + c (F1 - F) with F1 the coupling of sides that move as
    usual, and G becomes G + c (1 - G).

    Wholeness s from 0 to 1 goes over to the expressions of the examples as they are: F becomes F + s (1 - F), G
    likewise, L becomes I + (1 - s) (L - I), and the peak moves by s g towards the mean of the nearest examples, where
    g = E / (2 (E + E0)) and E is the constraints' energy at the start, so that the peak stays where nothing pulls.

    Attributes:
        share: Of the examples that the constraints leave: small enough to be specific, large enough to be smooth.
        notable: E0: the energy of constraints that a hand's tremor makes.
        unmeant: Least value of G.
        specific: Values of that ratio from which on G rises, and where it is 1.
        moved: How far the peak moves towards the nearest examples' mean at a wholeness of 1.
    """

    share: ClassVar[float] = 1.0 / 6.0
    notable: ClassVar[float] = 8.0
    unmeant: ClassVar[float] = 0.6
    specific: ClassVar[tuple[float, float]] = (0.1, 0.4)
    moved: ClassVar[float] = 0.5

    def __init__(self, density: RigDensity, start: Array, wholeness: float = 0.0) -> None:
        """Look at ``density`` from the pose with coefficients ``start``, shape (r,).

        Args:
            density: Of natural expressions.
            start: The pose that an untouched face has.
            wholeness: From 0, muscles tell of each other as far as ``coupling`` allows, to 1, all that examples say.
        """
        self._directions = density.directions
        offsets = density.draws - density.directions @ start
        # Single precision is enough for sums over examples, to which a faint variance is added.
        self._offsets = offsets.astype(np.float32)
        self._coefficients = np.ascontiguousarray((offsets @ density.projection.T).T, dtype=np.float32)
        usual = density.coupling if density.usual is None else density.usual
        self._factors, self._usual_factors = (f + wholeness * (1.0 - f) for f in (density.coupling, usual))
        self._along = density.along + wholeness * (np.eye(len(density.along)) - density.along)
        self._wholeness = wholeness
        moments = np.mean(offsets * offsets, axis=0)
        self._faint = _FAINT * float(moments.mean()) + 1e-12
        self._start = start
        self._projection, self._largest = density.projection, density.largest

    def near(self, rows: Array, residual: Array, covered: float = 0.0) -> GaussianMixture:
        """Return one Gaussian, from the examples z where |``rows`` z + ``residual``|^2 is least.

        Args:
            rows: Derivatives of the constraints' residuals with respect to the coefficients at the start, each divided
                by its standard deviation, shape (m, r).
            residual: The residuals at the start, divided likewise, shape (m,).
            covered: How much of the face the constraints speak of, from 0 to 1.
        """
        offsets, shares = self.nearest(rows, residual)
        shift = None
        if self._wholeness > 0.0 and len(rows):
            energy = float(residual @ residual)
            share = self.moved * self._wholeness * energy / (energy + self.notable)
            shift = share * (shares @ offsets).astype(np.float64)
            offsets = offsets - shift.astype(np.float32)
        weighted = offsets * np.sqrt(shares)[:, None]
        moment = (weighted.T @ weighted).astype(np.float64)
        if len(rows):
            meant = self._meant(rows, residual, covered)
            moment *= meant * meant[:, None]
        return self.gaussian(moment, shift, covered)

    def usual(self) -> GaussianMixture:
        """Return one Gaussian, from all examples, with F1 for F and without G."""
        moment = (self._offsets.T @ self._offsets).astype(np.float64) / len(self._offsets)
        return self._damped(moment, self._usual_factors)

    def _meant(self, rows: Array, residual: Array, covered: float) -> Array:
        """Return the diagonal of G, shape (W,)."""
        by_weight = rows @ self._projection
        force, reach = np.abs(residual @ by_weight), np.sqrt(np.einsum("mw,mw->w", by_weight, by_weight))
        share = (force + reach * np.sqrt(residual @ residual)) / self._largest
        first, last = self.specific
        t = ((share / max(float(share.max()), 1e-12) - first) / (last - first)).clip(0.0, 1.0)
        least = 1.0 - (1.0 - self.unmeant) * (1.0 - self._wholeness) * (1.0 - covered)
        meant: Array = least + (1.0 - least) * t * t * (3.0 - 2.0 * t)
        return meant

    def nearest(self, rows: Array, residual: Array) -> tuple[Singles, Singles]:
        """Return the examples nearest to the constraints, less the start, (n, W), and their shares of 1, (n,).

        Both in single precision.
        """
        count = len(self._offsets)
        if not len(rows):
            return self._offsets, np.full(count, 1.0 / count, dtype=np.float32)
        off = rows.astype(np.float32) @ self._coefficients
        off += residual.astype(np.float32)[:, None]
        energies = np.einsum("mn,mn->n", off, off)
        k = max(1, min(int(self.share * count), count - 1))
        order = np.argpartition(energies, k)[:k]
        chosen = energies.take(order)
        relative = np.sqrt(chosen / np.maximum(chosen.max(), _TINY))
        shares = (1.0 - relative * relative * relative).clip(0.0, 1.0)
        shares = shares * shares * shares + _LEAST_SHARE
        return self._offsets.take(order, axis=0), shares / shares.sum()

    def gaussian(self, moment: Array, shift: Array | None = None, covered: float = 0.0) -> GaussianMixture:
        """Return the Gaussian over coefficients whose spread is the ``moment`` of the weights, (W, W), damped.

        Args:
            moment: About the mean.
            shift: Of the mean from the start, in the weights, shape (W,); none if None.
            covered: How much of the face the constraints speak of, from 0 to 1.
        """
        factors = self._factors + covered * (self._usual_factors - self._factors)
        return self._damped(moment, factors, shift)

    def _damped(self, moment: Array, factors: Array, shift: Array | None = None) -> GaussianMixture:
        """Return the Gaussian over coefficients for F, shape (W, W)."""
        damped = self._along @ (factors * moment) @ self._along.T
        damped.flat[:: len(damped) + 1] += self._faint
        root = np.linalg.cholesky(damped)
        # In the face's subspace a Gaussian over the weights is the Gaussian of what its coefficients reach. To BLAS,
        # which counts by columns, a matrix is its transpose: it finds X with X root^T = directions^T.
        whitened = dtrsm(1.0, root.T, self._directions.T, side=1).T
        precision = whitened.T @ whitened
        mean = self._start
        if shift is not None:
            mean = mean + np.linalg.solve(precision, whitened.T @ np.linalg.solve(root, shift))
        return PrecisionGaussian(mean, precision)
