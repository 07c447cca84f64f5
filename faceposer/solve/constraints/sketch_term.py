"""Energy of a sketch: a line that a hand has drawn, with the errors of a hand."""

import numpy as np
from numpy.typing import NDArray

from faceposer.solve.constraints.across_along import AcrossAlongTerm
from faceposer.solve.constraints.point import SIGMA_PX
from faceposer.solve.term import Array, Indices, PoseState

# Number of points as which a whole line counts: it is drawn in one movement, so that its points are not independent.
_LINE = 2.0
# Weight of a matched point across the line, and weights of offsets along the line relative to those across it: a hand
# meets the course of a line better than places along it.
_MATCHED, _ALONG_LINE, _ALONG_MATCHED = 0.2, 0.05, 0.1
# Standard deviation of the shift of a whole stroke, in pixels, in each direction.
_SHIFT_PX = 4.0


class SketchTerm(AcrossAlongTerm):
    """min over d of w / sigma^2 (sum over i of a_i (n_i . (e_i - d))^2 + b_i (t_i . (e_i - d))^2) + w |d|^2 / s^2.

    e_i is the offset of point i of the feature's curve from its place on the stroke, t_i and n_i the stroke's tangent
    and normal there. A hand puts a line in the wrong place more than it gives it the wrong shape; the shift d of the
    whole stroke, with the standard deviation s, lets the prior place it. d is linear in the offsets. a_i is L / m for
    each of the m points, and more at matched feature points; b_i is smaller.

    The weights were chosen by the error of faces of a performance drawn with a hand's errors (docs/sketching-files.md).
    """

    def __init__(
        self, points: Indices, targets: Array, tangents: Array, matched: NDArray[np.bool_], weight: float
    ) -> None:
        """Prepare the term.

        Args:
            points: Indices of the points in the state, shape (m,).
            targets: Their places on the stroke, shape (m, 2).
            tangents: Unit tangents of the stroke there, shape (m, 2).
            matched: Mask of the matched feature points, shape (m,).
            weight: Weight of the sketch, w.
        """
        scale = weight / SIGMA_PX**2
        line: Array = np.full(len(points), scale * _LINE / max(len(points), 1))
        at_points: Array = np.where(matched, scale * _MATCHED, 0.0)
        super().__init__(points, targets, tangents, line + at_points, _ALONG_LINE * line + _ALONG_MATCHED * at_points)
        frames = self._frames
        weights = np.einsum("mki,mk,mkj->mij", frames, self.weights.reshape(-1, 2), frames)
        stiffness = weight / _SHIFT_PX**2
        shares = np.linalg.inv(weights.sum(axis=0) + stiffness * np.eye(2)) @ weights
        # The shift as a linear function of the stacked offsets, shape (2, 2 m).
        self._shares = shares.transpose(1, 0, 2).reshape(2, -1)
        self.weights = np.append(self.weights, [stiffness, stiffness])

    def _without_shift(self, offsets: Array) -> Array:
        """Return ``offsets``, (m, 2, ...), across and along without their shift, and the shift, (2 m + 2, ...)."""
        columns = offsets.reshape(len(offsets), 2, -1)
        shift = self._shares @ columns.reshape(2 * len(offsets), -1)
        turned = self._frames @ (columns - shift)
        found: Array = np.concatenate([turned.reshape(-1, columns.shape[2]), shift])
        return found.reshape(-1, *offsets.shape[2:])

    def residual(self, state: PoseState) -> Array:
        """Return the offsets across and along the stroke without its shift, and the shift, shape (2 m + 2,)."""
        return self._without_shift(state.pixels[self._points] - self._targets)

    def jacobian(self, state: PoseState) -> Array:
        """Return the derivatives of the residuals, shape (2 m + 2, r)."""
        return self._without_shift(state.pixel_jacobian(self._points))

    def pull_back(self, state: PoseState, by_residual: Array) -> Array:
        """Return jacobian^T ``by_residual``, shape (r,)."""
        by_pixel = np.einsum("mij,mi->mj", self._frames, by_residual[:-2].reshape(-1, 2))
        by_shift = by_residual[-2:] - by_pixel.sum(axis=0)
        return state.pull_back(self._points, by_pixel + (by_shift @ self._shares).reshape(-1, 2))
