"""Other meshes of the same surface: evenly spaced vertices, cut off, with holes, moved.

The vertices of a finely subdivided mesh are clustered around seeds, and each of its triangles whose corners belong to
three clusters becomes a triangle of the new mesh (Valette and Chassery, "Approximated centroidal Voronoi diagrams for
uniform polygonal mesh coarsening", 2004).
"""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from faceposer.geometry.alignment import Similarity
from faceposer.geometry.mesh import TriangleMesh, VertexNormals

Array = NDArray[np.float64]

# Weight of normals beside places, in centimetres, which keeps the lips and the lids apart.
_NORMAL = 0.5
_ROUNDS = 6


def subdivided(mesh: TriangleMesh, times: int) -> TriangleMesh:
    """Return ``mesh`` with each triangle split into four, ``times`` times."""
    vertices, triangles = np.asarray(mesh.vertices, dtype=np.float64), np.asarray(mesh.triangles, dtype=np.int64)
    for _ in range(times):
        n = len(vertices)
        edges = np.sort(triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
        keys, of_edge = np.unique(edges[:, 0] * n + edges[:, 1], return_inverse=True)
        middles = (vertices[keys // n] + vertices[keys % n]) / 2
        ab, bc, ca = n + of_edge.reshape(-1, 3).T
        a, b, c = triangles.T
        triangles = np.stack([a, ab, ca, ab, b, bc, ca, bc, c, ab, bc, ca], axis=1).reshape(-1, 3)
        vertices = np.concatenate([vertices, middles])
    return TriangleMesh(vertices, triangles)


def remeshed(mesh: TriangleMesh, count: int, seed: int) -> TriangleMesh:
    """Return a mesh of about ``count`` evenly spaced vertices of the surface of ``mesh``."""
    fine = subdivided(mesh, 2 if 4 * len(mesh.vertices) < 8 * count else 1)
    vertices, triangles = np.asarray(fine.vertices), np.asarray(fine.triangles)
    normals = VertexNormals(triangles, len(vertices))(vertices)
    features = np.hstack([vertices, _NORMAL * normals])
    corners = vertices[triangles]
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    weights = np.bincount(triangles.ravel(), np.repeat(areas, 3), len(vertices))
    rng = np.random.default_rng(seed)
    seeds = features[rng.choice(len(vertices), count, replace=False, p=weights / weights.sum())]
    for _ in range(_ROUNDS):
        _, cluster = cKDTree(seeds).query(features)
        total = np.bincount(cluster, weights, count)
        for axis in range(6):
            sums = np.bincount(cluster, weights * features[:, axis], count)
            seeds[:, axis] = np.where(total > 0.0, sums / np.where(total > 0.0, total, 1.0), seeds[:, axis])
    # The vertex nearest to the middle of its cluster lies on the surface.
    _, nearest = cKDTree(features).query(seeds)
    ids = cluster[triangles]
    ids = ids[(ids != np.roll(ids, 1, axis=1)).all(axis=1)]
    _, first = np.unique(np.sort(ids, axis=1), axis=0, return_index=True)
    ids = ids[np.sort(first)]
    used, again = np.unique(ids, return_inverse=True)
    return TriangleMesh(vertices[nearest[used]], again.reshape(-1, 3))


def holed(mesh: TriangleMesh, middles: Array, radius: float) -> TriangleMesh:
    """Return ``mesh`` without the triangles within ``radius`` of ``middles``, shape (h, 3)."""
    distances, _ = cKDTree(middles).query(np.asarray(mesh.vertices)[mesh.triangles].mean(axis=1))
    return without_loose(TriangleMesh(mesh.vertices, mesh.triangles[distances > radius]))


def without_loose(mesh: TriangleMesh) -> TriangleMesh:
    """Return ``mesh`` without the vertices that no triangle has."""
    used, again = np.unique(mesh.triangles, return_inverse=True)
    return TriangleMesh(np.asarray(mesh.vertices)[used], again.reshape(-1, 3))


def random_place(rng: np.random.Generator) -> Similarity:
    """Return any rotation, a translation within a metre, and a unit between a tenth of a millimetre and a decimetre."""
    rotation = Rotation.random(random_state=rng).as_matrix()
    return Similarity(rotation, rng.uniform(-100.0, 100.0, size=3), np.array(10.0 ** rng.uniform(-1.0, 2.0)))
