"""What the user can set on a constraint of any kind."""

from dataclasses import dataclass
from typing import Any, Self

from numpy.typing import ArrayLike

from faceposer.geometry.picking import SurfacePoints
from faceposer.model.face_model import FaceModel
from faceposer.solve.constraints import codec
from faceposer.solve.term import Array

#: The keys that the session file may have for a constraint of any kind.
KEYS = frozenset({"weight", "enabled", "locked"})
LARGEST_WEIGHT = 1e6


@dataclass(frozen=True, kw_only=True)
class Switches:
    """How much a constraint counts, and what most kinds have in common.

    Attributes:
        weight: Factor on its energy, at least 0.
        enabled: Whether it counts.
        locked: Whether it is safe from being moved or removed by hand.
    """

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

    def switches_to_json(self) -> dict[str, Any]:
        """Return the switches as the session file has them; a lock is written only where there is one."""
        data: dict[str, Any] = {"weight": self.weight, "enabled": self.enabled}
        return data | {"locked": True} if self.locked else data


def switches_from_json(data: dict[str, Any], where: str) -> dict[str, Any]:
    """Return the switches in ``data`` as keyword arguments.

    Raises:
        FacePoserError: If one is of the wrong kind; ``where`` names the place.
    """
    return {
        "weight": codec.number_from_json(data.get("weight", 1.0), f"{where}.weight", 0.0, LARGEST_WEIGHT),
        "enabled": codec.flag_from_json(data.get("enabled", True), f"{where}.enabled"),
        "locked": codec.flag_from_json(data.get("locked", False), f"{where}.locked"),
    }
