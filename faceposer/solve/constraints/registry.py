"""Registry of all kinds of constraints, by their names in session files."""

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
from faceposer.solve.constraints.sketch import SketchConstraint
from faceposer.solve.constraints.stroke import StrokeConstraint
from faceposer.solve.term import Array, Indices, Term


class Constraint(Protocol):
    """Interface of all kinds of constraints; see ``PointConstraint`` for an example."""

    kind: ClassVar[str]
    noun: ClassVar[str]
    icon: ClassVar[str]
    informs_prior: ClassVar[bool]
    notable_px: ClassVar[float]

    @property
    def camera(self) -> Camera | None:
        """The camera under which the constraint was drawn, or None if it is defined in space."""
        ...

    @property
    def weight(self) -> float:
        """Factor on the constraint's energy, at least 0."""
        ...

    @property
    def enabled(self) -> bool:
        """True if the constraint is active."""
        ...

    @property
    def locked(self) -> bool:
        """True if the constraint cannot be moved or removed by hand."""
        ...

    @property
    def points(self) -> SurfacePoints:
        """The constrained points of the surface."""
        ...

    @property
    def rest(self) -> Array | None:
        """Rest positions of ``places``, shape (n, 3), in a file; None while the constraint is edited."""
        ...

    @property
    def places(self) -> SurfacePoints | None:
        """The points of the surface that a file stores for the constraint, or None if it stores none."""
        ...

    def with_rest(self, model: FaceModel) -> Self:
        """Return the constraint as stored in a file, with the rest positions of its ``places``."""
        ...

    def without_rest(self) -> Self:
        """Return the constraint for editing, without rest positions."""
        ...

    def rebound(self, places: SurfacePoints | None, frame: Similarity, shift: Array) -> Self:
        """Return the constraint at ``places`` of another version of the character; see ``ConstraintBase.rebound``."""
        ...

    def resolved(self, model: FaceModel, p: ArrayLike) -> Self:
        """Return the constraint with everything that a file may omit determined on the face ``p``, shape (r,).

        Raises:
            ValueError: If it refers to points that the face does not have.
        """
        ...

    def offset_start(self, model: FaceModel, start: Array) -> Array:
        """Return the ``start`` pose, (r,), with the offset that the constraint adds to it before the solve."""
        ...

    def residual_px(self, model: FaceModel, p: ArrayLike) -> float:
        """Return the residual of the constraint on the face ``p``, shape (r,), in pixels."""
        ...

    def residual_at(self, pixels: Array, model: FaceModel, p: ArrayLike) -> float:
        """Return ``residual_px``, given the projected ``pixels`` of the constraint's points, shape (n, 2)."""
        ...

    @staticmethod
    def terms(constraints: Sequence[Any], slots: Sequence[Indices], model: FaceModel) -> list[Term]:
        """Return the terms of ``constraints`` of this kind; ``slots`` are the indices of their points in the state."""
        ...

    def mirrored(self, mirror: SurfaceMirror, model: FaceModel, p: ArrayLike) -> Self | None:
        """Return the mirrored constraint for the face ``p``, or None if it has no mirror image."""
        ...

    def nudged(self, offset: tuple[float, float]) -> Self | None:
        """Return the constraint with its target moved by ``offset`` pixels of its camera, or None without a target."""
        ...

    def place(self, names: PlaceNames) -> str:
        """Return the name of the constrained place."""
        ...

    def to_json(self) -> dict[str, Any]:
        """Return the JSON form of the constraint."""
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
        SketchConstraint,
    )
}


def register(kind: type[Constraint]) -> None:
    """Register ``kind`` with sessions, the solver and the window.

    Raises:
        ValueError: If a kind of that name is already registered.
    """
    if kind.kind in CONSTRAINTS:
        raise ValueError(f"the kind of constraint '{kind.kind}' is already registered")
    CONSTRAINTS[kind.kind] = kind


def constraint_from_json(data: Any, where: str) -> Constraint:
    """Return the constraint that ``data`` describes; ``where`` is its place in the file.

    Raises:
        FacePoserError: If the kind is unknown or its data are invalid.
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
