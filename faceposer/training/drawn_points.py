"""Feature points of an imported face that its motion does not give, found in pictures of it."""

from dataclasses import dataclass

import numpy as np

from faceposer.geometry.alignment import Similarity
from faceposer.landmarks.feature_points import feature_places
from faceposer.landmarks.on_meshes import find_mesh_landmarks
from faceposer.landmarks.painting import painted_parts
from faceposer.training.assemble import CanonicalMesh

# The face must be about where the mesh has it: largest turn in degrees, and ratio of sizes.
_LARGEST_TURN, _LARGEST_RATIO = 35.0, 2.0


@dataclass(frozen=True)
class DrawnPoints:
    """Feature points found in pictures.

    Attributes:
        points: Vertex id by MPEG-4 feature point.
        titles: Readable name of each.
    """

    points: dict[str, int]
    titles: dict[str, str]


def drawn_feature_points(mesh: CanonicalMesh) -> DrawnPoints:
    """Return the feature points of ``mesh``, or none if no face is seen in pictures of it.

    Points beyond the landmarks, as of the ears, are extrapolated from the built-in man, and left out for a face that
    does not resemble his.
    """
    painted = painted_parts(mesh.vertices, mesh.polygons, mesh.uv, mesh.polygon_uvs, mesh.parts, mesh.textures)
    on_skin = np.zeros(len(mesh.vertices), dtype=bool)
    for part in mesh.parts:
        on_skin[slice(*part.vertices)] |= part.material == "skin"
    skin = np.flatnonzero(on_skin[painted.triangles].all(axis=1))
    nothing = DrawnPoints({}, {})
    if not skin.size:
        return nothing
    found = find_mesh_landmarks(painted, Similarity(np.eye(3), np.zeros(3), np.array(1.0)))
    if found is None:
        return nothing
    turn = np.degrees(np.arccos(np.clip((np.trace(found.frame.rotation) - 1.0) / 2.0, -1.0, 1.0)))
    if turn > _LARGEST_TURN or abs(np.log(float(found.frame.scale))) > np.log(_LARGEST_RATIO):
        return nothing
    places = feature_places(found, skin)
    kept = {name: place for name, place in places.items() if mesh.resembles_man or not place.extrapolated}
    return DrawnPoints(
        {name: place.vertex for name, place in kept.items()}, {name: place.title for name, place in kept.items()}
    )
