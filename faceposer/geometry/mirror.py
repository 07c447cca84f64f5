"""The plane of symmetry x = 0: which point of a surface lies across from which, and cameras seen in it."""

from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from faceposer.geometry.camera import Camera
from faceposer.geometry.mesh import Floats, Ints
from faceposer.geometry.picking import SurfacePoints

if TYPE_CHECKING:
    # The window's start does not wait for search trees: they are imported where they are built.
    from scipy.spatial import cKDTree

_ACROSS = np.array([-1.0, 1.0, 1.0])


class SurfaceMirror:
    """Finds the points of a surface that lie across from others when it is at rest."""

    def __init__(self, vertices: Floats, triangles: Ints, tolerance: float) -> None:
        """Prepare for the resting ``vertices``, (N, 3); beyond ``tolerance`` from its image none is found."""
        self._vertices = np.asarray(vertices, dtype=np.float64)
        self._triangles = np.asarray(triangles)
        self._tolerance = tolerance

    @cached_property
    def vertices(self) -> NDArray[np.int64]:
        """The vertex across from each vertex, shape (N,), or -1."""
        from scipy.spatial import cKDTree

        distances, nearest = cKDTree(self._vertices).query(self._vertices * _ACROSS)
        return np.where(distances <= self._tolerance, nearest, -1).astype(np.int64)

    @cached_property
    def _centres(self) -> "cKDTree":
        from scipy.spatial import cKDTree

        return cKDTree(self._vertices[self._triangles].mean(axis=1))

    def points(self, points: SurfacePoints) -> SurfacePoints | None:
        """Return the points across from ``points``, or None where one of them has no counterpart.

        Two halves may be cut into triangles along different diagonals, so that a point is looked up by its place.
        """
        on_vertex = points.faces < 0
        faces, weights = points.faces.copy(), points.barycentric.copy()
        if on_vertex.any():
            across = self.vertices[-1 - points.faces[on_vertex]]
            if (across < 0).any():
                return None
            faces[on_vertex] = -1 - across
        if not on_vertex.all():
            places = points.subset(~on_vertex).positions(self._vertices, self._triangles) * _ACROSS
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
    """Return weights (n, k, 3) of the points of triangles ``corners`` (n, k, 3, 3) near ``places`` (n, 3), and how far.

    The point is the foot on the triangle's plane, moved inside by clipping its weights: exact for a foot inside, near
    enough beside it to tell which triangle is meant.
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
    """Return the camera that sees the mirrored world as ``camera`` sees the world, left and right exchanged."""
    flip = np.diag(_ACROSS)
    return Camera(
        flip @ camera.rotation @ flip,
        flip @ camera.translation,
        camera.focal,
        camera.size,
        (-camera.shift[0], camera.shift[1]),
    )


def mirrored_pixels(pixels: ArrayLike, camera: Camera) -> NDArray[np.float64]:
    """Return where ``mirrored_camera(camera)`` sees the mirror images of what ``camera`` sees at ``pixels``, (n, 2)."""
    flipped = np.array(pixels, dtype=np.float64).reshape(-1, 2)
    flipped[:, 0] = camera.size[0] - flipped[:, 0]
    return flipped
