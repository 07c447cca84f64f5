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
# Heads and angles, in radians, of the pictures that show which points are opposite each other.
_HEADS, _PAIR_YAWS = ("man", "woman", "low", "creature"), (0.0, 0.3, -0.3)
_UPRIGHT = Similarity(np.eye(3), np.zeros(3), np.array(1.0))


def points_on_man() -> Reference:
    """Return the points on the built-in man, made symmetric."""
    partners = _partners()
    mesh = painted_character(load_character("man"))
    views = [View.of(mesh, _UPRIGHT, yaw, partners) for yaw in YAWS]
    known = _symmetric(combined(mesh, [view for view in views if view is not None], _UPRIGHT), partners)
    for _ in range(_ROUNDS):
        found = find_mesh_landmarks(mesh, _UPRIGHT, known=known)
        assert found is not None
        known = _symmetric(found, partners)
    return known


def _symmetric(found: MeshLandmarks, partners: NDArray[np.int64]) -> Reference:
    assert np.isfinite(found.points).all()
    mesh = found.mesh
    places = (found.points + found.points[partners] * _MIRROR) / 2
    at, _ = NearestSurface(mesh.vertices, mesh.triangles, np.arange(len(mesh.triangles))).points(places)
    normals = np.einsum("pc,pcd->pd", at.barycentric, mesh.normals[mesh.triangles[at.faces]].astype(np.float64))
    normals = normals + normals[partners] * _MIRROR
    return Reference(places, normals / np.linalg.norm(normals, axis=1, keepdims=True), partners)


def _partners() -> NDArray[np.int64]:
    """Return the point opposite each of the 468, as (468,).

    In pictures of symmetric heads, the points of one side are mirror images of those of the other.
    """
    cost = np.zeros((N_POINTS, N_POINTS))
    for name in _HEADS:
        mesh = painted_character(load_character(name))
        for yaw in _PAIR_YAWS:
            one, other = (View.of(mesh, _UPRIGHT, angle) for angle in (yaw, -yaw))
            assert one is not None
            assert other is not None
            turned = one.landmarks.points * _MIRROR + (one.camera.size[0], 0.0, 0.0)
            cost += ((turned[:, None] - other.landmarks.points) ** 2).sum(axis=2)
    partners = linear_sum_assignment(cost + cost.T)[1]
    assert np.array_equal(partners[partners], np.arange(N_POINTS))
    return partners.astype(np.int64)
