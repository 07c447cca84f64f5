"""Point constraints as handles at vertices, for methods without surface points."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from faceposer.errors import FacePoserError
from faceposer.geometry.camera import Camera
from faceposer.geometry.picking import SurfacePoints
from faceposer.model.character import Character
from faceposer.solve.constraints.point import PointConstraint
from faceposer.solve.constraints.registry import Constraint

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Handles:
    """Points of one view with their closest vertices.

    Attributes:
        vertices: Closest corner of the triangle of each point, shape (n,).
        places: Positions of the points on the neutral face, shape (n, 3).
        targets: Target pixels of the points, shape (n, 2).
        camera: Camera of the view.
    """

    vertices: NDArray[np.intp]
    places: Array
    targets: Array
    camera: Camera

    @classmethod
    def of(cls, character: Character, constraints: Sequence[Constraint]) -> "Handles":
        """Return the handles for the enabled ``constraints`` on ``character``.

        Raises:
            TypeError: If a constraint is not a point.
            ValueError: If none is enabled, or they have different cameras.
        """
        points = [constraint for constraint in constraints if isinstance(constraint, PointConstraint)]
        if len(points) < len(constraints):
            raise TypeError("only point constraints can be handles")
        points = [point for point in points if point.enabled and point.weight > 0]
        if len({point.camera for point in points}) != 1:
            raise ValueError("handles must be points of one view, at least one of them enabled")
        surface = SurfacePoints.of([point.anchor for point in points])
        corners = surface.corners(character.triangles)
        nearest = corners[np.arange(len(corners)), surface.barycentric.argmax(axis=1)]
        return cls(
            nearest.astype(np.intp),
            surface.positions(character.vertices, character.triangles),
            np.array([point.target for point in points]),
            points[0].camera,
        )

    def displacements(self) -> Array:
        """Return the displacement of each point to its pixel at constant depth, shape (n, 3)."""
        depths = self.camera.to_camera(self.places)[:, 2:]
        offsets = self.targets - self.camera.project(self.places)
        displacements: Array = (offsets * depths / self.camera.focal) @ self.camera.rotation[:2]
        return displacements


def missing_package(method: str, package: str) -> FacePoserError:
    """Return the error for a ``method`` that needs the missing ``package``."""
    return FacePoserError(f"The method '{method}' needs the package '{package}': pip install 'faceposer[bench]'.")
