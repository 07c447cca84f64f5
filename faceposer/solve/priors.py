"""Priors of natural expressions, as terms of the problem (Lau et al. 2009, section 5)."""

from functools import lru_cache
from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from faceposer.model.face_model import FaceModel
from faceposer.model.local_moments import LocalMoments
from faceposer.model.mixture import GaussianMixture
from faceposer.solve.term import Array, PoseState, QuadraticTerm, ResidualTerm

#: How a face is judged: region by region, as a whole, or by the mixture as it was learned, as the paper does.
Prior = Literal["regions", "whole", "plain"]
PRIORS: tuple[Prior, ...] = get_args(Prior)

# How far outside its limits a rig weight may stray, as a standard deviation and a share of their distance.
_BOUND_SCALE = 0.05
# How far apart the eyes may look, in radians, as a standard deviation: about a quarter of a degree.
_GAZE_SIGMA = 0.005


class MixturePrior(QuadraticTerm):
    """weight * (-ln pr(p)) for a density made of Gaussians (paper, eqs. (19) and (31)), up to a constant.

    Of a single Gaussian it is half of the squared Mahalanobis distance.
    """

    def __init__(self, mixture: GaussianMixture, weight: float = 1.0) -> None:
        """Weigh the energy of ``mixture`` by ``weight``, at least 0."""
        self.mixture = mixture
        self.weight = weight

    def value_and_gradient(self, state: PoseState) -> tuple[float, Array]:
        """Return the energy and its gradient by the coefficients, shape (r,)."""
        if self.is_quadratic:
            offset = state.p - self.mixture.means[0]
            slope = self.weight * (self.mixture.precisions[0] @ offset)
            return 0.5 * float(offset @ slope), slope
        energy, gradient = self.mixture.energy_and_gradient(state.p)
        return self.weight * energy, self.weight * gradient

    def curvature(self, state: PoseState) -> Array:
        """Return the precision of the components that most likely made the pose, shape (r, r)."""
        if self.is_quadratic:
            return self.weight * self.mixture.precisions[0]
        return self.weight * self.mixture.curvature(state.p)

    @property
    def is_quadratic(self) -> bool:
        """Whether the density is a single Gaussian."""
        return self.mixture.n_components == 1


class WeightBounds:
    """weight * sum over shapes of (excess_j / scale_j)^2, the excess being how far a rig weight is beyond its limits.

    A muscle that relaxes past its rest or pulls past its end is as unnatural as anything the mixture forbids, and no
    mixture of Gaussians can say so: seen from the start pose it takes a movement and its opposite for equally likely.
    """

    def __init__(self, directions: Array, limits: ArrayLike, weight: float = 1.0, start: Array | None = None) -> None:
        """Keep the rig weights ``directions @ p``, ``directions`` being (S, r), within ``limits`` of shape (S, 2).

        Where the two limits of a shape are the same, nothing is bounded. Limits are widened to the weights of the pose
        ``start``, shape (r,), if that is given.
        """
        lower, upper = np.asarray(limits, dtype=np.float64).T
        bounded = upper > lower
        if not bounded.all():
            lower, upper, directions = lower[bounded], upper[bounded], directions[bounded]
        self._lower, self._upper, self._directions = lower, upper, directions
        self._scale = _BOUND_SCALE * (upper - lower)
        self._weight = weight
        if start is not None:
            # A captured pose that leaves the limits is a pose all the same: as a start it stays as it is.
            weights = self._directions @ start
            self._lower, self._upper = np.minimum(self._lower, weights), np.maximum(self._upper, weights)

    def _excess(self, p: Array) -> Array:
        weights = self._directions @ p
        excess: Array = (weights - np.minimum(np.maximum(weights, self._lower), self._upper)) / self._scale
        return excess

    def crossings(self, p: Array, way: Array) -> Array:
        """Return at which shares between 0 and 1 of a ``way``, (r,), from ``p``, (r,), weights are at a bound."""
        weights, change = self._directions @ p, self._directions @ way
        change = np.where(change == 0.0, np.inf, change)
        shares = np.concatenate([(self._lower - weights) / change, (self._upper - weights) / change])
        crossings: Array = shares[(shares > 0.0) & (shares < 1.0)]
        return crossings

    def slopes_along(self, p: Array, way: Array, shares: Array) -> Array:
        """Return the derivatives of the cost by the share of a ``way``, (r,), from ``p``, (r,), at ``shares``, (n,)."""
        change = self._directions @ way
        weights = self._directions @ p + shares[:, None] * change
        outside = weights - np.minimum(np.maximum(weights, self._lower), self._upper)
        slopes: Array = 2.0 * self._weight * (outside @ (change / (self._scale * self._scale)))
        return slopes

    def at(self, p: Array) -> tuple[float, Array, NDArray[np.bool_], Array | float]:
        """Return the cost at ``p``, (r,), its gradient, (r,), which bounds are exceeded, and the curvature, (r, r).

        The curvature is 0 where no bound is exceeded.
        """
        excess = self._excess(p)
        exceeded = excess != 0.0
        if not exceeded.any():
            return 0.0, np.zeros_like(p), exceeded, 0.0
        active = self._directions[exceeded] / self._scale[exceeded, None]
        slope = 2.0 * self._weight * (excess[exceeded] @ active)
        return self._weight * float(excess @ excess), slope, exceeded, 2.0 * self._weight * active.T @ active

    def value_and_gradient(self, state: PoseState) -> tuple[float, Array]:
        """Return the cost and its gradient by the coefficients, shape (r,)."""
        excess = self._excess(state.p)
        return self._weight * float(excess @ excess), 2.0 * self._weight * ((excess / self._scale) @ self._directions)

    def curvature(self, state: PoseState) -> Array:
        """Return the second derivative where the bounds are exceeded, shape (r, r)."""
        stiffness = self.at(state.p)[3]
        return np.zeros((len(state.p),) * 2) + stiffness


class ParallelGaze(ResidualTerm, QuadraticTerm):
    """w / sigma^2 |A (p - p0)|^2, A p being how far the eyes look apart, in radians: up or down, and across.

    Eyes look at one place. The capture measures each eye by itself, and its noise would make a face squint.
    """

    def __init__(self, apart: Array, start: Array, weight: float = 1.0) -> None:
        """Keep ``apart @ p`` as it is at the pose ``start``, shape (r,), for what `gaze_differences` returns."""
        super().__init__(np.full(len(apart), weight / _GAZE_SIGMA**2))
        self._apart = apart
        self._wanted = apart @ start

    def residual(self, state: PoseState) -> Array:
        """Return the change of both differences, shape (2,)."""
        residual: Array = self._apart @ state.p - self._wanted
        return residual

    def jacobian(self, state: PoseState) -> Array:
        """Return the derivatives, shape (2, r)."""
        return self._apart


def gaze_differences(model: FaceModel) -> Array:
    """Return A, (2, r): the differences between the eyes' looks upwards and across, in radians.

    To first order; (0, r) for a character without two eyes that turn.
    """
    turns = model.eye_turns
    return turns[0, :2] - turns[1, :2] if len(turns) == 2 else np.zeros((0, model.n_coefficients))


def centred_at(model: FaceModel, start: Array, prior: Prior = "regions", wholeness: float = 0.0) -> LocalMoments:
    """Return the model's density as it looks from the pose ``start``.

    The mode of a learned density is its performer's habitual face, not the pose that the user starts from, so that
    minimising (20) as it stands deforms a face that nobody has touched. The start is evidence: it stays the peak, and
    what is learned says how faces move away from it. It is remembered, since the start changes between poses, not
    between the moves of a drag.

    Args:
        model: The face and its density.
        start: Coefficients of the pose to start from, shape (r,).
        prior: "regions" to damp what muscles tell of each other, "whole" not to.
        wholeness: See ``LocalMoments``; "whole" means 1.
    """
    return _centred_at(model, start.tobytes(), 1.0 if prior == "whole" else wholeness)


@lru_cache(maxsize=8)
def _centred_at(model: FaceModel, start_bytes: bytes, wholeness: float) -> LocalMoments:
    return model.rig_density.seen_from(np.frombuffer(start_bytes), wholeness)
