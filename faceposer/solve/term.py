"""Terms of a maximum a posteriori problem.

State: the constrained points of the face at one vector of coefficients, shared by all terms.
Term: a non-negative cost with its gradient and curvature, the interface of the optimiser.
Residual term: a weighted sum of squared residuals, with the Gauss-Newton curvature.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from faceposer.geometry.camera import Camera

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

# Share of superfluous rows that are kept.
_FEW_MORE = 1.25


@dataclass(frozen=True, eq=False)
class AnchoredPoints:
    """The surface points of all constraints of a problem, gathered once.

    Attributes:
        rows: Derivatives of the points with respect to the coefficients, coordinates stacked, shape (3 n, r).
        neutral: The points at p = 0, shape (n, 3).
        views: Each camera with the indices of its points.
    """

    rows: Array
    neutral: Array
    views: tuple[tuple[Camera, Indices], ...]

    @property
    def nbytes(self) -> int:
        """Memory of the points in bytes."""
        return self.rows.nbytes + self.neutral.nbytes


class PoseState:
    """The anchored points at one vector of coefficients: positions, pixels and derivatives, each computed once."""

    def __init__(self, anchored: AnchoredPoints, p: Array) -> None:
        """Prepare the state at coefficients ``p`` of shape (r,)."""
        self._anchored = anchored
        self.p = p

    @property
    def nbytes(self) -> int:
        """Memory of the state and its points in bytes, with all that it computes on demand."""
        return self._anchored.nbytes + (3 + 2 + 6) * self.p.itemsize * len(self._anchored.neutral)

    @cached_property
    def points(self) -> Array:
        """World positions, shape (n, 3)."""
        return self._anchored.neutral + (self._anchored.rows @ self.p).reshape(-1, 3)

    def anchored_at(self, indices: Indices) -> tuple[Array, Array]:
        """Return the derivatives of the points ``indices``, (k, 3, r), and their neutral positions, (k, 3)."""
        rows = self._anchored.rows.reshape(len(self._anchored.neutral), 3, -1)
        return rows[indices], self._anchored.neutral[indices]

    @cached_property
    def _projection(self) -> tuple[Array, Array]:
        points, views = self.points, self._anchored.views
        if len(views) == 1:
            return views[0][0].project_with_jacobian(points)
        pixels, jacobian = np.empty((len(points), 2)), np.empty((len(points), 2, 3))
        for camera, indices in views:
            pixels[indices], jacobian[indices] = camera.project_with_jacobian(points[indices])
        return pixels, jacobian

    @property
    def pixels(self) -> Array:
        """Each point's pixel in the camera of its own constraint, shape (n, 2)."""
        return self._projection[0]

    def pixel_jacobian(self, indices: Indices) -> Array:
        """Return the derivatives of the pixels ``indices`` (paper, eq. (22)), shape (k, 2, r)."""
        jacobian: Array = self._projection[1][indices] @ self.anchored_at(indices)[0]
        return jacobian

    def pull_back(self, indices: Indices, by_pixel: Array) -> Array:
        """Return the gradient of a cost, (r,), from its gradients ``by_pixel``, (k, 2), with respect to the pixels.

        Reverse mode: the Jacobian of the pixels is never formed. ``indices`` must not repeat.
        """
        if not len(indices):
            return np.zeros(self._anchored.rows.shape[1])
        # Points of a term lie together, so that the time does not depend on those of other terms.
        first, last = int(indices.min()), int(indices.max())
        by_point = np.zeros((last - first + 1, 3))
        by_point[indices - first] = np.einsum("ni,nij->nj", by_pixel, self._projection[1][indices])
        gradient: Array = by_point.ravel() @ self._anchored.rows[3 * first : 3 * last + 3]
        return gradient


class Term(Protocol):
    """A cost of a pose."""

    def value_and_gradient(self, state: PoseState) -> tuple[float, Array]:
        """Return the cost and its gradient with respect to the coefficients, shape (r,)."""
        ...

    def curvature(self, state: PoseState) -> Array:
        """Return a positive semi-definite estimate of the second derivative, shape (r, r)."""
        ...


class QuadraticTerm:
    """Base of terms that are quadratic forms of the coefficients. A problem sums their forms once."""

    @property
    def is_quadratic(self) -> bool:
        """True if the term is a quadratic form; subclasses override it if only some instances are."""
        return True


class ResidualTerm:
    """A weighted sum of squared residuals, sum over i of w_i r_i(p)^2.

    Subclasses implement the residuals and their derivatives, and override ``pull_back`` if the product with the
    derivatives can be computed without forming them.
    """

    def __init__(self, weights: Sequence[float] | Array) -> None:
        """Store the ``weights`` w of the residuals: inverse variances times the weight that the user set."""
        self.weights = np.asarray(weights, dtype=np.float64)

    def residual(self, state: PoseState) -> Array:
        """Return the residuals, shape (m,)."""
        raise NotImplementedError

    def jacobian(self, state: PoseState) -> Array:
        """Return the derivatives of the residuals with respect to the coefficients, shape (m, r)."""
        raise NotImplementedError

    def pull_back(self, state: PoseState, by_residual: Array) -> Array:
        """Return jacobian^T ``by_residual``, shape (r,), for ``by_residual`` of shape (m,)."""
        product: Array = by_residual @ self.jacobian(state)
        return product

    def value_and_gradient(self, state: PoseState) -> tuple[float, Array]:
        """Return the cost and its gradient with respect to the coefficients, shape (r,)."""
        residual = self.residual(state)
        weighted = self.weights * residual
        return float(weighted @ residual), self.pull_back(state, 2.0 * weighted)

    def linearised(self, state: PoseState) -> tuple[Array, Array]:
        """Return J, (m, r), and r, (m,), such that |J d + r|^2 approximates the cost for a change d from ``state``."""
        roots = np.sqrt(self.weights)
        return roots[:, None] * self.jacobian(state), roots * self.residual(state)

    def curvature(self, state: PoseState) -> Array:
        """Return the Gauss-Newton estimate of the second derivative, 2 J^T W J of shape (r, r)."""
        jacobian = self.jacobian(state)
        product: Array = 2.0 * (jacobian.T * self.weights) @ jacobian
        return product


def reduced(rows: Array, residual: Array) -> tuple[Array, Array]:
    """Return fewer rows and residuals with the same |``rows`` d + ``residual``|^2 for all d of shape (r,).

    Only products of the rows matter: hundreds of rows of a stroke reduce to one more than there are columns. A few more
    than these cost less than to reduce them.
    """
    if len(residual) <= _FEW_MORE * (rows.shape[1] + 1):
        return rows, residual
    upper: Array = np.asarray(np.linalg.qr(np.column_stack([rows, residual]), mode="r"))
    return upper[:, :-1], upper[:, -1]
