"""Mirror correspondence of surface points across the plane of symmetry x = 0, and mirrored cameras."""

from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from faceposer.geometry.camera import Camera
from faceposer.geometry.mesh import Floats, Ints
from faceposer.geometry.picking import SurfacePoints

if TYPE_CHECKING:
    # Imported late to shorten the start of the window.
    from scipy.spatial import cKDTree

_REFLECTION = np.array([-1.0, 1.0, 1.0])


class SurfaceMirror:
    """Mirror correspondence of a surface at rest."""

    def __init__(self, vertices: Floats, triangles: Ints, tolerance: float) -> None:
        """Prepare the correspondence of the ``vertices`` at rest, (N, 3), up to a distance of ``tolerance``."""
        self._vertices = np.asarray(vertices, dtype=np.float64)
        self._triangles = np.asarray(triangles)
        self._tolerance = tolerance

    @cached_property
    def vertices(self) -> NDArray[np.int64]:
        """Index of the mirror vertex of each vertex, shape (N,); -1 if there is none within the tolerance."""
        from scipy.spatial import cKDTree

        distances, nearest = cKDTree(self._vertices).query(self._vertices * _REFLECTION)
        return np.where(distances <= self._tolerance, nearest, -1).astype(np.int64)

    @cached_property
    def _centres(self) -> "cKDTree":
        from scipy.spatial import cKDTree

        return cKDTree(self._vertices[self._triangles].mean(axis=1))

    def points(self, points: SurfacePoints) -> SurfacePoints | None:
        """Return the mirror points of ``points``, or None if a point has no counterpart.

        Points on triangles are looked up by position, as the two halves may be triangulated differently.
        """
        on_vertex = points.faces < 0
        faces, weights = points.faces.copy(), points.barycentric.copy()
        if on_vertex.any():
            mirrored = self.vertices[-1 - points.faces[on_vertex]]
            if (mirrored < 0).any():
                return None
            faces[on_vertex] = -1 - mirrored
        if not on_vertex.all():
            places = points.subset(~on_vertex).positions(self._vertices, self._triangles) * _REFLECTION
            _, candidates = self._centres.query(places, k=min(16, len(self._triangles)))
            candidates = np.asarray(candidates).reshape(len(places), -1)
            inside, distances = nearest_on_triangles(self._vertices[self._triangles[candidates]], places)
            best = np.argmin(distances, axis=1)
            rows = np.arange(len(places))
            if (distances[rows, best] > self._tolerance).any():
                return None
            faces[~on_vertex] = candidates[rows, best]
            weights[~on_vertex] = inside[rows, best]
        return SurfacePoints(faces, weights)


def nearest_on_triangles(
    corners: NDArray[np.float64], places: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the barycentric coordinates of the nearest points on triangles, and their distances.

    Places are projected onto the plane of each triangle, with the barycentric coordinates clipped to 0 to 1: exact for
    projections inside the triangle, and accurate enough outside to select the nearest triangle.

    Args:
        corners: Corners of k triangles for each place, shape (n, k, 3, 3).
        places: Positions, shape (n, 3).

    Returns:
        Barycentric coordinates, shape (n, k, 3), and distances, shape (n, k).
    """
    a = corners[:, :, 0]
    edge1, edge2, offset = corners[:, :, 1] - a, corners[:, :, 2] - a, places[:, None] - a
    g11, g12, g22 = (np.einsum("nkd,nkd->nk", u, v) for u, v in ((edge1, edge1), (edge1, edge2), (edge2, edge2)))
    h1, h2 = (np.einsum("nkd,nkd->nk", offset, edge) for edge in (edge1, edge2))
    determinant = np.maximum(g11 * g22 - g12 * g12, 1e-30)
    w1, w2 = (g22 * h1 - g12 * h2) / determinant, (g11 * h2 - g12 * h1) / determinant
    weights = np.clip(np.stack([1.0 - w1 - w2, w1, w2], axis=-1), 0.0, 1.0)
    weights /= weights.sum(axis=-1, keepdims=True)
    feet = np.einsum("nkc,nkcd->nkd", weights, corners)
    return weights, np.linalg.norm(feet - places[:, None], axis=-1)


def mirrored_camera(camera: Camera) -> Camera:
    """Return the mirror image of ``camera``: its image of the mirrored world is the flipped image of the world."""
    flip = np.diag(_REFLECTION)
    return Camera(
        flip @ camera.rotation @ flip,
        flip @ camera.translation,
        camera.focal,
        camera.size,
        (-camera.shift[0], camera.shift[1]),
    )


def mirrored_pixels(pixels: ArrayLike, camera: Camera) -> NDArray[np.float64]:
    """Return the pixels of ``mirrored_camera(camera)`` that correspond to ``pixels`` of ``camera``, shape (n, 2)."""
    flipped = np.array(pixels, dtype=np.float64).reshape(-1, 2)
    flipped[:, 0] = camera.size[0] - flipped[:, 0]
    return flipped
