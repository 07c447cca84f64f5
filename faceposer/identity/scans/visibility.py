"""How much of the skin a scanner can see: the share of the directions on a vertex's outer side that reach it.

Folds, nostrils, the back of the lips and the sockets of the eyes are seen from few directions or from none; scanners
leave them out or get them wrong.
"""

import numpy as np
from numpy.typing import NDArray

from faceposer.geometry.camera import Camera
from faceposer.geometry.mesh import VertexNormals
from faceposer.landmarks.drawing import PaintedMesh, draw

Array = NDArray[np.float64]

# Pictures: their side in pixels, the width that they show and the distance of the camera, in radii of the mesh.
_SIDE, _WIDTH, _DISTANCE = 400, 2.1, 20.0
# Least cosine between normal and view that counts, and the depth behind the surface at which a vertex is hidden, in
# centimetres.
_FACING, _HIDDEN = 0.2, 0.12
_DIRECTIONS = 26


def visible_shares(vertices: Array, triangles: NDArray[np.integer], n_skin: int) -> Array:
    """Return the share, 0 to 1, of the directions in front of each of the first ``n_skin`` vertices that reach it.

    Args:
        vertices: Positions in centimetres, shape (N, 3).
        triangles: All that can hide the skin, shape (T, 3).
        n_skin: Number of vertices of the skin.
    """
    mesh = PaintedMesh(vertices, triangles)
    middle = (vertices.min(axis=0) + vertices.max(axis=0)) / 2
    radius = float(np.linalg.norm(vertices - middle, axis=1).max())
    normals = VertexNormals(triangles, len(vertices))(vertices)[:n_skin].astype(np.float64)
    seen, facing = np.zeros(n_skin), np.zeros(n_skin)
    for direction in _sphere(_DIRECTIONS):
        camera = _camera(middle, direction, radius)
        drawing = draw(mesh, camera)
        cosines = normals @ direction
        columns, rows = np.clip(np.floor(camera.project(vertices[:n_skin])).astype(np.intp), 0, _SIDE - 1).T
        front = camera.to_camera(drawing.places[rows, columns])[:, 2]
        depth = camera.to_camera(vertices[:n_skin])[:, 2]
        reached = np.isnan(front) | (depth < front + _HIDDEN / np.maximum(cosines, _FACING))
        weights = np.where(cosines > _FACING, cosines, 0.0)
        seen += np.where(reached, weights, 0.0)
        facing += weights
    return seen / np.maximum(facing, 1e-12)


def _sphere(count: int) -> Array:
    """Return ``count`` unit vectors, evenly spread, on a spiral of Fibonacci, shape (count, 3)."""
    number = np.arange(count) + 0.5
    height = 1.0 - 2.0 * number / count
    angle = np.pi * (1.0 + 5.0**0.5) * number
    across = np.sqrt(1.0 - height**2)
    return np.stack([across * np.cos(angle), height, across * np.sin(angle)], axis=1)


def _camera(middle: Array, direction: Array, radius: float) -> Camera:
    up = np.array([0.0, 1.0, 0.0]) if abs(direction[1]) < 0.9 else np.array([0.0, 0.0, 1.0])
    right = np.cross(-direction, up)
    right /= np.linalg.norm(right)
    rotation = np.stack([right, np.cross(-direction, right), -direction])
    centre = middle + _DISTANCE * radius * direction
    return Camera(rotation, -rotation @ centre, _SIDE * _DISTANCE / _WIDTH, (_SIDE, _SIDE))
