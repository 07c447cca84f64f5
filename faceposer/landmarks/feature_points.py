"""Our MPEG-4 feature points of a mesh, from its landmarks.

The landmarks of the built-in man and his feature points are known. The space around him is bent so that his landmarks
come to lie on those of the other face; his feature points move along, and the nearest places of the surface are theirs.
The bend is that of `faceposer.geometry.space_bending`.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from faceposer.geometry.nearest_surface import NearestSurface
from faceposer.geometry.picking import SurfacePoint, SurfacePoints
from faceposer.geometry.space_bending import bend
from faceposer.landmarks.drawing import PaintedMesh
from faceposer.landmarks.on_meshes import MeshLandmarks
from faceposer.landmarks.points import Landmarks
from faceposer.landmarks.reference import reference
from faceposer.model.character_file import load_character

Array = NDArray[np.float64]

#: Feature points beyond the landmarks (jaw, ears, hairline, top and back of the head), which are extrapolated.
EXTRAPOLATED = ("2.13", "2.14", *(f"10.{n}" for n in range(1, 11)), *(f"11.{n}" for n in range(1, 7)))
#: Feature points on the eyes: those of the right and of the left pupil.
_PUPILS = ("3.6", "3.5")
# Ridge for landmarks whose views agree, in centimetres, and its growth with the square of their spread.
_RIDGE, _PER_SPREAD = 0.2, 1.0


@dataclass(frozen=True)
class FeaturePlace:
    """Where a feature point is on a mesh.

    Attributes:
        title: Readable name.
        place: Position in the unit and axes of the mesh.
        surface: The point of the surface.
        vertex: The nearest vertex of the surface.
        extrapolated: True beyond the landmarks, where it is a guess.
    """

    title: str
    place: tuple[float, float, float]
    surface: SurfacePoint
    vertex: int
    extrapolated: bool


def feature_places(found: MeshLandmarks, skin: NDArray[np.integer] | None = None) -> Mapping[str, FeaturePlace]:
    """Return the feature points of a mesh by their MPEG-4 names.

    Args:
        found: Landmarks of the mesh.
        skin: Indices of the triangles on which all but the pupils lie; all triangles if None.
    """
    man, mesh = load_character("man"), found.mesh
    names = list(man.feature_points)
    wanted = man.vertices[[man.feature_points[name] for name in names]].astype(np.float64)
    places = bent(found, wanted)
    for name, pupil in zip(_PUPILS, found.pupils, strict=True):
        if name in names and np.isfinite(pupil).all():
            places[names.index(name)] = pupil
    everywhere = np.arange(len(mesh.triangles))
    surfaces = {False: NearestSurface(mesh.vertices, mesh.triangles, everywhere if skin is None else skin)}
    surfaces[True] = NearestSurface(mesh.vertices, mesh.triangles, everywhere)
    result = {}
    for name, wanted_place in zip(names, places, strict=True):
        surface = surfaces[name in _PUPILS]
        on_surface, _ = surface.points(wanted_place[None])
        place = _place_of(mesh, on_surface)
        at_vertex, _ = surface.at_vertices(place[None])
        point, vertex = on_surface[0], at_vertex[0]
        assert isinstance(point, SurfacePoint)
        assert isinstance(vertex, int)
        x, y, z = place.tolist()
        result[name] = FeaturePlace(man.feature_titles[name], (x, y, z), point, vertex, name in EXTRAPOLATED)
    return result


def bent(found: MeshLandmarks, places: Array) -> Array:
    """Return ``places`` of the man, (n, 3) in centimetres, moved to the face of ``found``, in the unit of its mesh."""
    known = np.isfinite(found.points).all(axis=1)
    spread = np.nan_to_num(found.spread[known]) * float(found.frame.scale)
    ridge = _RIDGE + _PER_SPREAD * spread**2
    moved = bend(places, reference().places[known], found.frame.apply(found.points[known]), ridge)
    return found.frame.inverse().apply(moved)


def feature_pixels(found: Landmarks) -> Mapping[str, tuple[float, float]]:
    """Return the pixels of the feature points that landmarks in an image determine, by their MPEG-4 names."""
    man = load_character("man")
    names = [name for name in man.feature_points if name not in EXTRAPOLATED]
    wanted = man.vertices[[man.feature_points[name] for name in names]].astype(np.float64)
    # Pixels have y down and the depth away from the viewer; the ridge is far below the distances of the points.
    upright = found.points * (1.0, -1.0, -1.0)
    places = bend(wanted, reference().places, upright, np.full(len(upright), _RIDGE))[:, :2] * (1.0, -1.0)
    for name, iris in zip(_PUPILS, found.iris, strict=True):
        places[names.index(name)] = iris[0, :2]
    return {name: (float(u), float(v)) for name, (u, v) in zip(names, places.tolist(), strict=True)}


def _place_of(mesh: PaintedMesh, points: SurfacePoints) -> Array:
    corners = mesh.vertices[mesh.triangles[points.faces[0]]]
    place: Array = points.barycentric[0] @ corners
    return place
