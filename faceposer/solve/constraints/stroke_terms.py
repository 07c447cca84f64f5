"""The energies of a stroke: distances both ways (the default), and the paper's difference of images."""

from dataclasses import dataclass

import numpy as np

from faceposer.solve.constraints.point import SIGMA_PX
from faceposer.solve.term import Array, Indices, PoseState, ResidualTerm

# A stroke is drawn with one sway of the hand: its pixels say as much as this many points.
AS_MANY_POINTS = 6.0
# What it counts that a pixel of the target is not covered, against a point of the source beside the target.
REVERSE = 0.5
# What it counts that the centres are apart: it tells the way where the strokes are far from each other.
CENTRE = 0.5
# sigma of the paper's eq. (12): a stroke of 150 pixels that is off by one pixel then counts like its points would.
_SIGMA_IMAGE = 10.0
# Pixels beyond the target within which the image of a source is kept: a line search may try faces that lie anywhere.
_IMAGE_MARGIN = 600


@dataclass(frozen=True)
class _Match:
    """For one state: the source's pixels (n, 2), the nearest target of each, and the nearest source of each target."""

    state: PoseState
    pixels: Array
    nearest_target: Indices
    nearest_source: Indices


class StrokeDistanceTerm(ResidualTerm):
    """w S / sigma^2 (mean_i |y_i - z_n(i)|^2 + a mean_j |y_m(j) - z_j|^2 + b |mean_i y_i - mean_j z_j|^2).

    z_n(i) is the pixel of the target nearest to the source's y_i, which is its distance field exactly; y_m(j) is the
    point of the source nearest to the target's z_j, without which a source shrinks into a part of its target. The last
    summand is the paper's eq. (13). Neighbours change from pose to pose; where they do not, residuals are
    differentiable, and at the places where they do, the energy is still continuous.
    """

    def __init__(self, target: Array, points: Indices, weight: float) -> None:
        """Prepare the term for the pixels ``target``, (m, 2), and the ``points`` of the source, (n,) in the state."""
        self._target, self._points = target, points
        self._centre = target.mean(axis=0)
        # Of |y - z|^2, measured from the target's centre: what depends on z, as factors of (y, 1), and -2 z.
        centred = target - self._centre
        self._to_target = np.concatenate([-2.0 * centred.T, (centred * centred).sum(axis=1)[None]])
        self._from_target = -2.0 * centred
        scale = weight * AS_MANY_POINTS / SIGMA_PX**2
        n, m = len(points), len(target)
        counts = np.concatenate([np.full(2 * n, 1.0 / n), np.full(2 * m, REVERSE / m), np.full(2, CENTRE)])
        super().__init__(scale * counts)
        self._match: _Match | None = None

    def _matched(self, state: PoseState) -> _Match:
        if self._match is None or self._match.state is not state:
            pixels = state.pixels[self._points]
            # All pairs twice, each way by rows: for a few hundred points that takes half as long as a search tree.
            y = pixels - self._centre
            to_target = np.column_stack([y, np.ones(len(y))]) @ self._to_target
            to_source = self._from_target @ y.T + (y * y).sum(axis=1)
            self._match = _Match(state, pixels, to_target.argmin(axis=1), to_source.argmin(axis=1))
        return self._match

    def residual(self, state: PoseState) -> Array:
        """Return the offsets to the target, those of the target to the source, and the centres', (2 n + 2 m + 2,)."""
        match = self._matched(state)
        forward = match.pixels - self._target[match.nearest_target]
        reverse = match.pixels[match.nearest_source] - self._target
        centre = match.pixels.mean(axis=0) - self._centre
        return np.concatenate([forward.ravel(), reverse.ravel(), centre])

    def jacobian(self, state: PoseState) -> Array:
        """Return the derivatives of the residuals with the neighbours held, shape (2 n + 2 m + 2, r)."""
        jacobian = state.pixel_jacobian(self._points)
        reverse = jacobian[self._matched(state).nearest_source]
        return np.concatenate([jacobian, reverse, jacobian.mean(axis=0)[None]]).reshape(-1, jacobian.shape[-1])

    def pull_back(self, state: PoseState, by_residual: Array) -> Array:
        """Return jacobian^T ``by_residual``, shape (r,)."""
        n, m = len(self._points), len(self._target)
        by_pixel = by_residual[: 2 * n].reshape(n, 2) + by_residual[-2:] / n
        nearest, reverse = self._matched(state).nearest_source, by_residual[2 * n : 2 * (n + m)].reshape(m, 2)
        for axis in range(2):
            by_pixel[:, axis] += np.bincount(nearest, reverse[:, axis], minlength=n)
        return state.pull_back(self._points, by_pixel)

    def curvature(self, state: PoseState) -> Array:
        """Return the Gauss-Newton estimate of the second derivative, shape (r, r).

        A target pixel adds to the weight of the source point that it is nearest to.
        """
        n, m = len(self._points), len(self._target)
        jacobian = state.pixel_jacobian(self._points)
        covered = np.bincount(self._matched(state).nearest_source, minlength=n)
        weights = self.weights[0] + self.weights[2 * n] * covered if m else np.full(n, self.weights[0])
        flat = (jacobian * np.sqrt(2.0 * weights)[:, None, None]).reshape(2 * n, -1)
        centre = jacobian.mean(axis=0)
        estimate: Array = flat.T @ flat + 2.0 * self.weights[-1] * centre.T @ centre
        return estimate


class StrokeImageTerm:
    """The paper's energy: sum over pixels of (I_y - I_z)^2 / sigma^2, and the pull of centres (eqs. (12) and (13)).

    I_y is the binary image of the projected source, I_z that of the target. The derivative of I_y is taken by the Sobel
    operator at the source's pixels (eqs. (27) and (29)); the printed (27) lacks the minus sign that a moving image has:
    where the source moves by a pixel, its image at a fixed place changes by minus its gradient. The energy itself is
    piecewise constant, so that this is an estimate and no derivative.
    """

    def __init__(self, target: Array, points: Indices, weight: float) -> None:
        """Prepare the term for the pixels ``target``, (m, 2), and the ``points`` of the source, (n,) in the state."""
        self._target = np.floor(target).astype(np.intp)
        self._centre = target.mean(axis=0)
        self._points = points
        self._image = weight / _SIGMA_IMAGE**2
        self._extra = weight / SIGMA_PX**2

    def value_and_gradient(self, state: PoseState) -> tuple[float, Array]:
        """Return the energy and the estimate of its gradient with respect to the coefficients, shape (r,)."""
        # The window's start does not wait for image filters.
        from scipy.ndimage import sobel

        pixels = state.pixels[self._points]
        first, last = self._target.min(axis=0) - _IMAGE_MARGIN, self._target.max(axis=0) + _IMAGE_MARGIN
        cells = np.clip(np.floor(pixels), first, last).astype(np.intp)
        low = np.minimum(cells.min(axis=0), self._target.min(axis=0)) - 2
        size = np.maximum(cells.max(axis=0), self._target.max(axis=0)) - low + 3
        source_image, target_image = np.zeros(size[::-1]), np.zeros(size[::-1])
        columns, rows = (cells - low).T
        source_image[rows, columns] = 1.0
        target_columns, target_rows = (self._target - low).T
        target_image[target_rows, target_columns] = 1.0
        difference = source_image - target_image
        centre = pixels.mean(axis=0) - self._centre
        value = self._image * float((difference * difference).sum()) + self._extra * float(centre @ centre)
        # The operator's weights sum to 8 per unit of slope.
        slopes = np.stack([sobel(source_image, axis)[rows, columns] / 8.0 for axis in (1, 0)], axis=1)
        by_pixel = -2.0 * self._image * difference[rows, columns][:, None] * slopes
        by_pixel += 2.0 * self._extra * centre / len(pixels)
        return value, state.pull_back(self._points, by_pixel)

    def curvature(self, state: PoseState) -> Array:
        """Return the curvature that the same points would have under the energy of distances, shape (r, r)."""
        jacobian = state.pixel_jacobian(self._points)
        flat = jacobian.reshape(-1, jacobian.shape[-1])
        centre = jacobian.mean(axis=0)
        scale = 2.0 * AS_MANY_POINTS * self._extra / len(jacobian)
        estimate: Array = scale * flat.T @ flat + 2.0 * self._extra * centre.T @ centre
        return estimate
