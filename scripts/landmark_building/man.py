"""The 468 points on the built-in man, found as on any mesh."""

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from faceposer.geometry.alignment import Similarity
from faceposer.geometry.nearest_surface import NearestSurface
from faceposer.landmarks.on_meshes import YAWS, MeshLandmarks, View, combined, find_mesh_landmarks
from faceposer.landmarks.painting import painted_character
from faceposer.landmarks.points import N_POINTS
from faceposer.landmarks.reference import Reference
from faceposer.model.character_file import load_character

# Rounds in which the points found become those by which views are aligned, and which partners are mirrored.
_ROUNDS = 3
_MIRROR = np.array([-1.0, 1.0, 1.0])


def points_on_man() -> Reference:
    """Return the points on the built-in man, made symmetric."""
    mesh = painted_character(load_character("man"))
    frame = Similarity(np.eye(3), np.zeros(3), np.array(1.0))
    views = [View.of(mesh, frame, yaw) for yaw in YAWS]
    known = _symmetric(combined(mesh, [view for view in views if view is not None], frame))
    for _ in range(_ROUNDS):
        found = find_mesh_landmarks(mesh, frame, known=known)
        assert found is not None
        known = _symmetric(found)
    return known


def _symmetric(found: MeshLandmarks) -> Reference:
    assert np.isfinite(found.points).all()
    mesh = found.mesh
    partners = _partners(found.points)
    places = (found.points + found.points[partners] * _MIRROR) / 2
    at, _ = NearestSurface(mesh.vertices, mesh.triangles, np.arange(len(mesh.triangles))).points(places)
    normals = np.einsum("pc,pcd->pd", at.barycentric, mesh.normals[mesh.triangles[at.faces]].astype(np.float64))
    normals = normals + normals[partners] * _MIRROR
    return Reference(places, normals / np.linalg.norm(normals, axis=1, keepdims=True), partners)


def _partners(places: NDArray[np.float64]) -> NDArray[np.int64]:
    """Return the point opposite each of ``places``, (468, 3), as (468,)."""
    apart = np.linalg.norm((places * _MIRROR)[:, None] - places, axis=2)
    partners = linear_sum_assignment(apart**2)[1]
    assert np.array_equal(partners[partners], np.arange(N_POINTS))
    return partners.astype(np.int64)
