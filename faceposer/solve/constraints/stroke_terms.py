"""Energies of strokes: two-sided distances (the default), and the paper's difference of images."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from faceposer.solve.constraints.point import SIGMA_PX
from faceposer.solve.term import Array, Indices, PoseState, ResidualTerm

# Number of points as which a stroke counts: its pixels are drawn in one movement and are not independent.
AS_MANY_POINTS = 6.0
# Weight of the distances from the target to the source, relative to those from the source to the target.
REVERSE = 0.5
# Weight of the distance of the centroids, which gives the direction when the strokes are far apart.
CENTRE = 0.5
# sigma of the paper's eq. (12), so that a stroke of 150 pixels shifted by one pixel counts like its points.
_SIGMA_IMAGE = 10.0
# Number of columns of the images, and their largest coordinate: a line search may try any face.
_ROW = 1 << 31
_FARTHEST = float(1 << 29)


@dataclass(frozen=True)
class _Match:
    """Correspondences at one state.

    Attributes:
        state: The state.
        pixels: Pixels of the source, shape (n, 2).
        nearest_target: Index of the nearest target pixel of each source point, shape (n,).
        nearest_source: Index of the nearest source point of each target pixel, shape (m,).
    """

    state: PoseState
    pixels: Array
    nearest_target: Indices
    nearest_source: Indices


class StrokeDistanceTerm(ResidualTerm):
    """w S / sigma^2 (mean_i |y_i - z_n(i)|^2 + a mean_j |y_m(j) - z_j|^2 + b |mean_i y_i - mean_j z_j|^2).

    z_n(i) is the target pixel nearest to the source point y_i, which gives the exact distance field of the target;
    y_m(j) is the source point nearest to the target pixel z_j, without which the source would shrink into a part of the
    target. The last summand is the paper's eq. (13). The energy is continuous, and differentiable wherever the nearest
    points do not change.
    """

    def __init__(self, target: Array, points: Indices, weight: float) -> None:
        """Prepare the term for the pixels ``target``, (m, 2), and the indices of the source's ``points``, (n,)."""
        self._target, self._points = target, points
        self._centre = target.mean(axis=0)
        # The part of |y - z|^2 that depends on z, relative to the target's centroid: coefficients of (y, 1), and -2 z.
        centred = target - self._centre
        self._to_target = np.concatenate([-2.0 * centred.T, (centred * centred).sum(axis=1)[None]])
        self._from_target = -2.0 * centred
        scale = weight * AS_MANY_POINTS / SIGMA_PX**2
        n, m = len(points), len(target)
        counts = np.concatenate([np.full(2 * n, 1.0 / n), np.full(2 * m, REVERSE / m), np.full(2, CENTRE)])
        super().__init__(scale * counts)
        self._match: _Match | None = None

    def _match_at(self, state: PoseState) -> _Match:
        if self._match is None or self._match.state is not state:
            pixels = state.pixels[self._points]
            # Brute force in both directions takes half as long as a search tree for a few hundred points.
            y = pixels - self._centre
            to_target = np.column_stack([y, np.ones(len(y))]) @ self._to_target
            to_source = self._from_target @ y.T + (y * y).sum(axis=1)
            self._match = _Match(state, pixels, to_target.argmin(axis=1), to_source.argmin(axis=1))
        return self._match

    def residual(self, state: PoseState) -> Array:
        """Return the offsets source to target, target to source, and of the centroids, shape (2 n + 2 m + 2,)."""
        match = self._match_at(state)
        forward = match.pixels - self._target[match.nearest_target]
        reverse = match.pixels[match.nearest_source] - self._target
        centre = match.pixels.mean(axis=0) - self._centre
        return np.concatenate([forward.ravel(), reverse.ravel(), centre])

    def jacobian(self, state: PoseState) -> Array:
        """Return the derivatives of the residuals for fixed correspondences, shape (2 n + 2 m + 2, r)."""
        jacobian = state.pixel_jacobian(self._points)
        reverse = jacobian[self._match_at(state).nearest_source]
        return np.concatenate([jacobian, reverse, jacobian.mean(axis=0)[None]]).reshape(-1, jacobian.shape[-1])

    def pull_back(self, state: PoseState, by_residual: Array) -> Array:
        """Return jacobian^T ``by_residual``, shape (r,)."""
        n, m = len(self._points), len(self._target)
        by_pixel = by_residual[: 2 * n].reshape(n, 2) + by_residual[-2:] / n
        nearest, reverse = self._match_at(state).nearest_source, by_residual[2 * n : 2 * (n + m)].reshape(m, 2)
        for axis in range(2):
            by_pixel[:, axis] += np.bincount(nearest, reverse[:, axis], minlength=n)
        return state.pull_back(self._points, by_pixel)

    def curvature(self, state: PoseState) -> Array:
        """Return the Gauss-Newton estimate of the second derivative, shape (r, r).

        Each target pixel adds to the weight of its nearest source point.
        """
        n, m = len(self._points), len(self._target)
        jacobian = state.pixel_jacobian(self._points)
        covered = np.bincount(self._match_at(state).nearest_source, minlength=n)
        weights = self.weights[0] + self.weights[2 * n] * covered if m else np.full(n, self.weights[0])
        flat = (jacobian * np.sqrt(2.0 * weights)[:, None, None]).reshape(2 * n, -1)
        centre = jacobian.mean(axis=0)
        estimate: Array = flat.T @ flat + 2.0 * self.weights[-1] * centre.T @ centre
        return estimate


class StrokeImageTerm:
    """The paper's energy: sum over pixels of (I_y - I_z)^2 / sigma^2, and the distance of centroids (eqs. (12), (13)).

    I_y is the binary image of the projected source, I_z that of the target. The derivative of I_y is estimated by the
    Sobel operator at the source's pixels (eqs. (27) and (29)). Equation (27) as printed lacks a minus sign: when the
    source moves by a pixel, its image at a fixed position changes by minus its gradient. The energy itself is piecewise
    constant, so that the gradient is an estimate only.
    """

    def __init__(self, target: Array, points: Indices, weight: float) -> None:
        """Prepare the term for the pixels ``target``, (m, 2), and the indices of the source's ``points``, (n,)."""
        self._target = _distinct(_keys(target))
        self._centre = target.mean(axis=0)
        self._points = points
        self._image = weight / _SIGMA_IMAGE**2
        self._extra = weight / SIGMA_PX**2

    def value_and_gradient(self, state: PoseState) -> tuple[float, Array]:
        """Return the energy and an estimate of its gradient with respect to the coefficients, shape (r,)."""
        pixels = state.pixels[self._points]
        # The images are sets of pixels, so that memory does not depend on their extent.
        keys = _keys(pixels)
        source = _distinct(keys)
        common = int(_contains(self._target, source).sum())
        centre = pixels.mean(axis=0) - self._centre
        value = self._image * (len(source) + len(self._target) - 2 * common) + self._extra * float(centre @ centre)
        difference = 1.0 - _contains(self._target, keys)
        # Sobel's operator at the pixels of the source; its weights sum to 8 per unit of slope.
        slopes = np.zeros((len(keys), 2))
        for along in (-1, 1):
            for across, weight in ((-1, 1.0), (0, 2.0), (1, 1.0)):
                slopes[:, 0] += along * weight / 8.0 * _contains(source, keys + across * _ROW + along)
                slopes[:, 1] += along * weight / 8.0 * _contains(source, keys + along * _ROW + across)
        by_pixel = -2.0 * self._image * difference[:, None] * slopes
        by_pixel += 2.0 * self._extra * centre / len(pixels)
        return value, state.pull_back(self._points, by_pixel)

    def curvature(self, state: PoseState) -> Array:
        """Return the curvature of the distance energy of the same points, shape (r, r)."""
        jacobian = state.pixel_jacobian(self._points)
        flat = jacobian.reshape(-1, jacobian.shape[-1])
        centre = jacobian.mean(axis=0)
        scale = 2.0 * AS_MANY_POINTS * self._extra / len(jacobian)
        estimate: Array = scale * flat.T @ flat + 2.0 * self._extra * centre.T @ centre
        return estimate


def _keys(pixels: Array) -> Indices:
    """Return a number for the cell of each of ``pixels``, shape (n, 2), in the order of rows and columns."""
    columns, rows = np.floor(np.clip(pixels, -_FARTHEST, _FARTHEST)).astype(np.int64).T
    return rows * _ROW + columns


def _distinct(keys: Indices) -> Indices:
    """Return ``keys`` in order, each once."""
    ordered = np.sort(keys)
    kept: Indices = ordered[np.concatenate([[True], ordered[1:] != ordered[:-1]])]
    return kept


def _contains(cells: Indices, keys: Indices) -> NDArray[np.bool_]:
    """Return the mask of ``keys`` among the sorted ``cells``."""
    at = np.minimum(np.searchsorted(cells, keys), len(cells) - 1)
    return cells[at] == keys
