"""All kinds of constraints, by the name that the session file gives them."""

from collections.abc import Sequence
from typing import Any, ClassVar, Protocol, Self

from numpy.typing import ArrayLike

from faceposer.errors import FacePoserError
from faceposer.files.json_documents import shown
from faceposer.geometry.alignment import Similarity
from faceposer.geometry.camera import Camera
from faceposer.geometry.mirror import SurfaceMirror
from faceposer.geometry.picking import SurfacePoints
from faceposer.model.face_model import FaceModel
from faceposer.solve.constraints import codec
from faceposer.solve.constraints.base import PlaceNames
from faceposer.solve.constraints.curve import CurveConstraint
from faceposer.solve.constraints.distance import DistanceConstraint
from faceposer.solve.constraints.fixed import FixedConstraint
from faceposer.solve.constraints.gaze import GazeConstraint
from faceposer.solve.constraints.point import PointConstraint
from faceposer.solve.constraints.stroke import StrokeConstraint
from faceposer.solve.term import Array, Indices, Term


class Constraint(Protocol):
    """What every kind of constraint offers; see ``PointConstraint``."""

    kind: ClassVar[str]
    noun: ClassVar[str]
    icon: ClassVar[str]
    informs_prior: ClassVar[bool]

    @property
    def camera(self) -> Camera | None:
        """The camera under which the constraint was drawn, or None where it speaks of places in space."""
        ...

    @property
    def weight(self) -> float:
        """Factor on the constraint's energy, at least 0."""
        ...

    @property
    def enabled(self) -> bool:
        """Whether the constraint counts."""
        ...

    @property
    def locked(self) -> bool:
        """Whether the constraint is safe from being moved or removed by hand."""
        ...

    @property
    def points(self) -> SurfacePoints:
        """The points of the surface that the constraint speaks of."""
        ...

    @property
    def rest(self) -> Array | None:
        """Rest positions of ``places``, shape (n, 3), in a file; None while the constraint is edited."""
        ...

    @property
    def places(self) -> SurfacePoints | None:
        """The points of the surface that a file stores for the constraint, or None where it stores none."""
        ...

    def with_rest(self, model: FaceModel) -> Self:
        """Return the constraint as a file keeps it, with the rest positions of its ``places``."""
        ...

    def without_rest(self) -> Self:
        """Return the constraint as it is edited, without rest positions."""
        ...

    def rebound(self, places: SurfacePoints | None, frame: Similarity, shift: Array) -> Self:
        """Return the constraint at ``places`` of another version of the character; see ``ConstraintBase.rebound``."""
        ...

    def resolved(self, model: FaceModel, p: ArrayLike) -> Self:
        """Return the constraint with all that a file may leave out looked up on the face ``p``, shape (r,).

        Raises:
            ValueError: If it names places that the face does not have.
        """
        ...

    def moved_start(self, model: FaceModel, start: Array) -> Array:
        """Return the pose that the face has before any energy pulls at it, given ``start``, each (r,)."""
        ...

    def residual_px(self, model: FaceModel, p: ArrayLike) -> float:
        """Return how far the constraint is from being met by the face ``p``, shape (r,), in pixels."""
        ...

    def residual_at(self, pixels: Array, model: FaceModel, p: ArrayLike) -> float:
        """Return ``residual_px``, given where the points of the constraint appear, shape (n, 2)."""
        ...

    @staticmethod
    def terms(constraints: Sequence[Any], slots: Sequence[Indices], model: FaceModel) -> list[Term]:
        """Return the terms of all ``constraints`` of this kind, whose points have the indices ``slots``."""
        ...

    def mirrored(self, mirror: SurfaceMirror, model: FaceModel, p: ArrayLike) -> Self | None:
        """Return what does the same on the other side of the face ``p``, or None where there is no such thing."""
        ...

    def nudged(self, offset: tuple[float, float]) -> Self | None:
        """Return the constraint with its target moved by ``offset`` pixels of its camera, or None if it has none."""
        ...

    def place(self, names: PlaceNames) -> str:
        """Return the name of the place that the constraint speaks of."""
        ...

    def to_json(self) -> dict[str, Any]:
        """Return the constraint as the session file has it."""
        ...

    @classmethod
    def from_json(cls, data: dict[str, Any], where: str) -> Self:
        """Return the constraint that ``data`` describes."""
        ...


CONSTRAINTS: dict[str, type[Constraint]] = {
    kind.kind: kind
    for kind in (
        PointConstraint,
        DistanceConstraint,
        StrokeConstraint,
        CurveConstraint,
        FixedConstraint,
        GazeConstraint,
    )
}


def register(kind: type[Constraint]) -> None:
    """Make ``kind`` known to sessions, the solver and the window.

    Raises:
        ValueError: If there is a kind of that name.
    """
    if kind.kind in CONSTRAINTS:
        raise ValueError(f"there is a kind of constraint '{kind.kind}'")
    CONSTRAINTS[kind.kind] = kind


def constraint_from_json(data: Any, where: str) -> Constraint:
    """Return the constraint that ``data`` describes; ``where`` is its place in the file.

    Raises:
        FacePoserError: If the kind is unknown or its data is wrong.
    """
    if not isinstance(data, dict) or "type" not in data:
        raise FacePoserError(f"{where} must be an object with a 'type'.")
    name = data["type"]
    if not isinstance(name, str) or name not in CONSTRAINTS:
        known = ", ".join(f"'{kind}'" for kind in CONSTRAINTS)
        raise FacePoserError(f"{where}.type is {shown(name)}; the types are {known}.")
    constraint = CONSTRAINTS[name].from_json(data, where)
    codec.check_rest(constraint.rest, constraint.places, where)
    return constraint
