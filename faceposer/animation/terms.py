"""Energy terms for poses that follow trajectories."""

import numpy as np

from faceposer.geometry.camera import Camera
from faceposer.model.face_model import FaceModel
from faceposer.solve.constraints.fixed import PX_PER_CM
from faceposer.solve.constraints.point import SIGMA_PX
from faceposer.solve.term import Array, PoseState, ResidualTerm

#: Standard deviation, for smoothness 1, of the change of velocity between frames at 30 frames per second, relative to
#: the distance of expressions from their mean.
CHANGE = 0.045
_USUAL_RATE = 30.0


class TrackTerm(ResidualTerm):
    """Sum over i of w_i |y_i(p) - z_i|^2 / sigma^2 for the points seen in one frame (paper, eq. (9)).

    In an image, y is a pixel. In space, it is a position, with centimetres converted to the pixels of an ordinary view
    as for fixed points, so that weights have the same meaning in both.
    """

    def __init__(self, rows: Array, neutral: Array, targets: Array, weights: Array, camera: Camera | None) -> None:
        """Attract n points to their targets.

        Args:
            rows: Derivatives of the points with respect to the coefficients, shape (n, 3, r).
            neutral: Points of the neutral face, shape (n, 3).
            targets: Shape (n, 2) in pixels of ``camera``, or (n, 3) in the unit of the face.
            weights: Factors on the energies of the points, shape (n,).
            camera: Camera of the targets; None in space.
        """
        self._unit = PX_PER_CM if camera is None else 1.0
        super().__init__(np.repeat(weights / SIGMA_PX**2, targets.shape[1]))
        self._rows, self._neutral, self._targets, self._camera = rows, neutral, targets, camera

    def residual(self, state: PoseState) -> Array:
        """Return the point errors in pixels, shape (2 n,) or (3 n,)."""
        points = self._points(state)
        values = points if self._camera is None else self._camera.project(points)
        residual: Array = self._unit * (values - self._targets).ravel()
        return residual

    def jacobian(self, state: PoseState) -> Array:
        """Return the derivatives of the residual, shape (2 n, r) or (3 n, r)."""
        rows = self._rows
        if self._camera is not None:
            rows = self._camera.project_with_jacobian(self._points(state))[1] @ rows
        return self._unit * rows.reshape(-1, rows.shape[-1])

    def _points(self, state: PoseState) -> Array:
        points: Array = self._neutral + self._rows @ state.p
        return points


class SmoothnessTerm:
    """(p - q)^T M (p - q), with q extrapolated at the velocity of the two previous frames (paper, section 7)."""

    def __init__(self, metric: Array, before: Array, last: Array) -> None:
        """Penalise deviations from constant velocity after the poses ``before`` and ``last``, (r,), with M, (r, r)."""
        self._metric = metric
        self._expected = 2.0 * last - before

    def value_and_gradient(self, state: PoseState) -> tuple[float, Array]:
        """Return the cost and its gradient with respect to the coefficients, shape (r,)."""
        change = state.p - self._expected
        product = self._metric @ change
        return float(change @ product), 2.0 * product

    def curvature(self, state: PoseState) -> Array:
        """Return the second derivative, shape (r, r)."""
        return 2.0 * self._metric


def smoothness_metric(model: FaceModel, smoothness: float, rate: float) -> Array:
    """Return M, (r, r), such that d^T M d is the cost of a change d of velocity between frames.

    d^T M d = smoothness (rate / 30)^3 / CHANGE^2 * (mean_i |dx_i|^2 / mean_i E|x_i - E x_i|^2 + the same weighted) / 2,
    with means over all vertices i, the second ones weighted as in the PCA: by area, relative to the motion of each
    place. The plain mean of the paper is dominated by jaw and lips, and leaves jitter in brows and lids.

    Relative to the size of expressions, the cost does not depend on the size of the face, on the extent of its static
    parts or on the mesh. The power of the rate is that of an acceleration that is white noise, so that the smoothness
    in time does not depend on the rate.
    """
    plain = model.subspace.directions.T @ model.gram @ model.subspace.directions
    variances = model.subspace.variances
    # In the metric of the PCA the basis is orthonormal.
    relative = plain / float(np.diag(plain) @ variances) + np.eye(len(plain)) / float(variances.sum())
    metric: Array = 0.5 * smoothness * (rate / _USUAL_RATE) ** 3 / CHANGE**2 * relative
    return metric


def regional_metrics(model: FaceModel, metric: Array) -> Array:
    """Return matrices M_g, (G, r, r), with d^T M_g d the cost by ``metric`` of what the shapes of region g do in d.

    Regions are those of the density of expressions, such as the jaw, smiles or blinks.
    """
    density, subspace = model.rig_density, model.subspace
    parts = []
    for region in dict.fromkeys(density.regions):
        rows = density.shape_rows[np.array([own == region for own in density.regions])]
        share = subspace.projection[:, rows] @ subspace.directions[rows]
        parts.append(share.T @ metric @ share)
    return np.array(parts)
