"""Points of the surface as methods take them that know vertices alone."""

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
    """Points of one picture, with the vertices that stand for them.

    Attributes:
        vertices: The corner nearest to each point of its triangle, shape (n,).
        places: The points themselves on the neutral face, shape (n, 3).
        targets: Where each should appear, in pixels, shape (n, 2).
        camera: Of the picture.
    """

    vertices: NDArray[np.intp]
    places: Array
    targets: Array
    camera: Camera

    @classmethod
    def of(cls, character: Character, constraints: Sequence[Constraint]) -> "Handles":
        """Return the handles that ``constraints`` make of the ``character``; those that are off are left out.

        Raises:
            TypeError: If a constraint is no point.
            ValueError: If there is none, or they were drawn in different views.
        """
        points = [constraint for constraint in constraints if isinstance(constraint, PointConstraint)]
        if len(points) < len(constraints):
            raise TypeError("only points are handles")
        points = [point for point in points if point.enabled and point.weight > 0]
        if len({point.camera for point in points}) != 1:
            raise ValueError("handles are points of one view, at least one of them enabled")
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
        """Return the way of each point to its pixel that keeps its distance from the picture's plane, (n, 3)."""
        depths = self.camera.to_camera(self.places)[:, 2:]
        offsets = self.targets - self.camera.project(self.places)
        moved: Array = (offsets * depths / self.camera.focal) @ self.camera.rotation[:2]
        return moved


def missing_package(method: str, package: str) -> FacePoserError:
    """Return what to raise where ``method`` does not find the ``package`` that it is made of."""
    return FacePoserError(f"The method '{method}' needs the package '{package}': pip install 'faceposer[bench]'.")
