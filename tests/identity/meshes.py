"""Heads with known correspondence, and other meshes of the same surfaces."""

from collections import defaultdict
from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from faceposer.geometry.alignment import Similarity
from faceposer.geometry.mesh import TriangleMesh
from faceposer.model.character_file import load_character

Array = NDArray[np.float64]

#: Another frame and unit than ours.
ELSEWHERE = Similarity(
    Rotation.from_euler("xyz", (0.5, 2.0, 0.3)).as_matrix(), np.array([30.0, -400.0, 5.0]), np.array(12.3)
)


@cache
def skin(name: str) -> tuple[Array, NDArray[np.int32]]:
    """Return the vertices and quads of the skin of a built-in character."""
    character = load_character(name)
    part = character.parts[0]
    return character.vertices[slice(*part.vertices)].astype(np.float64), character.polygons[slice(*part.polygons)]


def feature_vertices() -> NDArray[np.intp]:
    """Return the vertices of the man's feature points on the skin."""
    character = load_character("man")
    return np.array([v for v in character.feature_points.values() if v < character.parts[0].vertices[1]])


def coarse(vertices: Array, quads: NDArray[np.int32]) -> TriangleMesh:
    """Return the mesh whose subdivision is that of ``quads``: its vertices are the first ones, on the surface."""
    corners = quads[:, 0].reshape(-1, 4)
    return TriangleMesh(vertices[: corners.max() + 1], corners[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3))


def remeshed(vertices: Array, quads: NDArray[np.int32]) -> TriangleMesh:
    """Return the dual mesh: a vertex in the middle of each quad, a fan of triangles around each old vertex."""
    onward: dict[int, dict[int, tuple[int, int]]] = defaultdict(dict)
    for number, quad in enumerate(quads.tolist()):
        for k in range(4):
            onward[quad[k]][quad[k - 1]] = (quad[(k + 1) % 4], number)
    triangles = []
    for around in onward.values():
        start = edge = next(iter(around))
        ring = []
        while edge in around:
            edge, number = around[edge]
            ring.append(number)
            if edge == start:
                triangles += [(ring[0], ring[k + 1], ring[k]) for k in range(1, len(ring) - 1)]
                break
    return TriangleMesh(vertices[quads].mean(axis=1), np.array(triangles))
