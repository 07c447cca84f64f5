"""The base of all kinds of constraints: weight, switches, and what the rest of the program asks of a kind."""

from dataclasses import dataclass, field, replace
from typing import Annotated, Any, ClassVar, Protocol, Self

import numpy as np
from msgspec import UNSET, Meta, UnsetType
from numpy.typing import ArrayLike

from faceposer.files.json_documents import JsonObject
from faceposer.geometry.alignment import Similarity
from faceposer.geometry.picking import SurfacePoint, SurfacePoints
from faceposer.model.face_model import FaceModel
from faceposer.solve.constraints import codec
from faceposer.solve.term import Array

LARGEST_WEIGHT = 1e6


class PlaceNames(Protocol):
    """Names for the places of a face."""

    def name(self, point: SurfacePoint | int) -> str:
        """Return the name of a surface point or a vertex."""
        ...

    def pair(self, anchors: tuple[SurfacePoint | int, SurfacePoint | int]) -> str:
        """Return the name of the distance between two places."""
        ...

    def area(self, points: SurfacePoints) -> str:
        """Return the name of the area that ``points`` cover."""
        ...


@dataclass(frozen=True, kw_only=True)
class ConstraintBase:
    """How much a constraint counts, and what most kinds have in common.

    Attributes:
        kind: Name of the kind in session files.
        noun: What one constraint of the kind is called where a person reads.
        icon: Name of its icon, one of the tools'.
        informs_prior: Whether it tells something of the rest of the face, so that the prior is conditioned on it.
        weight: Factor on its energy, at least 0.
        enabled: Whether it counts.
        locked: Whether it is safe from being moved or removed by hand.
        rest: Where its ``places`` lie on the neutral face, shape (n, 3), in a file; None while it is edited.
    """

    kind: ClassVar[str] = ""
    noun: ClassVar[str] = ""
    icon: ClassVar[str] = "point"
    informs_prior: ClassVar[bool] = True

    weight: float = 1.0
    enabled: bool = True
    locked: bool = False
    rest: Array | None = field(default=None, compare=False, repr=False)

    @property
    def points(self) -> SurfacePoints:
        """The points of the surface that the constraint speaks of."""
        raise NotImplementedError

    @property
    def places(self) -> SurfacePoints | None:
        """The points of the surface that a file stores for the constraint, or None where it stores none."""
        return self.points

    def with_rest(self, model: FaceModel) -> Self:
        """Return the constraint as a file keeps it, with the rest positions of its ``places``."""
        places = self.places
        if places is None or not len(places):
            return replace(self, rest=None)
        return replace(self, rest=places.positions(model.character.vertices, model.triangles))

    def without_rest(self) -> Self:
        """Return the constraint as it is edited, without rest positions."""
        return self if self.rest is None else replace(self, rest=None)

    def rebound(self, places: SurfacePoints | None, frame: Similarity, shift: Array) -> Self:
        """Return the constraint on another version of the character.

        Args:
            places: Takes the stead of ``places``; None if those are None.
            frame: Lays the old version on the new one; what was drawn is seen by a camera that is moved likewise.
            shift: From where ``frame`` takes the rest position of each place to that of the new one, shape (n, 3).
        """
        raise NotImplementedError

    def resolved(self, model: FaceModel, p: ArrayLike) -> Self:
        """Return the constraint as it is, once its points are known to lie on the face.

        Raises:
            ValueError: If they do not.
        """
        self.points.check(model.triangles)
        return self

    def moved_start(self, model: FaceModel, start: Array) -> Array:
        """Return ``start``: most constraints pull only by their energy."""
        return start

    def residual_at(self, pixels: Array, model: FaceModel, p: ArrayLike) -> float:
        """Return ``residual_px``, given where the points of the constraint appear, shape (n, 2)."""
        return self.residual_px(model, p)

    def residual_px(self, model: FaceModel, p: ArrayLike) -> float:
        """Return how far the constraint is from being met by the face ``p``, shape (r,), in pixels."""
        raise NotImplementedError

    def nudged(self, offset: tuple[float, float]) -> Self | None:
        """Return the constraint with its target moved by ``offset`` pixels of its camera, or None if it has none."""
        return None

    def place(self, names: PlaceNames) -> str:
        """Return the name of the place that the constraint speaks of."""
        points = self.points
        return names.name(points[len(points) // 2]) if len(points) else "nothing"

    def switches_to_json(self) -> dict[str, Any]:
        """Return the switches as the session file has them; a lock is written only where there is one."""
        data: dict[str, Any] = {"weight": self.weight, "enabled": self.enabled}
        if self.locked:
            data["locked"] = True
        if self.rest is not None:
            data["rest"] = codec.rest_to_json(self.rest)
        return data


class ConstraintJson(JsonObject, kw_only=True):
    """Base of the JSON forms of all kinds: the keys that each of them has."""

    type: str
    weight: Annotated[float, Meta(ge=0.0, le=LARGEST_WEIGHT)] = 1.0
    enabled: bool = True
    locked: bool = False
    rest: codec.Rest | UnsetType = UNSET

    @property
    def switches(self) -> dict[str, Any]:
        """The weight, the switches and the rest positions as keyword arguments of a ``ConstraintBase``."""
        rest = None if self.rest is UNSET else np.array(self.rest)
        return {"weight": self.weight, "enabled": self.enabled, "locked": self.locked, "rest": rest}
