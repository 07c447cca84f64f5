"""A point of the face that should lie under a pixel (Lau et al. 2009, section 4.1)."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from faceposer.geometry.camera import Camera
from faceposer.geometry.picking import SurfacePoint
from faceposer.solve.constraints import codec
from faceposer.solve.term import Array, Indices, PoseState, ResidualTerm

# How far a hand misses the pixel that it means, in pixels: sigma of eq. (9).
SIGMA_PX = 1.5


@dataclass(frozen=True)
class PointConstraint:
    """The point ``anchor`` of the face projects onto the pixel ``target``.

    Attributes:
        anchor: A surface point, or the index of a vertex.
        target: Where the point should appear, (u, v) in the pixels of ``camera``.
        camera: The camera under which the target was drawn.
        weight: Factor on the constraint's energy, at least 0.
        enabled: Whether the constraint counts.
    """

    kind: ClassVar[str] = "point"

    anchor: SurfacePoint | int
    target: tuple[float, float]
    camera: Camera
    weight: float = 1.0
    enabled: bool = True

    def surface_points(self, triangles: NDArray[np.integer]) -> tuple[SurfacePoint, ...]:
        """Return the points of the surface that the constraint speaks of.

        Raises:
            ValueError: If the anchor is not on a surface of these triangles.
        """
        if isinstance(self.anchor, int):
            return (SurfacePoint.at_vertex(triangles, self.anchor),)
        if not 0 <= self.anchor.face < len(triangles):
            raise ValueError(f"triangle {self.anchor.face} does not exist; the subject has {len(triangles)}")
        return (self.anchor,)

    def residual_px(self, pixels: Array) -> float:
        """Return the distance to the target in pixels, given the pixel of the anchor, shape (1, 2)."""
        return float(np.hypot(*(pixels[0] - self.target)))

    @staticmethod
    def term(constraints: Sequence["PointConstraint"], points: Sequence[Indices]) -> ResidualTerm:
        """Return one term for all ``constraints``, whose points have the indices ``points`` in the state."""
        return PointTerm(constraints, np.concatenate(points))

    def to_json(self) -> dict[str, Any]:
        """Return the constraint as the session file has it."""
        return {
            "type": self.kind,
            "anchor": codec.anchor_to_json(self.anchor),
            "target": list(self.target),
            "camera": codec.camera_to_json(self.camera),
            "weight": self.weight,
            "enabled": self.enabled,
        }

    @classmethod
    def from_json(cls, data: dict[str, Any], where: str) -> "PointConstraint":
        """Return the constraint that ``data`` describes.

        Raises:
            FacePoserError: If a key is unknown, missing or of the wrong kind; ``where`` names the place.
        """
        codec.check_keys(data, {"type", "anchor", "target", "camera"}, {"weight", "enabled"}, where)
        return cls(
            codec.anchor_from_json(data["anchor"], f"{where}.anchor"),
            codec.pixel_from_json(data["target"], f"{where}.target"),
            codec.camera_from_json(data["camera"], f"{where}.camera"),
            codec.number_from_json(data.get("weight", 1.0), f"{where}.weight", minimum=0.0),
            codec.flag_from_json(data.get("enabled", True), f"{where}.enabled"),
        )


class PointTerm(ResidualTerm):
    """sum over i of w_i |y_i(p) - z_i|^2 / sigma^2 (paper, eqs. (9) and (25))."""

    def __init__(self, constraints: Sequence[PointConstraint], points: Indices) -> None:
        """Prepare the term for ``constraints`` whose points have the indices ``points`` in the state."""
        super().__init__(np.repeat([constraint.weight / SIGMA_PX**2 for constraint in constraints], 2))
        self._targets = np.array([constraint.target for constraint in constraints])
        self._points = points

    def residual(self, state: PoseState) -> Array:
        """Return pixel minus target, shape (2 n,)."""
        return (state.pixels[self._points] - self._targets).ravel()

    def jacobian(self, state: PoseState) -> Array:
        """Return the derivatives of the pixels, shape (2 n, r)."""
        jacobian = state.pixel_jacobian(self._points)
        return jacobian.reshape(-1, jacobian.shape[-1])

    def pull_back(self, state: PoseState, by_residual: Array) -> Array:
        """Return jacobian^T ``by_residual``, shape (r,)."""
        return state.pull_back(self._points, by_residual.reshape(-1, 2))
