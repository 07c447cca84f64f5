"""Dragging of points of a head: the identity that brings a point to a pixel, by the statistics of heads.

With b_s the coefficients of the segments at the start of the drag, the change Δ minimises

    E(Δ) = Σ_i g ‖u_i - P(x_i + J_i Δ)‖² + Σ_s ‖Δ_s‖² + κ Σ_s ‖Δ_s - Δ̄‖² + Σ_j h_j ‖J_j Δ‖²

by Gauss-Newton steps: the points x_i come to their pixels u_i through the camera P (weight g); the head changes in the
way that is most likely by the density of heads about the present one (Blanz and Vetter 1999, eq. (2)); κ holds the
segments together; and places j of the skin stay where they are, the more (h_j) the farther they are from the points. It
is the maximum a posteriori estimate of the pose solver, over identities in place of expressions.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from faceposer.geometry.camera import Camera
from faceposer.geometry.picking import SurfacePoints
from faceposer.identity.editing import HeadEditor
from faceposer.identity.identity import Identity

Array = NDArray[np.float64]

# Tolerances of a dragged point in pixels, and of places that stay, in centimetres.
_PIXELS, _HOLD = 0.3, 0.4
# Distance in centimetres from the points within which the head follows, with the spread at 0 and at 1.
_REACH = (2.5, 12.0)
# Stiffness between segments with the spread at 0 and at 1.
_TOGETHER = (0.05, 5.0)
# Every so many control vertices hold the head.
_EVERY = 12
_STEPS = 3
# Standard deviations along a drag up to which the head follows wholly, and by how many more it can go.
_NATURAL, _BEYOND = 3.0, 2.0


class HeadDrag:
    """A drag of points of the skin.

    Attributes:
        identity: The head at the start.
        positions: Positions of the points on the posed face at the start, shape (n, 3).
    """

    def __init__(
        self,
        editor: HeadEditor,
        identity: Identity,
        points: SurfacePoints,
        positions: Array,
        free: Sequence[bool] | None = None,
        spread: float = 0.3,
        symmetric: bool = False,
    ) -> None:
        """Begin a drag.

        Args:
            editor: Editor of the character.
            identity: The present head.
            points: The points that are dragged, on the skin, n of them.
            positions: Their positions on the posed face, shape (n, 3).
            free: Segments that may change; all if None.
            spread: Share of the head that follows, 0 to 1.
            symmetric: Both sides change alike: only modes that are their own mirror images are used.

        Raises:
            ValueError: If a point is not on the skin, or no segment is free.
        """
        self.identity = identity
        self._editor, self.positions = editor, np.asarray(positions, dtype=np.float64)
        self._free = np.ones(len(editor.segment_names), dtype=bool) if free is None else np.array(free, dtype=bool)
        if not self._free.any():
            raise ValueError("no segment is free")
        self._basis = editor.model.basis
        self._modes = np.arange(len(self._basis))
        if symmetric:
            self._modes = np.flatnonzero(editor.symmetric_modes)
            self._basis = self._basis[self._modes]
        n_control = editor.template.n_control
        rows = editor.control_weights(points)
        self._rows = self._jacobian(rows)
        held = np.arange(0, n_control, _EVERY)
        control = editor.control(identity)
        distances = np.linalg.norm(control[held][:, None] - (rows @ control)[None], axis=2).min(axis=1)
        reach = np.interp(spread, (0.0, 1.0), _REACH)
        stiffness = (
            (1.0 - spread) * (1.0 - np.exp(-((distances / reach) ** 2))) * editor.attributes.alignment_weights[held]
        )
        together = np.interp(spread, (0.0, 1.0), _TOGETHER)
        # The number of equations is small: the matrix inversion lemma needs the prior's inverse, once.
        self._inverse_prior = np.linalg.inv(self._prior(held, stiffness, float(together)))

    def _jacobian(self, weights: Array) -> Array:
        """Return the derivatives of places, (n, C) weights of control vertices, with respect to Δ, (n, 3, s K)."""
        editor = self._editor
        used = np.flatnonzero(weights.any(axis=0))
        basis, shares = self._basis[:, used], editor.segments.weights[self._free][:, used]
        moves = np.einsum("nc,sc,kcd->ndsk", weights[:, used], shares, basis, optimize=True)
        flat = moves.reshape(len(weights), 3, -1)
        turned: Array = np.einsum("de,nek->ndk", editor.rotation, flat)
        return turned

    def _prior(self, held: NDArray[np.intp], stiffness: Array, together: float) -> Array:
        """Return the matrix of the terms that do not depend on the points, shape (s K, s K)."""
        shares = self._editor.segments.weights[self._free]
        s, k = len(shares), len(self._basis)
        root = np.sqrt(stiffness)[:, None] / _HOLD
        basis = (self._basis[:, held] * root).reshape(k, len(held), 3)
        rows = np.einsum("sc,kcd->skcd", shares[:, held], basis, optimize=True).reshape(s * k, -1)
        # I + κ (I - 1 1ᵀ / s) between the segments.
        between = (1.0 + together) * np.eye(s) - together / s
        prior: Array = rows @ rows.T + np.kron(between, np.eye(k))
        return prior

    def moved_to(self, pixels: Array, camera: Camera) -> Identity:
        """Return the head with the points at ``pixels``, shape (n, 2), of ``camera``, as far as heads go there."""
        change = np.zeros(self._rows.shape[2])
        for _ in range(_STEPS):
            projected, derivatives = camera.project_with_jacobian(self.positions + self._rows @ change)
            rows = (derivatives @ self._rows).reshape(-1, len(change)) / _PIXELS
            residuals = (pixels - projected).ravel() / _PIXELS + rows @ change
            gain = self._inverse_prior @ rows.T
            change = gain @ np.linalg.solve(rows @ gain + np.eye(len(rows)), residuals)
        change *= self._natural_share(change)
        shape = self.identity.shape.copy()
        shape[np.ix_(self._free, self._modes)] += change.reshape(int(self._free.sum()), -1)
        return Identity(shape, self.identity.detail_steps, self.identity.texture)

    def _natural_share(self, change: Array) -> float:
        """Return the factor on a ``change`` of shape (s K,) that keeps the head within what heads do.

        In the segment that changes most, z standard deviations along the change, counted from the average head, become
        z if they are few, and approach a limit otherwise.
        """
        rows = change.reshape(int(self._free.sum()), -1)
        most = int(np.square(rows).sum(axis=1).argmax())
        length = float(np.linalg.norm(rows[most]))
        if length <= 0.0:
            return 1.0
        begun = float(self.identity.shape[np.flatnonzero(self._free)[most], self._modes] @ rows[most]) / length
        reached = begun + length
        beyond = reached - max(_NATURAL, begun)
        if beyond <= 0.0:
            return 1.0
        return (length - beyond + _BEYOND * float(np.tanh(beyond / _BEYOND))) / length
