"""The base of all kinds of constraints: weight, switches, and what the rest of the program asks of a kind."""

from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, Protocol, Self

from msgspec import Meta
from numpy.typing import ArrayLike

from faceposer.files.json_documents import JsonObject
from faceposer.geometry.picking import SurfacePoint, SurfacePoints
from faceposer.model.face_model import FaceModel
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
    """

    kind: ClassVar[str] = ""
    noun: ClassVar[str] = ""
    icon: ClassVar[str] = "point"
    informs_prior: ClassVar[bool] = True

    weight: float = 1.0
    enabled: bool = True
    locked: bool = False

    @property
    def points(self) -> SurfacePoints:
        """The points of the surface that the constraint speaks of."""
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
        return data | {"locked": True} if self.locked else data


class ConstraintJson(JsonObject, kw_only=True):
    """Base of the JSON forms of all kinds: the keys that each of them has."""

    type: str
    weight: Annotated[float, Meta(ge=0.0, le=LARGEST_WEIGHT)] = 1.0
    enabled: bool = True
    locked: bool = False

    @property
    def switches(self) -> dict[str, Any]:
        """The weight and the switches as keyword arguments of a ``ConstraintBase``."""
        return {"weight": self.weight, "enabled": self.enabled, "locked": self.locked}
