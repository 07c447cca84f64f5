"""From pixels to points on a surface."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from faceposer.geometry.camera import Camera
from faceposer.geometry.mesh import Floats, Ints

_EPSILON = 1e-12


@dataclass(frozen=True)
class SurfacePoint:
    """A point fixed to a triangle, so that it moves with the surface (paper, eq. (11)).

    Attributes:
        face: Index of the triangle.
        barycentric: Weights of the triangle's three vertices; they sum to one.
    """

    face: int
    barycentric: tuple[float, float, float]

    @classmethod
    def at_vertex(cls, triangles: Ints, vertex: int) -> "SurfacePoint":
        """Return the point at ``vertex`` by a triangle that has it.

        Raises:
            ValueError: If no triangle has the vertex.
        """
        rows, columns = np.nonzero(triangles == vertex)
        if rows.size == 0:
            raise ValueError(f"vertex {vertex} belongs to no triangle")
        a, b, c = (float(column == columns[0]) for column in range(3))
        return cls(int(rows[0]), (a, b, c))


def surface_positions(vertices: Floats, triangles: Ints, points: Sequence[SurfacePoint]) -> NDArray[np.float64]:
    """Return where ``points`` lie on the surface, shape (n, 3), for ``vertices`` of shape (N, 3)."""
    if not points:
        return np.zeros((0, 3))
    corners = np.asarray(vertices)[np.asarray(triangles)[[point.face for point in points]]].astype(np.float64)
    weights = np.array([point.barycentric for point in points])
    return np.einsum("nk,nkd->nd", weights, corners)


def pick(vertices: Floats, triangles: Ints, camera: Camera, pixel: Sequence[float]) -> SurfacePoint | None:
    """Return the nearest point that the ray through ``pixel`` meets on a triangle facing the camera, or None.

    The test is that of Moeller and Trumbore (1997), over all triangles at once.

    Args:
        vertices: Positions, shape (N, 3).
        triangles: Counter-clockwise seen from outside, shape (T, 3).
        camera: The camera that the pixel belongs to.
        pixel: (u, v) from the top left.
    """
    origin, direction = camera.ray(pixel)
    a, edge1, edge2 = _corner_and_edges(vertices, triangles)
    weight1, weight2, distance, determinant = _intersect(origin, direction, a, edge1, edge2)
    with np.errstate(invalid="ignore"):
        hit = (determinant > _EPSILON) & (weight1 >= 0) & (weight2 >= 0) & (weight1 + weight2 <= 1) & (distance > 0)
    if not hit.any():
        return None
    face = int(np.argmin(np.where(hit, distance, np.inf)))
    return SurfacePoint(face, _barycentric(weight1[face], weight2[face]))


def barycentric_on_triangle(
    vertices: Floats, triangles: Ints, face: int, camera: Camera, pixel: Sequence[float]
) -> SurfacePoint:
    """Return the point of triangle ``face`` under ``pixel``, moved to the triangle's nearest edge if it lies beside it.

    A triangle-ID picture gives the triangle at a pixel's centre; the pointer may lie half a pixel off.
    """
    origin, direction = camera.ray(pixel)
    a, edge1, edge2 = _corner_and_edges(vertices, np.asarray(triangles)[face : face + 1])
    weight1, weight2, _, determinant = _intersect(origin, direction, a, edge1, edge2)
    if abs(determinant[0]) <= _EPSILON:
        return SurfacePoint(face, (1 / 3, 1 / 3, 1 / 3))
    return SurfacePoint(face, _barycentric(weight1[0], weight2[0]))


def _corner_and_edges(vertices: Floats, triangles: Ints) -> tuple[NDArray[np.float64], ...]:
    corners = np.asarray(vertices, dtype=np.float64)[np.asarray(triangles)]
    a = corners[:, 0]
    return a, corners[:, 1] - a, corners[:, 2] - a


def _intersect(
    origin: NDArray[np.float64],
    direction: NDArray[np.float64],
    a: NDArray[np.float64],
    edge1: NDArray[np.float64],
    edge2: NDArray[np.float64],
) -> tuple[NDArray[np.float64], ...]:
    """Return the second and third corner's weights, the distance and the determinant (positive for front faces)."""
    normal_to_plane = np.cross(direction, edge2)
    determinant = np.einsum("ij,ij->i", edge1, normal_to_plane)
    inverse = 1.0 / np.where(np.abs(determinant) > _EPSILON, determinant, np.inf)
    to_origin = origin - a
    weight1 = np.einsum("ij,ij->i", to_origin, normal_to_plane) * inverse
    across = np.cross(to_origin, edge1)
    weight2 = across @ direction * inverse
    distance = np.einsum("ij,ij->i", edge2, across) * inverse
    return weight1, weight2, distance, determinant


def _barycentric(weight1: float, weight2: float) -> tuple[float, float, float]:
    weights = np.clip([1.0 - weight1 - weight2, weight1, weight2], 0.0, 1.0)
    a, b, c = (weights / weights.sum()).tolist()
    return (a, b, c)
