"""Least motion: a term that prefers, of all poses that explain the constraints, the one that moves least of the face.

In captured statistics a brow may come down while the eyes close. An artist who pulls only the brow expects the rest to
keep still. A quadratic cost on motion also shrinks large motions; a concave cost does not, but its minimum jumps.
Iteratively reweighted least squares (Daubechies, DeVore, Fornasier and Güntürk 2010) with a fixed number of rounds is
as selective as a concave cost and follows the targets without jumps.
"""

from dataclasses import dataclass

import numpy as np

from faceposer.model.face_model import FaceModel
from faceposer.model.motion_samples import gram_of_places
from faceposer.solve.definite import robust_cholesky, solve_definite, solve_triangular
from faceposer.solve.term import Array, PoseState, QuadraticTerm

# Centimetres on a head of usual size: motion of all samples assumed in the first round, and the regulariser c.
_FIRST_MOTION, _NO_MOTION = 0.4, 0.01
_ROUNDS = 4
# Number of determined directions of the pose above which the term fades: the constraints then fix the extent.
_FEW_DIRECTIONS = 4.0


@dataclass(frozen=True, eq=False)
class LinearisedEnergy:
    """The constraints' energy linearised about a pose, |J d + r|^2 for a change d of its coefficients.

    Attributes:
        rows: J, shape (m, r).
        residual: r, shape (m,).
    """

    rows: Array
    residual: Array


class LeastMotion(QuadraticTerm):
    """nu sum over samples v of a_v w_v |X_v (p - p0)|^2 (``MotionSamples``: shares of area a_v, X_v = ``single``).

    The weights depend on the constraints alone. Starting from w_v = 1 / c0^2, each round computes

        d = -(J^T J + Q + nu sum_v a_v w_v X_v^T X_v)^-1 J^T r,    w_v = 1 / (|X_v d'|^2 + c^2),

    with Q half of the prior's precision and d' the change d with all rig weights clipped to their limits. The number of
    directions that the constraints determine is n = tr((J^T J + Q)^-1 J^T J); above n = 4, nu falls as 4 / n.
    """

    def __init__(
        self, model: FaceModel, start: Array, energy: LinearisedEnergy, precision: Array, strength: float, limits: Array
    ) -> None:
        """Compute the weights for motion from the pose ``start``, shape (r,).

        Args:
            model: The face.
            start: p0.
            energy: The constraints' energy, linearised at the start.
            precision: Q, shape (r, r).
            strength: nu at n of at most 4.
            limits: Limits of the weights of the model's density, shape (W, 2), which the start satisfies.
        """
        samples, density = model.motion_samples, model.rig_density
        self._start = start
        stiff = energy.rows.T @ energy.rows + precision
        # With L L^T = J^T J + Q, n is the sum of the squares of L^-1 J^T.
        whitened = solve_triangular(robust_cholesky(stiff), energy.rows.T)
        determined = float(np.vdot(whitened, whitened))
        factor = strength * min(1.0, _FEW_DIRECTIONS / max(determined, 1e-9))
        force = -(energy.rows.T @ energy.residual)
        lower, upper = (limits - (density.directions @ start)[:, None]).T
        areas, rows = factor * samples.areas, samples.single_by_place
        quadratic = (factor / _FIRST_MOTION**2) * samples.gram
        for _ in range(_ROUNDS):
            change = density.directions @ solve_definite(stiff + quadratic, force)
            within = density.projection @ np.minimum(np.maximum(change, lower), upper)
            moved = rows @ within.astype(np.float32)
            quadratic = gram_of_places(rows, areas / (np.einsum("nk,nk->n", moved, moved) + _NO_MOTION**2))
        self._quadratic = quadratic

    def value_and_gradient(self, state: PoseState) -> tuple[float, Array]:
        """Return the cost and its gradient with respect to the coefficients, shape (r,)."""
        change = state.p - self._start
        slope = self._quadratic @ change
        return float(change @ slope), 2.0 * slope

    def curvature(self, state: PoseState) -> Array:
        """Return the second derivative, shape (r, r)."""
        return 2.0 * self._quadratic
