"""Correspondence between the skins of two characters, from feature points that both have.

The source is warped by radial basis functions that take its feature points to those of the target, as Noh and Neumann
do ("Expression cloning", SIGGRAPH 2001, section 3); each place of the target gets the nearest place of the warped
source.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from faceposer.errors import FacePoserError
from faceposer.geometry.nearest_surface import NearestSurface
from faceposer.model.character import Character

Array = NDArray[np.float64]
Ints = NDArray[np.integer]
_FEWEST = 8


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

    @cached_property
    def surface(self) -> NearestSurface:
        """Queries of nearest points."""
        return NearestSurface(self.vertices, self.triangles, np.arange(len(self.triangles)))


def warped(source: Skin, target: Skin) -> Array:
    """Return the vertices of ``source`` warped to the shape of ``target``, shape (N, 3).

    Raises:
        FacePoserError: If they share fewer than eight feature points.
    """
    from scipy.interpolate import RBFInterpolator

    names = [name for name in source.points if name in target.points]
    starts, ends = (
        np.array([skin.vertices[skin.points[name]] for name in names]).reshape(-1, 3) for skin in (source, target)
    )
    _, kept = np.unique(starts.round(9), axis=0, return_index=True)
    if len(kept) < _FEWEST:
        raise FacePoserError(f"The characters share {len(kept)} feature points, too few for a correspondence.")
    warp = RBFInterpolator(starts[kept], ends[kept], kernel="linear", degree=1)
    result: Array = warp(source.vertices)
    return result


def warped_onto(source: Skin, target: Skin) -> Array:
    """Return the vertices of ``source`` warped and projected to the surface of ``target``, shape (N, 3)."""
    points, _ = target.surface.points(warped(source, target))
    return points.positions(target.vertices, target.triangles)


def nearest_triangles(places: Array, vertices: Array, triangles: Ints) -> tuple[NDArray[np.intp], Array]:
    """Return the triangles of a mesh nearest to ``places``, (n, 3), shape (n,), and barycentric weights, (n, 3)."""
    points, _ = NearestSurface(vertices, triangles, np.arange(len(triangles))).points(places)
    return points.faces.astype(np.intp), points.barycentric
