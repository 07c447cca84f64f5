"""Residuals of points against the places of a target line, across and along it."""

import numpy as np

from faceposer.solve.term import Array, Indices, PoseState, ResidualTerm


class AcrossAlongTerm(ResidualTerm):
    """sum over i of a_i (n_i . (y_i - z_i))^2 + b_i (t_i . (y_i - z_i))^2.

    y_i are pixels of the face, z_i places on a line with the unit tangents t_i and normals n_i.
    """

    def __init__(self, points: Indices, targets: Array, tangents: Array, across: Array, along: Array) -> None:
        """Prepare the term.

        Args:
            points: Indices of the points in the state, shape (m,).
            targets: The places z, shape (m, 2).
            tangents: Unit tangents there, shape (m, 2).
            across: The weights a, shape (m,).
            along: The weights b, shape (m,).
        """
        self._points = points
        self._targets = targets
        normals = tangents[:, ::-1] * (-1.0, 1.0)
        self._frames = np.stack([normals, tangents], axis=1)
        super().__init__(np.stack([across, along], axis=1).ravel())

    def residual(self, state: PoseState) -> Array:
        """Return the offsets across and along the target, shape (2 m,)."""
        return np.einsum("mij,mj->mi", self._frames, state.pixels[self._points] - self._targets).ravel()

    def jacobian(self, state: PoseState) -> Array:
        """Return the derivatives of the offsets, shape (2 m, r)."""
        jacobian = self._frames @ state.pixel_jacobian(self._points)
        return jacobian.reshape(-1, jacobian.shape[-1])

    def pull_back(self, state: PoseState, by_residual: Array) -> Array:
        """Return jacobian^T ``by_residual``, shape (r,)."""
        return state.pull_back(self._points, np.einsum("mij,mi->mj", self._frames, by_residual.reshape(-1, 2)))
