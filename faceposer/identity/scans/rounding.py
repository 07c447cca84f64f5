"""Coarse scans made finer and rounder: a scan's vertices lie on the skin, its triangles cut through it."""

import numpy as np

from faceposer.geometry.mesh import TriangleMesh
from faceposer.identity.scan_surface import ScanSurface


def rounded(mesh: TriangleMesh) -> TriangleMesh:
    """Return ``mesh`` with each triangle as four, whose new corners lie on curves between the old ones.

    A curve is the edge of a curved PN triangle: a cubic between two vertices a and b, at right angles to their normals.
    Its middle is (a + b) / 2 + ((e · n_b) n_b - (e · n_a) n_a) / 8 with e = b - a (Vlachos, Peters, Boyd and Mitchell,
    "Curved PN triangles", I3D 2001, section 3.2). The old vertices come first.

    Raises:
        FacePoserError: If no triangle has an area.
    """
    vertices, triangles = np.asarray(mesh.vertices, dtype=np.float64), np.asarray(mesh.triangles, dtype=np.int64)
    normals = ScanSurface.of(mesh).normals.astype(np.float64)
    n = len(vertices)
    edges = np.sort(triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    keys, of_edge = np.unique(edges[:, 0] * n + edges[:, 1], return_inverse=True)
    a, b = keys // n, keys % n
    along = vertices[b] - vertices[a]
    bends = [np.einsum("ed,ed->e", along, normals[end])[:, None] * normals[end] for end in (a, b)]
    middles = (vertices[a] + vertices[b]) / 2.0 + (bends[1] - bends[0]) / 8.0
    ab, bc, ca = n + of_edge.reshape(-1, 3).T
    first, second, third = triangles.T
    finer = np.stack([first, ab, ca, ab, second, bc, ca, bc, third, ab, bc, ca], axis=1).reshape(-1, 3)
    return TriangleMesh(np.concatenate([vertices, middles]), finer)
