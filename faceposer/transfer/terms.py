"""Energy terms for the target of a transfer."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from faceposer.geometry.picking import SurfacePoints
from faceposer.model.face_model import FaceModel
from faceposer.solve.term import Array, PoseState, ResidualTerm
from faceposer.transfer.pairs import Pair

# Points closer than this, in the unit of the mesh, have no direction between them.
_COINCIDENT = 1e-9


class PairPoints:
    """Pairs of points on one face: their distances and derivatives at any pose.

    Distances that open and close, such as those of lips, are measured along their axis of opening: the points of a
    closed mouth nearly coincide, so that the line between them has an arbitrary direction, and the distance along it
    would also grow when the lips pass through each other.
    """

    def __init__(self, model: FaceModel, pairs: Sequence[Pair], axes: Array | None = None) -> None:
        """Gather the rows of the basis at the feature points of ``pairs``, all of which ``model`` must have.

        Args:
            model: The face model.
            pairs: The n pairs.
            axes: Unit vectors along which pairs are measured, shape (n, 3), zeros for Euclidean distances.
        """
        points = model.character.feature_points
        ends = [np.array([points[getattr(pair, end)] for pair in pairs], dtype=np.intp) for end in ("first", "second")]
        (rows, neutral), (other_rows, other_neutral) = (
            model.jacobian_at(SurfacePoints.at_vertices(end)) for end in ends
        )
        self._rows = np.ascontiguousarray(rows - other_rows)
        self._neutral = neutral - other_neutral
        self._axes = np.zeros_like(self._neutral) if axes is None else axes
        self._has_axis = np.any(self._axes != 0.0, axis=1)

    def offsets(self, poses: ArrayLike) -> Array:
        """Return the vectors from the second point of each pair to the first, (m, n, 3), for ``poses``, (m, r)."""
        stacked = np.asarray(poses, dtype=np.float64) @ self._rows.reshape(-1, self._rows.shape[-1]).T
        offsets: Array = self._neutral + stacked.reshape(-1, *self._neutral.shape)
        return offsets

    def distances(self, poses: ArrayLike) -> Array:
        """Return the distances, shape (m, n), for ``poses``, shape (m, r)."""
        offsets = self.offsets(poses)
        along = np.einsum("mnd,nd->mn", offsets, self._axes)
        distances: Array = np.where(self._has_axis, along, np.linalg.norm(offsets, axis=2))
        return distances

    def measure(self, p: Array) -> tuple[Array, Array]:
        """Return the distances, (n,), and the unit vectors along which they are measured, (n, 3), for the pose ``p``.

        Coincident points have no direction: their vector is zero.
        """
        offsets = self._neutral + self._rows @ p
        lengths = np.linalg.norm(offsets, axis=1)
        directions = np.where(lengths[:, None] > _COINCIDENT, offsets, 0.0) / np.maximum(lengths, _COINCIDENT)[:, None]
        directions = np.where(self._has_axis[:, None], self._axes, directions)
        return np.where(self._has_axis, np.einsum("nd,nd->n", offsets, self._axes), lengths), directions

    def jacobian(self, directions: Array) -> Array:
        """Return the derivatives of the distances with respect to p, (n, r), for pairs with ``directions``, (n, 3)."""
        jacobian: Array = np.einsum("nd,ndr->nr", directions, self._rows)
        return jacobian


class SpaceDistanceTerm(ResidualTerm):
    """Sum over i of w_i (|x_a(p) - x_b(p)| - d_i)^2 with distances in space (paper, section 4.2, without a camera)."""

    def __init__(self, ends: PairPoints, targets: ArrayLike, weights: ArrayLike) -> None:
        """Attract the distances to ``targets`` d, (n,), in the unit of the mesh, with ``weights`` w, (n,)."""
        super().__init__(np.asarray(weights, dtype=np.float64))
        self._ends = ends
        self._targets = np.asarray(targets, dtype=np.float64)

    def residual(self, state: PoseState) -> Array:
        """Return the distances minus their targets, shape (n,)."""
        return self._ends.measure(state.p)[0] - self._targets

    def jacobian(self, state: PoseState) -> Array:
        """Return the derivatives of the distances, shape (n, r)."""
        return self._ends.jacobian(self._ends.measure(state.p)[1])


class RigWeightTerm(ResidualTerm):
    """Sum over j of w_j (weight_j(p) - value_j)^2, which keeps rig weights near given values."""

    def __init__(self, model: FaceModel, rows: Sequence[int], values: ArrayLike, weight: float) -> None:
        """Attract the weights of the shapes ``rows`` to ``values``, both of length m, each with ``weight``."""
        super().__init__(np.full(len(rows), weight))
        self._directions = model.subspace.directions[list(rows)]
        self._values = np.asarray(values, dtype=np.float64)

    def residual(self, state: PoseState) -> Array:
        """Return the weights minus their values, shape (m,)."""
        residual: Array = self._directions @ state.p - self._values
        return residual

    def jacobian(self, state: PoseState) -> Array:
        """Return the derivatives of the weights, shape (m, r)."""
        return self._directions
