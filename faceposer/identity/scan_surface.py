"""The surface of a scan: closest points, its normals, and its borders."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from faceposer.errors import FacePoserError
from faceposer.geometry.mesh import Ints, TriangleMesh, VertexNormals
from faceposer.geometry.nearest_surface import NearestSurface
from faceposer.geometry.picking import SurfacePoints

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

# Triangles that are tested for the closest point.
_CANDIDATES = 12


@dataclass(frozen=True, eq=False)
class Closest:
    """The closest points of a scan to some places.

    Attributes:
        points: The points on its triangles.
        places: Their positions, shape (n, 3).
        normals: Its unit normals there, shape (n, 3).
        distances: Shape (n,).
        at_border: Mask of the points on a triangle at a border or a hole, shape (n,).
    """

    points: SurfacePoints
    places: Array
    normals: Array
    distances: Array
    at_border: Mask


@dataclass(frozen=True, eq=False)
class ScanSurface:
    """A triangle mesh prepared for closest points.

    Attributes:
        mesh: The mesh, in centimetres.
        nearest: Closest points on its triangles of any area.
        normals: Unit normals of its vertices, shape (N, 3); those of a place are common to all vertices there.
        at_border: Mask of the triangles with a corner at a border, shape (T,).
    """

    mesh: TriangleMesh
    nearest: NearestSurface
    normals: NDArray[np.float32]
    at_border: Mask

    @classmethod
    def of(cls, mesh: TriangleMesh) -> "ScanSurface":
        """Prepare ``mesh``, whose vertices need not be shared between triangles.

        Raises:
            FacePoserError: If no triangle has an area.
        """
        places, node_of = np.unique(np.asarray(mesh.vertices), axis=0, return_inverse=True)
        nodes = node_of.reshape(-1)[np.asarray(mesh.triangles)]
        proper = np.flatnonzero((nodes != np.roll(nodes, 1, axis=1)).all(axis=1))
        if not proper.size:
            raise FacePoserError("The scan has no surface: all its triangles are without area.")
        nearest = NearestSurface(mesh.vertices, mesh.triangles, proper, _CANDIDATES)
        normals = VertexNormals(nodes, len(places))(places)[node_of.reshape(-1)]
        return cls(mesh, nearest, normals, np.asarray(border_vertices(nodes)[nodes].any(axis=1)))

    def closest(self, places: Array) -> Closest:
        """Return the closest points to ``places``, shape (n, 3)."""
        points, distances = self.nearest.points(places)
        normals = points.positions(self.normals, self.mesh.triangles).astype(np.float64)
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
        found = points.positions(self.mesh.vertices, self.mesh.triangles)
        return Closest(points, found, normals, distances, self.at_border[points.faces])


def border_vertices(triangles: Ints) -> Mask:
    """Return the mask of the vertices, up to the largest in ``triangles``, that are on an edge of one triangle only."""
    result = np.zeros(int(np.max(triangles)) + 1, dtype=bool)
    edges, counts = counted_edges(triangles)
    result[edges[counts == 1]] = True
    return result


def counted_edges(triangles: Ints) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the edges, (E, 2), and the number of triangles at each."""
    given = np.asarray(triangles, dtype=np.int64)
    directed = np.concatenate([given[:, [0, 1]], given[:, [1, 2]], given[:, [2, 0]]])
    size = int(given.max()) + 1
    low, high = directed.min(axis=1), directed.max(axis=1)
    keys, counts = np.unique((low * size + high)[low != high], return_counts=True)
    return np.stack([keys // size, keys % size], axis=1), counts
