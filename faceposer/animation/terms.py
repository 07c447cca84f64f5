"""The terms that following trajectories adds to the energy of a pose."""

import numpy as np

from faceposer.geometry.camera import Camera
from faceposer.model.face_model import FaceModel
from faceposer.solve.constraints.fixed import PX_PER_CM
from faceposer.solve.constraints.point import SIGMA_PX
from faceposer.solve.term import Array, PoseState, ResidualTerm

#: How far a face changes its velocity from one frame to the next at 30 frames per second, as a share of how far
#: expressions are from their mean: the standard deviation of the change where smoothness is 1.
CHANGE = 0.045
_USUAL_RATE = 30.0


class TrackTerm(ResidualTerm):
    """sum over i of w_i |y_i(p) - z_i|^2 / sigma^2 for the points seen in one frame (paper, eq. (9)).

    In a picture y is a pixel. In space it is a position, with a centimetre for as many pixels as in an ordinary view,
    as for fixed points, so that weights mean the same for both.
    """

    def __init__(self, rows: Array, neutral: Array, targets: Array, weights: Array, camera: Camera | None) -> None:
        """Pull n points towards their targets.

        Args:
            rows: Derivatives of the points by the coefficients, shape (n, 3, r).
            neutral: The points of the neutral face, shape (n, 3).
            targets: Shape (n, 2) in the pixels of ``camera``, or (n, 3) in the unit of the face.
            weights: Factors on the energies of the points, shape (n,).
            camera: The camera of the targets; None in space.
        """
        self._unit = PX_PER_CM if camera is None else 1.0
        super().__init__(np.repeat(weights / SIGMA_PX**2, targets.shape[1]))
        self._rows, self._neutral, self._targets, self._camera = rows, neutral, targets, camera

    def residual(self, state: PoseState) -> Array:
        """Return what the points are off, in pixels, shape (2 n,) or (3 n,)."""
        points = self._points(state)
        at = points if self._camera is None else self._camera.project(points)
        residual: Array = self._unit * (at - self._targets).ravel()
        return residual

    def jacobian(self, state: PoseState) -> Array:
        """Return the derivatives of the residuals, shape (2 n, r) or (3 n, r)."""
        rows = self._rows
        if self._camera is not None:
            rows = self._camera.project_with_jacobian(self._points(state))[1] @ rows
        return self._unit * rows.reshape(-1, rows.shape[-1])

    def _points(self, state: PoseState) -> Array:
        points: Array = self._neutral + self._rows @ state.p
        return points


class SmoothnessTerm:
    """(p - q)^T M (p - q), where q goes on with the velocity of the two frames before (paper, section 7)."""

    def __init__(self, metric: Array, before: Array, last: Array) -> None:
        """Keep the velocity between the poses ``before`` and ``last``, each (r,), by the ``metric`` M, (r, r)."""
        self._metric = metric
        self._expected = 2.0 * last - before

    def value_and_gradient(self, state: PoseState) -> tuple[float, Array]:
        """Return the cost and its gradient by the coefficients, shape (r,)."""
        change = state.p - self._expected
        pulled = self._metric @ change
        return float(change @ pulled), 2.0 * pulled

    def curvature(self, state: PoseState) -> Array:
        """Return the second derivative, shape (r, r)."""
        return 2.0 * self._metric


def smoothness_metric(model: FaceModel, smoothness: float, rate: float) -> Array:
    """Return M, (r, r), for which d^T M d is the cost of a change d of velocity from one frame to the next.

    d^T M d = smoothness (rate / 30)^3 / CHANGE^2 * (mean_i |dx_i|^2 / mean_i E|x_i - E x_i|^2 + the same weighted) / 2,
    with means over all vertices i, the second ones weighted as in the PCA: by area, relative to how far a place moves
    at all. The plain mean, the paper's, is of the jaw and the lips alone, and leaves jitter to brows and lids.

    Relative to the size of the face's expressions the cost is the same for large and small faces, for heads with much
    or little that never moves, and for any mesh. The power of the rate is that of an acceleration that is white noise,
    so that the smoothness in time does not depend on the rate.
    """
    plain = model.subspace.directions.T @ model.gram @ model.subspace.directions
    variances = model.subspace.variances
    # In the metric of the PCA the basis is orthonormal.
    relative = plain / float(np.diag(plain) @ variances) + np.eye(len(plain)) / float(variances.sum())
    metric: Array = 0.5 * smoothness * (rate / _USUAL_RATE) ** 3 / CHANGE**2 * relative
    return metric
