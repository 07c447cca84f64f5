"""Constraint that holds points of the face in place (Lau et al. 2009, section 4.5)."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
from msgspec import UNSET, UnsetType
from numpy.typing import ArrayLike

from faceposer.errors import counted
from faceposer.files.json_documents import JsonError, convert
from faceposer.geometry.alignment import Similarity
from faceposer.geometry.mirror import SurfaceMirror
from faceposer.geometry.picking import SurfacePoints
from faceposer.model.face_model import FaceModel
from faceposer.solve.constraints import codec
from faceposer.solve.constraints.base import ConstraintBase, ConstraintJson, PlaceNames
from faceposer.solve.constraints.point import SIGMA_PX
from faceposer.solve.term import Array, Indices, PoseState, QuadraticTerm, Term

#: Pixels per centimetre in an ordinary view, to compare distances in space with distances in an image.
PX_PER_CM = 25.0
# Largest number of points as which all fixed vertices together count, since neighbours are redundant.
_AS_MANY_POINTS = 20


class _FixedJson(ConstraintJson, kw_only=True):
    anchors: codec.Anchors
    positions: list[codec.Triple] | UnsetType = UNSET

    def __post_init__(self) -> None:
        if self.positions is not UNSET and len(self.positions) != len(self.anchors):
            raise JsonError(f"must be a list of {counted(len(self.anchors), 'position')}, one per anchor", "positions")


@dataclass(frozen=True, eq=False)
class FixedConstraint(ConstraintBase):
    """Holds the points ``anchors`` of the face at ``positions``.

    Attributes:
        anchors: Points of the surface, usually at vertices.
        positions: Positions to hold, shape (n, 3), in the unit of the mesh; None in a file without them, which stands
            for the positions on the face that editing starts from.
    """

    kind: ClassVar[str] = "fixed"
    noun: ClassVar[str] = "fixed area"
    icon: ClassVar[str] = "fix"
    camera: ClassVar[None] = None

    anchors: SurfacePoints
    positions: Array | None = None

    def __post_init__(self) -> None:
        if self.positions is not None:
            positions = np.array(self.positions, dtype=np.float64).reshape(-1, 3)
            if len(positions) != len(self.points):
                raise ValueError(
                    f"{counted(len(positions), 'position')} do not match {counted(len(self.points), 'point')}"
                )
            positions.setflags(write=False)
            object.__setattr__(self, "positions", positions)

    @property
    def points(self) -> SurfacePoints:
        """The fixed points of the surface."""
        return self.anchors

    def __eq__(self, other: object) -> bool:
        return self is other or (
            isinstance(other, FixedConstraint)
            and self.points == other.points
            and np.array_equal(self._targets, other._targets)
            and self.switches_to_json() == other.switches_to_json()
        )

    def __hash__(self) -> int:
        return hash((self.points, self.weight, self.enabled, self.locked))

    @property
    def _targets(self) -> Array:
        return np.zeros((0, 3)) if self.positions is None else self.positions

    def rebound(self, places: SurfacePoints | None, frame: Similarity, shift: Array) -> "FixedConstraint":
        """Return the constraint at ``places`` of another version of the character, with transformed positions.

        Offsets from the neutral face are scaled to the other version. Places that coincide are merged.
        """
        assert places is not None
        _, kept = np.unique(np.column_stack([places.faces, places.barycentric.round(9)]), axis=0, return_index=True)
        kept.sort()
        positions = None if self.positions is None else (frame.apply(self.positions) + shift)[kept]
        return replace(self, anchors=places.subset(kept), positions=positions, rest=None)

    def resolved(self, model: FaceModel, p: ArrayLike) -> "FixedConstraint":
        """Return the constraint with positions, taken from the face ``p``, shape (r,), if it has none.

        Raises:
            ValueError: If its points do not lie on the face.
        """
        self.points.check(model.triangles)
        return self if self.positions is not None else replace(self, positions=model.positions_at(self.points, p))

    def place(self, names: PlaceNames) -> str:
        """Return the name of the fixed area."""
        return names.area(self.points)

    def residual_px(self, model: FaceModel, p: ArrayLike) -> float:
        """Return the mean displacement of the points of the face ``p``, in pixels of an ordinary view."""
        if self.positions is None or not len(self.points):
            return 0.0
        offsets = model.positions_at(self.points, p) - self.positions
        return PX_PER_CM * float(np.linalg.norm(offsets, axis=1).mean())

    @staticmethod
    def terms(constraints: Sequence["FixedConstraint"], slots: Sequence[Indices], model: FaceModel) -> list[Term]:
        """Return a term for each of ``constraints``; they are defined in space and have no points in the state."""
        return [FixedTerm(constraint, model) for constraint in constraints if len(constraint.points)]

    def mirrored(self, mirror: SurfaceMirror, model: FaceModel, p: ArrayLike) -> "FixedConstraint | None":
        """Return the constraint that fixes the mirrored points on the face ``p``, or None if there are none."""
        opposite = mirror.points(self.points)
        if opposite is None:
            return None
        return replace(self, anchors=opposite, positions=model.positions_at(opposite, p), locked=False)

    def to_json(self) -> dict[str, Any]:
        """Return the JSON form of the constraint."""
        data: dict[str, Any] = {"type": self.kind, "anchors": codec.points_to_json(self.points)}
        if self.positions is not None:
            data["positions"] = self.positions.tolist()
        return data | self.switches_to_json()

    @classmethod
    def from_json(cls, data: dict[str, Any], where: str) -> "FixedConstraint":
        """Return the constraint that ``data`` describes.

        Raises:
            FacePoserError: If a key is unknown, missing or of the wrong type; ``where`` names the place.
        """
        form = convert(data, _FixedJson, where)
        positions = None if form.positions is UNSET else np.array(form.positions)
        return cls(codec.points_of(form.anchors), positions, **form.switches)


class FixedTerm(QuadraticTerm):
    """w m / n sum over i of |x_i(p) - x_i,original|^2 / sigma^2 (paper, eqs. (15) and (30); (30) lacks a factor 2).

    Positions are linear in p, so that the energy is a quadratic form with a matrix that is computed once for a set of
    points: an evaluation costs the same for ten vertices and for ten thousand. n vertices count as m = min(n, 20)
    points, so that the density of the mesh does not affect the strength.
    """

    def __init__(self, constraint: FixedConstraint, model: FaceModel) -> None:
        """Prepare the term for ``constraint``."""
        points = constraint.points
        rows, neutral = model.jacobian_at(points)
        flat = rows.reshape(-1, rows.shape[-1])
        offset = (neutral - (neutral if constraint.positions is None else constraint.positions)).ravel()
        scale = constraint.weight * min(len(points), _AS_MANY_POINTS) / len(points) * (PX_PER_CM / SIGMA_PX) ** 2
        self._matrix = scale * model.jacobian_gram_at(points)
        self._slope = scale * (offset @ flat)
        self._constant = scale * float(offset @ offset)

    def value_and_gradient(self, state: PoseState) -> tuple[float, Array]:
        """Return the energy and its gradient with respect to the coefficients, shape (r,)."""
        product = self._matrix @ state.p
        value = float(state.p @ product + 2.0 * (self._slope @ state.p)) + self._constant
        return max(value, 0.0), 2.0 * (product + self._slope)

    def curvature(self, state: PoseState) -> Array:
        """Return the second derivative, shape (r, r)."""
        return 2.0 * self._matrix
