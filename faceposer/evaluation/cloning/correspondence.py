"""Correspondence between the skins of two characters, from feature points that both have.

The source is bent so that its feature points lie on those of the target, as Noh and Neumann do ("Expression cloning",
SIGGRAPH 2001, section 3), and then drawn to its surface by smooth displacements, as Sumner and Popović do (section 4).
Each place of the target gets the nearest place of the fitted source that faces the same way.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from faceposer.errors import FacePoserError
from faceposer.geometry.mesh import TriangleMesh
from faceposer.geometry.nearest_surface import closest_on_triangles
from faceposer.geometry.picking import SurfacePoints
from faceposer.identity.registration import LandmarkPairs, register
from faceposer.model.character import Character

Array = NDArray[np.float64]
Ints = NDArray[np.integer]
_FEWEST = 8
# Triangles that are compared: those nearest by their middles and normals, in which opposite normals count as twice this
# share of the height. Of these, the nearest one counts whose normal is within 70 degrees, or else the nearest one.
_CANDIDATES, _TURN, _FACING = 32, 0.03, 0.34
# Places within this share of the height of the mesh have a counterpart on it, those beyond twice that none.
_FAR = 0.06


@dataclass(frozen=True, eq=False)
class Skin:
    """The skin of a character as a mesh of its own.

    Attributes:
        vertices: Neutral positions, shape (N, 3).
        triangles: Vertex ids, shape (T, 3).
        points: Vertex of each feature point on it, by name.
        height: Height of the head.
    """

    vertices: Array
    triangles: Ints
    points: dict[str, int]
    height: float

    @classmethod
    def of(cls, character: Character) -> "Skin":
        """Return the first part of ``character`` with the material "skin"."""
        part = next(part for part in character.parts if part.material == "skin")
        first, end = part.vertices
        triangles = character.triangles[slice(*character.part_triangles(part))] - first
        points = {name: int(i) - first for name, i in character.feature_points.items() if first <= i < end}
        return cls(character.vertices[first:end].astype(np.float64), triangles, points, character.height)


def fitted(source: Skin, target: Skin) -> Array:
    """Return the vertices of ``source`` laid on the surface of ``target``, shape (N, 3).

    Raises:
        FacePoserError: If they share fewer than eight feature points, or their surfaces do not meet.
    """
    names = [name for name in source.points if name in target.points]
    if len(names) < _FEWEST:
        raise FacePoserError(f"The characters share {len(names)} feature points, too few for a correspondence.")
    ids, places = (np.array([skin.points[name] for name in names], dtype=np.intp) for skin in (source, target))
    marks = LandmarkPairs(SurfacePoints.at_vertices(ids), target.vertices[places], np.ones(len(names)))
    laid, on = (TriangleMesh(skin.vertices, skin.triangles) for skin in (source, target))
    return register(laid, on, marks).in_target()


def facing_triangles(
    places: Array, normals: NDArray[np.floating], vertices: Array, triangles: Ints, height: float
) -> tuple[NDArray[np.intp], Array, Array]:
    """Return the triangles of a mesh that are nearest to some places and face as they do.

    Where lips or lids touch, only the normals tell one from the other.

    Args:
        places: Positions, shape (n, 3).
        normals: Unit normals of their surface, shape (n, 3).
        vertices: Positions of the mesh, shape (N, 3).
        triangles: Vertex ids, shape (T, 3).
        height: Height of the head.

    Returns:
        Triangles, shape (n,), barycentric weights of the nearest points on them, shape (n, 3), and shares from 1 to 0,
        shape (n,), of the places that have a counterpart: parts that the mesh lacks, such as a neck, have none.
    """
    from scipy.spatial import cKDTree

    corners = vertices[triangles]
    turn = _TURN * height
    facing = turn * triangle_normals(vertices, triangles)
    wanted = turn * normals
    _, near = cKDTree(np.hstack([corners.mean(axis=1), facing])).query(
        np.hstack([places, wanted]), k=min(_CANDIDATES, len(triangles))
    )
    candidates = np.asarray(near).reshape(len(places), -1)
    faces, weights, least = candidates[:, 0], np.zeros((len(places), 3)), np.full(len(places), np.inf)
    for candidate in candidates.T:
        own, distances = closest_on_triangles(corners[candidate], places)
        away = np.einsum("nd,nd->n", facing[candidate], wanted) < _FACING * turn**2
        costs = distances + np.where(away, 10.0 * height, 0.0)
        better = costs < least
        faces = np.where(better, candidate, faces)
        weights[better], least[better] = own[better], costs[better]
    gaps = np.linalg.norm(np.einsum("nc,ncd->nd", weights, corners[faces]) - places, axis=1)
    shares: Array = np.clip(2.0 - gaps / (_FAR * height), 0.0, 1.0)
    return faces.astype(np.intp), weights, shares


def triangle_normals(vertices: Array, triangles: Ints) -> Array:
    """Return the unit normals of ``triangles``, shape (T, 3)."""
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    normals = np.cross(b - a, c - a)
    result: Array = normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
    return result
