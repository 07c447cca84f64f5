"""Base classes of all kinds of constraints."""

from abc import ABC, abstractmethod
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
    """Names of places on a face."""

    def name(self, point: SurfacePoint | int) -> str:
        """Return the name of a surface point or a vertex."""
        ...

    def pair(self, anchors: tuple[SurfacePoint | int, SurfacePoint | int]) -> str:
        """Return the name of the distance between two places."""
        ...

    def span(self, points: SurfacePoints) -> str:
        """Return the name of the part along ``points``."""
        ...

    def area(self, points: SurfacePoints) -> str:
        """Return the name of the area that ``points`` cover."""
        ...


@dataclass(frozen=True, kw_only=True)
class ConstraintBase(ABC):
    """Base class of constraints: weight, switches and default implementations.

    Attributes:
        kind: Name of the kind in session files.
        noun: Name of the kind in the user interface.
        icon: Name of its icon, one of the tools' icons.
        informs_prior: True if the prior is conditioned on constraints of this kind.
        notable_px: Residual in pixels above which a constraint of this kind is unmet.
        weight: Factor on its energy, at least 0.
        enabled: True if the constraint is active.
        locked: True if the constraint cannot be moved or removed by hand.
        rest: Positions of its ``places`` on the neutral face, shape (n, 3), in a file; None while it is edited.
    """

    kind: ClassVar[str] = ""
    noun: ClassVar[str] = ""
    icon: ClassVar[str] = "point"
    informs_prior: ClassVar[bool] = True
    notable_px: ClassVar[float] = 5.0

    weight: float = 1.0
    enabled: bool = True
    locked: bool = False
    rest: Array | None = field(default=None, compare=False, repr=False)

    @property
    @abstractmethod
    def points(self) -> SurfacePoints:
        """The constrained points of the surface."""

    @property
    def places(self) -> SurfacePoints | None:
        """The points of the surface that a file stores for the constraint, or None if it stores none."""
        return self.points

    def with_rest(self, model: FaceModel) -> Self:
        """Return the constraint as stored in a file, with the rest positions of its ``places``."""
        places = self.places
        if places is None or not len(places):
            return replace(self, rest=None)
        return replace(self, rest=places.positions(model.character.vertices, model.triangles))

    def without_rest(self) -> Self:
        """Return the constraint for editing, without rest positions."""
        return self if self.rest is None else replace(self, rest=None)

    @abstractmethod
    def rebound(self, places: SurfacePoints | None, frame: Similarity, shift: Array) -> Self:
        """Return the constraint transferred to another version of the character.

        Args:
            places: The new ``places``; None if those are None.
            frame: Similarity from the old version to the new one, which the camera follows.
            shift: Offset of each new rest position from the old one transformed by ``frame``, shape (n, 3).
        """

    def resolved(self, model: FaceModel, p: ArrayLike) -> Self:
        """Check the points of the constraint, and return it unchanged.

        Raises:
            ValueError: If a point does not lie on the face.
        """
        self.points.check(model.triangles)
        return self

    def offset_start(self, model: FaceModel, start: Array) -> Array:
        """Return the ``start`` pose unchanged: most constraints act through their energy only."""
        return start

    def residual_at(self, pixels: Array, model: FaceModel, p: ArrayLike) -> float:
        """Return ``residual_px``, given the projected ``pixels`` of the constraint's points, shape (n, 2)."""
        return self.residual_px(model, p)

    @abstractmethod
    def residual_px(self, model: FaceModel, p: ArrayLike) -> float:
        """Return the residual of the constraint on the face ``p``, shape (r,), in pixels."""

    def nudged(self, offset: tuple[float, float]) -> Self | None:
        """Return the constraint with its target moved by ``offset`` pixels of its camera, or None without a target."""
        return None

    def place(self, names: PlaceNames) -> str:
        """Return the name of the constrained place."""
        points = self.points
        return names.name(points[0]) if len(points) == 1 else names.span(points)

    def switches_to_json(self) -> dict[str, Any]:
        """Return weight, switches and rest positions in their JSON form; ``locked`` is written only if it is set."""
        data: dict[str, Any] = {"weight": self.weight, "enabled": self.enabled}
        if self.locked:
            data["locked"] = True
        if self.rest is not None:
            data["rest"] = codec.rest_to_json(self.rest)
        return data


class ConstraintJson(JsonObject, kw_only=True):
    """Base of the JSON forms of all kinds, with their common keys."""

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
