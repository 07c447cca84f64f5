"""Unknowns of a fit to photos, and the normal equations of a step.

The head is shared by all photos; each photo has a pose, a camera and errors of its landmarks. Segments of the face with
coefficients of their own, and the texture, follow the head.
"""

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve

from faceposer.identity.photos.face_camera import N_CAMERA, FaceCamera

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class ViewState:
    """What a photo shows.

    Attributes:
        pose: p, coefficients of the expression, shape (r,).
        camera: The camera.
        errors: z, coefficients of the errors of its landmarks, shape (q,).
    """

    pose: Array
    camera: FaceCamera
    errors: Array


@dataclass(frozen=True, eq=False)
class FitState:
    """A head in photos.

    Attributes:
        shape: b, coefficients of the head, shape (K,).
        texture: Coefficients of its texture, shape (T,).
        views: One for each photo.
    """

    shape: Array
    texture: Array
    views: tuple[ViewState, ...]

    def moved(self, layout: "Layout", step: Array) -> "FitState":
        """Return the state after a ``step`` of all unknowns."""
        views = []
        for number, view in enumerate(self.views):
            at = layout.view(number)
            views.append(
                ViewState(view.pose + step[at.pose], view.camera.moved(step[at.camera]), view.errors + step[at.errors])
            )
        return replace(
            self,
            shape=self.shape + step[layout.shape],
            texture=self.texture + step[layout.texture],
            views=tuple(views),
        )


@dataclass(frozen=True)
class ViewSlices:
    """Where the unknowns of a photo are in a step."""

    pose: slice
    camera: slice
    errors: slice


@dataclass(frozen=True)
class Layout:
    """Order of the unknowns in a step: head, texture, then pose, camera and errors of each photo.

    Attributes:
        n_shape, n_texture, n_pose, n_errors, n_views: Their numbers, of a photo each for pose and errors.
    """

    n_shape: int
    n_texture: int
    n_pose: int
    n_errors: int
    n_views: int

    @classmethod
    def of(cls, state: FitState) -> "Layout":
        """Return the layout of ``state``."""
        first = state.views[0]
        return cls(len(state.shape), len(state.texture), len(first.pose), len(first.errors), len(state.views))

    @property
    def size(self) -> int:
        """Number of unknowns."""
        return self.view(self.n_views - 1).errors.stop

    @property
    def shape(self) -> slice:
        """The head."""
        return slice(0, self.n_shape)

    @property
    def texture(self) -> slice:
        """The texture."""
        return slice(self.n_shape, self.n_shape + self.n_texture)

    def view(self, number: int) -> ViewSlices:
        """Return the places of the unknowns of photo ``number``."""
        start = self.n_shape + self.n_texture + number * (self.n_pose + N_CAMERA + self.n_errors)
        pose, camera = start + self.n_pose, start + self.n_pose + N_CAMERA
        return ViewSlices(slice(start, pose), slice(pose, camera), slice(camera, camera + self.n_errors))


@dataclass(eq=False)
class NormalEquations:
    """Sums of the curvature and the slope of a cost over its terms.

    Attributes:
        layout: The order of the unknowns.
        matrix: Curvature, shape (n, n).
        slope: Derivatives, shape (n,).
    """

    layout: Layout
    matrix: Array = field(init=False)
    slope: Array = field(init=False)

    def __post_init__(self) -> None:
        n = self.layout.size
        self.matrix, self.slope = np.zeros((n, n)), np.zeros(n)

    def add_rows(self, rows: Array, residual: Array, where: list[slice]) -> None:
        """Add half the sum of squares of residuals, (m,), with derivatives ``rows``, (m, k), by unknowns ``where``."""
        indices = np.concatenate([np.arange(at.start, at.stop) for at in where])
        self.matrix[np.ix_(indices, indices)] += rows.T @ rows
        self.slope[indices] += rows.T @ residual

    def add_products(self, matrix: Array, slope: Array, where: list[slice]) -> None:
        """Add curvature, (k, k), and derivatives, (k,), by the unknowns ``where``."""
        indices = np.concatenate([np.arange(at.start, at.stop) for at in where])
        self.matrix[np.ix_(indices, indices)] += matrix
        self.slope[indices] += slope

    def add_block(self, at: slice, slope: Array, curvature: Array | float) -> None:
        """Add a term of the unknowns ``at`` alone; a number stands for a multiple of the unit matrix."""
        n = at.stop - at.start
        self.slope[at] += slope
        self.matrix[at, at] += curvature if isinstance(curvature, np.ndarray) else curvature * np.eye(n)

    def step(self, damping: float) -> Array:
        """Return the step to the minimum, with the curvature's diagonal enlarged by the share ``damping``."""
        damped = self.matrix + np.diag(damping * np.diag(self.matrix) + 1e-9)
        result: Array = -cho_solve(cho_factor(damped), self.slope)
        return result
