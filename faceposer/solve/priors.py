"""Priors on natural expressions, as terms of the problem (Lau et al. 2009, section 5)."""

from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from faceposer.model.face_model import FaceModel
from faceposer.model.local_moments import LocalMoments
from faceposer.model.mixture import GaussianMixture
from faceposer.sized_cache import weak_cache
from faceposer.solve.term import Array, PoseState, QuadraticTerm

#: Kind of prior: by region, of the whole face, or the mixture as it was learned, as in the paper.
Prior = Literal["regions", "whole", "plain"]
PRIORS: tuple[Prior, ...] = get_args(Prior)

# Standard deviation of a rig weight's excess over its limits, as a share of their distance.
_BOUND_SCALE = 0.05


class MixturePrior(QuadraticTerm):
    """weight * (-ln pr(p)) for a Gaussian mixture (paper, eqs. (19) and (31)), up to a constant.

    For a single Gaussian this is half of the squared Mahalanobis distance.
    """

    def __init__(self, mixture: GaussianMixture, weight: float = 1.0) -> None:
        """Weigh the energy of ``mixture`` by ``weight``, at least 0."""
        self.mixture = mixture
        self.weight = weight

    def value_and_gradient(self, state: PoseState) -> tuple[float, Array]:
        """Return the energy and its gradient with respect to the coefficients, shape (r,)."""
        if self.is_quadratic:
            offset = state.p - self.mixture.means[0]
            slope = self.weight * (self.mixture.precisions[0] @ offset)
            return 0.5 * float(offset @ slope), slope
        energy, gradient = self.mixture.energy_and_gradient(state.p)
        return self.weight * energy, self.weight * gradient

    def curvature(self, state: PoseState) -> Array:
        """Return the precision of the component with the largest responsibility for the pose, shape (r, r)."""
        if self.is_quadratic:
            return self.weight * self.mixture.precisions[0]
        return self.weight * self.mixture.curvature(state.p)

    @property
    def is_quadratic(self) -> bool:
        """True if the density is a single Gaussian."""
        return self.mixture.n_components == 1


class WeightBounds:
    """weight * sum over shapes of (excess_j / scale_j)^2, with the excess of each rig weight over its limits.

    A muscle cannot relax past its rest or contract past its end. A Gaussian centred at the start pose cannot express
    this, because it makes a movement and its opposite equally likely.
    """

    def __init__(self, directions: Array, limits: ArrayLike, weight: float = 1.0, start: Array | None = None) -> None:
        """Bound the rig weights ``directions @ p``, with ``directions`` of shape (S, r), by ``limits``, (S, 2).

        A shape with two equal limits is not bounded. Limits are widened to the weights of the pose ``start``, shape
        (r,), if one is given.
        """
        lower, upper = np.asarray(limits, dtype=np.float64).T
        bounded = upper > lower
        if not bounded.all():
            lower, upper, directions = lower[bounded], upper[bounded], directions[bounded]
        self._lower, self._upper, self._directions = lower, upper, directions
        self._scale = _BOUND_SCALE * (upper - lower)
        self._weight = weight
        if start is not None:
            # A captured pose may exceed the limits; it is kept as a start.
            weights = self._directions @ start
            self._lower, self._upper = np.minimum(self._lower, weights), np.maximum(self._upper, weights)

    def _excess(self, p: Array) -> Array:
        weights = self._directions @ p
        excess: Array = (weights - np.minimum(np.maximum(weights, self._lower), self._upper)) / self._scale
        return excess

    def crossings(self, p: Array, direction: Array) -> Array:
        """Return the step lengths in (0, 1) along ``direction``, (r,), at which weights from ``p`` meet a bound."""
        weights, change = self._directions @ p, self._directions @ direction
        change = np.where(change == 0.0, np.inf, change)
        shares = np.concatenate([(self._lower - weights) / change, (self._upper - weights) / change])
        crossings: Array = shares[(shares > 0.0) & (shares < 1.0)]
        return crossings

    def slopes_along(self, p: Array, direction: Array, shares: Array) -> Array:
        """Return the derivatives of the cost along ``direction``, (r,), at the step lengths ``shares`` from ``p``."""
        change = self._directions @ direction
        weights = self._directions @ p + shares[:, None] * change
        outside = weights - np.minimum(np.maximum(weights, self._lower), self._upper)
        slopes: Array = 2.0 * self._weight * (outside @ (change / (self._scale * self._scale)))
        return slopes

    def evaluate(self, p: Array) -> tuple[float, Array, NDArray[np.bool_], Array | float]:
        """Return the cost at ``p``, (r,), its gradient, (r,), the mask of exceeded bounds, and the curvature, (r, r).

        The curvature is the scalar 0 if no bound is exceeded.
        """
        excess = self._excess(p)
        exceeded = excess != 0.0
        if not exceeded.any():
            return 0.0, np.zeros_like(p), exceeded, 0.0
        active = self._directions[exceeded] / self._scale[exceeded, None]
        slope = 2.0 * self._weight * (excess[exceeded] @ active)
        return self._weight * float(excess @ excess), slope, exceeded, 2.0 * self._weight * active.T @ active

    def value_and_gradient(self, state: PoseState) -> tuple[float, Array]:
        """Return the cost and its gradient with respect to the coefficients, shape (r,)."""
        excess = self._excess(state.p)
        return self._weight * float(excess @ excess), 2.0 * self._weight * ((excess / self._scale) @ self._directions)

    def curvature(self, state: PoseState) -> Array:
        """Return the second derivative, shape (r, r), zero where no bound is exceeded."""
        stiffness = self.evaluate(state.p)[3]
        return np.zeros((len(state.p),) * 2) + stiffness


def prior_at(model: FaceModel, start: Array, prior: Prior = "regions", wholeness: float = 0.0) -> LocalMoments:
    """Return the model's density conditioned on the pose ``start``.

    The mode of a learned density is its performer's habitual face, not the user's start pose, so that minimising (20)
    unchanged would deform an untouched face. Here the start remains the mode, and the learned statistics describe the
    motion away from it. The result is cached, since the start does not change during a drag.

    Args:
        model: The face and its density.
        start: Coefficients of the start pose, shape (r,).
        prior: "regions" to damp the correlations between muscles, "whole" to keep them.
        wholeness: See ``LocalMoments``; "whole" means 1.
    """
    return _centred_at(model, start.tobytes(), 1.0 if prior == "whole" else wholeness)


@weak_cache(8)
def _centred_at(model: FaceModel, start_bytes: bytes, wholeness: float) -> LocalMoments:
    return model.rig_density.conditioned_on(np.frombuffer(start_bytes), wholeness)
