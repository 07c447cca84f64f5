"""All kinds of constraints, by the name that the session file gives them."""

from collections.abc import Sequence
from typing import Any, ClassVar, Protocol, Self

import numpy as np
from numpy.typing import NDArray

from faceposer.errors import FacePoserError
from faceposer.geometry.camera import Camera
from faceposer.geometry.picking import SurfacePoint
from faceposer.solve.constraints import codec
from faceposer.solve.constraints.point import PointConstraint
from faceposer.solve.term import Array, Indices, Term


class Constraint(Protocol):
    """What every kind of constraint offers; see ``PointConstraint``."""

    kind: ClassVar[str]

    @property
    def camera(self) -> Camera:
        """The camera under which the constraint was drawn."""
        ...

    @property
    def weight(self) -> float:
        """Factor on the constraint's energy, at least 0."""
        ...

    @property
    def enabled(self) -> bool:
        """Whether the constraint counts."""
        ...

    def surface_points(self, triangles: NDArray[np.integer]) -> tuple[SurfacePoint, ...]:
        """Return the points of the surface that the constraint speaks of."""
        ...

    def residual_px(self, pixels: Array) -> float:
        """Return how far the constraint is from being met, given the pixels, shape (n, 2), of its points."""
        ...

    @staticmethod
    def term(constraints: Sequence[Any], points: Sequence[Indices]) -> Term:
        """Return one term for all ``constraints`` of this kind, whose points have the indices ``points``."""
        ...

    def to_json(self) -> dict[str, Any]:
        """Return the constraint as the session file has it."""
        ...

    @classmethod
    def from_json(cls, data: dict[str, Any], where: str) -> Self:
        """Return the constraint that ``data`` describes."""
        ...


CONSTRAINTS: dict[str, type[Constraint]] = {kind.kind: kind for kind in (PointConstraint,)}


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
        raise FacePoserError(f"{where}.type is {codec.shown(name)}; the types are {known}.")
    return CONSTRAINTS[name].from_json(data, where)
