"""Coarse scans made rounder."""

import numpy as np
from numpy.typing import NDArray

from faceposer.geometry.mesh import TriangleMesh
from faceposer.identity.scans.rounding import rounded

_OCTAHEDRON = np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]], dtype=float)
_FACES = np.array([[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]])


def crosses(mesh: TriangleMesh) -> NDArray[np.float64]:
    """Return the normals of the triangles, twice as long as their areas."""
    corners = np.asarray(mesh.vertices)[mesh.triangles]
    return np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])


def test_a_coarse_sphere_comes_closer_to_the_sphere() -> None:
    mesh = rounded(TriangleMesh(_OCTAHEDRON, _FACES))
    np.testing.assert_array_equal(mesh.vertices[:6], _OCTAHEDRON)
    assert mesh.triangles.shape == (32, 3)
    # The middles of the edges have the radius √½; the curves pass them by a quarter of it.
    assert np.allclose(np.linalg.norm(mesh.vertices[6:], axis=1), np.sqrt(0.5) * 1.25)
    finer = rounded(mesh)
    radii = np.linalg.norm(finer.vertices, axis=1)
    assert radii.min() > 0.84
    assert radii.max() < 1.05
    middles = np.asarray(finer.vertices)[finer.triangles].mean(axis=1)
    assert (np.einsum("td,td->t", crosses(finer), middles) > 0.0).all()


def test_a_plane_stays_flat_and_vertices_need_not_be_shared() -> None:
    corners = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 0, 0], [1, 1, 0], [0, 1, 0]], dtype=float)
    mesh = rounded(TriangleMesh(corners, np.arange(6).reshape(2, 3)))
    assert np.abs(np.asarray(mesh.vertices)[:, 2]).max() == 0.0
    assert np.isclose(np.linalg.norm(crosses(mesh), axis=1).sum() / 2.0, 1.0)
