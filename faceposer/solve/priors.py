"""Priors of natural expressions, as terms of the problem (Lau et al. 2009, section 5)."""

import numpy as np

from faceposer.model.mixture import GaussianMixture
from faceposer.solve.term import Array, PoseState


class MixturePrior:
    """weight * (-ln pr(p)) for a mixture of Gaussians (paper, eqs. (19) and (31)).

    The constant that makes the energy of the most likely pose of the leading component zero is left out.
    """

    def __init__(self, mixture: GaussianMixture, weight: float = 1.0) -> None:
        """Weigh the energy of ``mixture`` by ``weight``, at least 0."""
        self.mixture = mixture
        self.weight = weight

    def value_and_gradient(self, state: PoseState) -> tuple[float, Array]:
        """Return the energy and its gradient by the coefficients, shape (r,)."""
        energy, gradient = self.mixture.energy_and_gradient(state.p)
        return self.weight * energy, self.weight * gradient

    def curvature(self, state: PoseState) -> Array:
        """Return the precision of the component that most likely made the pose, shape (r, r)."""
        component = int(np.argmax(self.mixture.responsibilities(state.p)))
        return self.weight * self.mixture.precision(component)


def centred_at(mixture: GaussianMixture, start: Array) -> GaussianMixture:
    """Return ``mixture`` as it looks from the pose ``start``: each component becomes a spread about that pose.

    The mode of a learned density is its performer's habitual face, not the pose that the user starts from, so that
    minimising (20) as it stands deforms a face that nobody has touched. The start is evidence: here every component keeps
    where it lies as the direction in which the face moves, cov_k + (mean_k - start)(mean_k - start)^T being its
    second moment about the start. All components have their peak there, so without constraints the start is the only
    minimum, and a small pull moves the face a little.

    Args:
        mixture: The learned density.
        start: Coefficients of the pose to start from, shape (r,).
    """
    offsets = mixture.means - start
    spread = mixture.covariances + np.einsum("ki,kj->kij", offsets, offsets)
    return GaussianMixture(mixture.weights, np.broadcast_to(start, mixture.means.shape).copy(), spread)
