"""Least motion: of all poses that explain a pull, the one that moves least of the face, and that as one movement.

The statistics of a capture know frames in which a brow comes down while the eyes close. An artist who pulls only the
brow says more: what was not pulled is to stay. A quadratic cost of motion says so too, but it shrinks large motions; a
concave one does not, but jumps. Reweighted quadratics (Daubechies, DeVore, Fornasier and Güntürk 2010) with a fixed
number of rounds are as selective as a concave cost and follow the pull without jumps.
"""

from dataclasses import dataclass

import numpy as np

from faceposer.model.face_model import FaceModel
from faceposer.model.motion_samples import gram_of_places
from faceposer.solve.definite import solved, solved_by_root, square_root
from faceposer.solve.term import Array, PoseState, QuadraticTerm

# Centimetres on a head of usual size: what the first round takes all places to move, and what motion counts as none.
_FIRST_MOTION, _NO_MOTION = 0.4, 0.01
_ROUNDS = 4
# Pulls that determine more than so many directions of the pose's say for themselves how far they reach.
_FEW_DIRECTIONS = 4.0


@dataclass(frozen=True, eq=False)
class Evidence:
    """The constraints' energy about a pose, |J d + r|^2 for a change d of its coefficients.

    Attributes:
        rows: J, shape (m, r).
        residual: r, shape (m,).
    """

    rows: Array
    residual: Array


class LeastMotion(QuadraticTerm):
    """nu sum over places v of a_v w_v |X_v (p - p0)|^2 (``MotionSamples``: shares of area a_v, X_v = ``single``).

    Weights follow from the constraints alone: from w_v = 1 / c0^2, in turn

        d = -(J^T J + Q + nu sum_v a_v w_v X_v^T X_v)^-1 J^T r,    w_v = 1 / (|X_v d'|^2 + c^2),

    with Q half of the prior's precision and d' the change d with all rig weights clipped to their limits. The more
    directions n = tr((J^T J + Q)^-1 J^T J) constraints determine, the less they need it: nu falls as 4 / n from n = 4.
    """

    def __init__(
        self, model: FaceModel, start: Array, evidence: Evidence, precision: Array, strength: float, limits: Array
    ) -> None:
        """Weigh motion from the pose ``start``, shape (r,), by what explains the ``evidence`` there.

        Args:
            model: The face.
            start: p0.
            evidence: Of the constraints at the start.
            precision: Q, shape (r, r).
            strength: nu, before it falls.
            limits: Of the weights of the model's density, shape (W, 2); the start lies within.
        """
        samples, density = model.motion_samples, model.rig_density
        self._start = start
        stiff = evidence.rows.T @ evidence.rows + precision
        # With L L^T = J^T J + Q, n is the sum of the squares of L^-1 J^T.
        told = solved_by_root(square_root(stiff), evidence.rows.T)
        determined = float(np.vdot(told, told))
        factor = strength * min(1.0, _FEW_DIRECTIONS / max(determined, 1e-9))
        pull = -(evidence.rows.T @ evidence.residual)
        lower, upper = (limits - (density.directions @ start)[:, None]).T
        areas, rows = factor * samples.areas, samples.single_by_place
        quadratic = (factor / _FIRST_MOTION**2) * samples.gram
        for _ in range(_ROUNDS):
            change = density.directions @ solved(stiff + quadratic, pull)
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
