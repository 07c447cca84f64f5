"""What a transferred expression asks of the target's face, as terms of the problem."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from faceposer.geometry.picking import SurfacePoints
from faceposer.model.face_model import FaceModel
from faceposer.solve.term import Array, PoseState, ResidualTerm
from faceposer.transfer.pairs import Pair

# In the mesh's unit: below it two points have no direction from one to the other.
_COINCIDENT = 1e-9


class PairPoints:
    """The ends of pairs on one face: distances and their derivatives at any pose.

    What opens and closes, such as lips, is measured along the axis along which it opens: the points of a closed mouth
    nearly coincide, and the line between them then points anywhere. A distance along it would grow as well when the
    lips pass each other.
    """

    def __init__(self, model: FaceModel, pairs: Sequence[Pair], axes: Array | None = None) -> None:
        """Gather the rows of the basis at the feature points of ``pairs``, all of which ``model`` must have.

        Args:
            model: The face.
            pairs: n of them.
            axes: Unit vectors along which pairs are measured, shape (n, 3), zeros for the distance itself.
        """
        points = model.character.feature_points
        ends = [np.array([points[getattr(pair, end)] for pair in pairs], dtype=np.intp) for end in ("first", "second")]
        (rows, neutral), (other_rows, other_neutral) = (model.rows_at(SurfacePoints.at_vertices(end)) for end in ends)
        self._rows = np.ascontiguousarray(rows - other_rows)
        self._neutral = neutral - other_neutral
        self._axes = np.zeros_like(self._neutral) if axes is None else axes
        self._along = np.any(self._axes != 0.0, axis=1)

    def offsets(self, poses: ArrayLike) -> Array:
        """Return the vectors from the second point of each pair to the first, (m, n, 3), on faces ``poses``, (m, r)."""
        stacked = np.asarray(poses, dtype=np.float64) @ self._rows.reshape(-1, self._rows.shape[-1]).T
        offsets: Array = self._neutral + stacked.reshape(-1, *self._neutral.shape)
        return offsets

    def distances(self, poses: ArrayLike) -> Array:
        """Return the distances, shape (m, n), on the faces with coefficients ``poses``, shape (m, r)."""
        offsets = self.offsets(poses)
        along = np.einsum("mnd,nd->mn", offsets, self._axes)
        distances: Array = np.where(self._along, along, np.linalg.norm(offsets, axis=2))
        return distances

    def measure(self, p: Array) -> tuple[Array, Array]:
        """Return the distances, (n,), and the unit vectors along which they are measured, (n, 3), on the face ``p``.

        Where the two points coincide, a distance has no direction, and its vector is zero.
        """
        offsets = self._neutral + self._rows @ p
        lengths = np.linalg.norm(offsets, axis=1)
        directions = np.where(lengths[:, None] > _COINCIDENT, offsets, 0.0) / np.maximum(lengths, _COINCIDENT)[:, None]
        directions = np.where(self._along[:, None], self._axes, directions)
        return np.where(self._along, np.einsum("nd,nd->n", offsets, self._axes), lengths), directions

    def jacobian(self, directions: Array) -> Array:
        """Return the derivatives of the distances by p, (n, r), where the pairs have the ``directions``, (n, 3)."""
        jacobian: Array = np.einsum("nd,ndr->nr", directions, self._rows)
        return jacobian


class SpaceDistanceTerm(ResidualTerm):
    """sum over i of w_i (|x_a(p) - x_b(p)| - d_i)^2 with distances in space (paper, section 4.2, without a camera)."""

    def __init__(self, ends: PairPoints, targets: ArrayLike, weights: ArrayLike) -> None:
        """Ask for the distances ``targets`` d, shape (n,), with ``weights`` w, shape (n,), in the unit of the mesh."""
        super().__init__(np.asarray(weights, dtype=np.float64))
        self._ends = ends
        self._targets = np.asarray(targets, dtype=np.float64)

    def residual(self, state: PoseState) -> Array:
        """Return distance minus target, shape (n,)."""
        return self._ends.measure(state.p)[0] - self._targets

    def jacobian(self, state: PoseState) -> Array:
        """Return the derivatives of the distances, shape (n, r)."""
        return self._ends.jacobian(self._ends.measure(state.p)[1])


class RigWeightTerm(ResidualTerm):
    """sum over j of w_j (weight_j(p) - value_j)^2: some weights of the rig keep their values."""

    def __init__(self, model: FaceModel, rows: Sequence[int], values: ArrayLike, weight: float) -> None:
        """Hold the shapes with the indices ``rows`` at ``values``, both of length m, each with ``weight``."""
        super().__init__(np.full(len(rows), weight))
        self._directions = model.subspace.directions[list(rows)]
        self._values = np.asarray(values, dtype=np.float64)

    def residual(self, state: PoseState) -> Array:
        """Return weight minus value, shape (m,)."""
        residual: Array = self._directions @ state.p - self._values
        return residual

    def jacobian(self, state: PoseState) -> Array:
        """Return the derivatives of the weights, shape (m, r)."""
        return self._directions
