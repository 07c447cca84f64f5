"""Points of the face that should stay where they were (Lau et al. 2009, section 4.5)."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
from msgspec import UNSET, UnsetType
from numpy.typing import ArrayLike

from faceposer.files.json_documents import JsonError, convert
from faceposer.geometry.alignment import Similarity
from faceposer.geometry.mirror import SurfaceMirror
from faceposer.geometry.picking import SurfacePoints
from faceposer.model.face_model import FaceModel
from faceposer.solve.constraints import codec
from faceposer.solve.constraints.base import ConstraintBase, ConstraintJson, PlaceNames
from faceposer.solve.constraints.point import SIGMA_PX
from faceposer.solve.term import Array, Indices, PoseState, QuadraticTerm, Term

#: How many pixels a centimetre takes in an ordinary view: a distance in space counts like one in such a picture.
PX_PER_CM = 25.0
# Held vertices are neighbours and tell much the same: all together count as this many points at most.
_AS_MANY_POINTS = 20


class _FixedJson(ConstraintJson, kw_only=True):
    anchors: codec.Anchors
    positions: list[codec.Triple] | UnsetType = UNSET

    def __post_init__(self) -> None:
        if self.positions is not UNSET and len(self.positions) != len(self.anchors):
            raise JsonError(f"must be a list of {len(self.anchors)} positions, one per anchor", "positions")


@dataclass(frozen=True, eq=False)
class FixedConstraint(ConstraintBase):
    """The points ``anchors`` of the face stay at ``positions``.

    Attributes:
        anchors: Usually at vertices.
        positions: Where they were when they were fixed, shape (n, 3), in the unit of the mesh; None in a file that
            does not say, where it means the face that editing starts from.
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
                raise ValueError(f"{len(positions)} positions do not go with {len(self.points)} points")
            positions.setflags(write=False)
            object.__setattr__(self, "positions", positions)

    @property
    def points(self) -> SurfacePoints:
        """The points of the surface that are held."""
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
        """Return the constraint at ``places`` of another version of the character, its positions moved likewise.

        Offsets from the neutral face are kept, in the size of the other version. A vertex that several places came to
        is held once.
        """
        assert places is not None
        _, kept = np.unique(np.column_stack([places.faces, places.barycentric.round(9)]), axis=0, return_index=True)
        kept.sort()
        positions = None if self.positions is None else (frame.apply(self.positions) + shift)[kept]
        return replace(self, anchors=places.subset(kept), positions=positions, rest=None)

    def resolved(self, model: FaceModel, p: ArrayLike) -> "FixedConstraint":
        """Return the constraint with positions: its own, or else those of the face ``p``, shape (r,).

        Raises:
            ValueError: If its points do not lie on the face.
        """
        self.points.check(model.triangles)
        return self if self.positions is not None else replace(self, positions=model.positions_at(self.points, p))

    def place(self, names: PlaceNames) -> str:
        """Return the name of the area that is held."""
        return names.area(self.points)

    def residual_px(self, model: FaceModel, p: ArrayLike) -> float:
        """Return how far the points of the face ``p`` are off on average, in the pixels of an ordinary view."""
        if self.positions is None or not len(self.points):
            return 0.0
        offsets = model.positions_at(self.points, p) - self.positions
        return PX_PER_CM * float(np.linalg.norm(offsets, axis=1).mean())

    @staticmethod
    def terms(constraints: Sequence["FixedConstraint"], slots: Sequence[Indices], model: FaceModel) -> list[Term]:
        """Return a term for each of ``constraints``; they lie in space and need no place in the state."""
        return [FixedTerm(constraint, model) for constraint in constraints if len(constraint.points)]

    def mirrored(self, mirror: SurfaceMirror, model: FaceModel, p: ArrayLike) -> "FixedConstraint | None":
        """Return the constraint that holds what lies across where it is on the face ``p``, or None."""
        across = mirror.points(self.points)
        if across is None:
            return None
        return replace(self, anchors=across, positions=model.positions_at(across, p), locked=False)

    def to_json(self) -> dict[str, Any]:
        """Return the constraint as the session file has it."""
        data: dict[str, Any] = {"type": self.kind, "anchors": codec.points_to_json(self.points)}
        if self.positions is not None:
            data["positions"] = self.positions.tolist()
        return data | self.switches_to_json()

    @classmethod
    def from_json(cls, data: dict[str, Any], where: str) -> "FixedConstraint":
        """Return the constraint that ``data`` describes.

        Raises:
            FacePoserError: If a key is unknown, missing or of the wrong kind; ``where`` names the place.
        """
        form = convert(data, _FixedJson, where)
        positions = None if form.positions is UNSET else np.array(form.positions)
        return cls(codec.points_of(form.anchors), positions, **form.switches)


class FixedTerm(QuadraticTerm):
    """w m / n sum over i of |x_i(p) - x_i,original|^2 / sigma^2 (paper, eqs. (15) and (30); (30) lacks a factor 2).

    Positions are linear in p, so that the energy is a quadratic form whose matrix is gathered once for a set of points:
    an evaluation costs the same for ten vertices and for ten thousand. n vertices count as m = min(n, 20) points, so
    that painting a region more densely does not hold it harder.
    """

    def __init__(self, constraint: FixedConstraint, model: FaceModel) -> None:
        """Prepare the term for ``constraint``."""
        points = constraint.points
        rows, neutral = model.rows_at(points)
        flat = rows.reshape(-1, rows.shape[-1])
        offset = (neutral - (neutral if constraint.positions is None else constraint.positions)).ravel()
        scale = constraint.weight * min(len(points), _AS_MANY_POINTS) / len(points) * (PX_PER_CM / SIGMA_PX) ** 2
        self._matrix = scale * model.gram_at(points)
        self._slope = scale * (offset @ flat)
        self._constant = scale * float(offset @ offset)

    def value_and_gradient(self, state: PoseState) -> tuple[float, Array]:
        """Return the energy and its gradient with respect to the coefficients, shape (r,)."""
        pulled = self._matrix @ state.p
        value = float(state.p @ pulled + 2.0 * (self._slope @ state.p)) + self._constant
        return max(value, 0.0), 2.0 * (pulled + self._slope)

    def curvature(self, state: PoseState) -> Array:
        """Return the second derivative, shape (r, r)."""
        return 2.0 * self._matrix
