"""The texels of the face of the built-in heads, on the grid on which photos are looked up."""

from dataclasses import dataclass
from functools import lru_cache
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from faceposer.identity.photos.face_places import INNER_LIPS, OVAL, FacePlaces
from faceposer.identity.photos.glasses import FrontView
from faceposer.identity.photos.head_basis import HeadBasis
from faceposer.identity.photos.skin_samples import LIDS
from faceposer.landmarks.drawing import visible_triangles
from faceposer.landmarks.points import EYE_CORNERS, N_POINTS
from faceposer.model.character import Character

Array = NDArray[np.float64]
Real = TypeVar("Real", np.float32, np.float64)

#: Side of the grid.
SIDE = 1024
# Distances from the landmarks, in centimetres, between which the face fades out, and from lids and inner lips, in.
_OUTER, _LIDS_GAP, _LIPS_GAP = (0.7, 1.8), (0.05, 0.2), (0.1, 0.3)
#: Landmarks on the brows without their outer ends, whose colours are no skin's, and the distance from them, in
#: centimetres, that is brow.
_BROWS = (105, 66, 107, 55, 65, 52, 334, 296, 336, 285, 295, 282)
_BROW_REACH = (0.1, 0.4)


@dataclass(frozen=True, eq=False)
class Spots:
    """Points of the skin at which photos are looked up.

    Attributes:
        corners: Vertices of their triangles, shape (n, 3).
        shares: Barycentric coordinates, shape (n, 3).
        region: How much each counts, 0 to 1, shape (n,).
    """

    corners: NDArray[np.integer]
    shares: Array
    region: Array

    def of_vertices(self, values: Array) -> Array:
        """Return ``values`` of vertices, (N, k), at the points, shape (n, k)."""
        result: Array = np.einsum("nc,ncd->nd", self.shares, values[self.corners])
        return result


@dataclass(frozen=True, eq=False)
class Texels(Spots):
    """The texels of the face, which count as they belong to what photos show of it.

    Attributes:
        at: Indices into the flat grid, shape (n,).
        brows: How much each belongs to the brows, 0 to 1, shape (n,).
        mirror: Index in the flat grid of the texel on the other side, shape (n,).
        front: Points of the front of the face, at which glasses are looked for.
    """

    at: NDArray[np.int64]
    brows: Array
    mirror: NDArray[np.int64]
    front: FrontView


@lru_cache(maxsize=1)
def face_texels(basis: HeadBasis, places: FacePlaces) -> Texels:
    """Return the texels of the face of the built-in heads, prepared at the first call."""
    from scipy.spatial import cKDTree

    character = basis.character
    triangles = basis.editor.template.triangles
    ids = character.triangle_uvs[: len(triangles)]
    pixels = np.stack([character.uv[:, 0], 1.0 - character.uv[:, 1]], axis=1).astype(np.float64) * SIDE
    faces, weights = visible_triangles(pixels, np.ones(len(pixels)), ids, (SIDE, SIDE))
    region = _region(character, basis.n_skin, places)
    covered = np.flatnonzero(faces >= 0)
    # Only those of the face, for the memory's sake.
    at = covered[(region[triangles[faces[covered]]] > 0.0).any(axis=1)]
    corners, shares = triangles[faces[at]], weights[at]
    # The opposite texel: that of the mirrored vertices, whose texture coordinates are those of any of their corners.
    place_of = np.zeros((basis.n_skin, 2))
    place_of[triangles.ravel()] = pixels[ids.ravel()]
    mirrored = place_of[basis.editor.template.mirror[corners]]
    spread = np.ptp(mirrored, axis=1).max(axis=1)
    target = np.einsum("nc,ncd->nd", shares, mirrored)
    cells = np.clip(target.astype(np.int64), 0, SIDE - 1)
    # Corners on both sides of a seam of the layout have no common place.
    mirror = np.where(spread < 0.03 * SIDE, cells[:, 1] * SIDE + cells[:, 0], at)
    known = places.points.positions(character.vertices, character.triangles)
    brows = 1.0 - smooth_step(cKDTree(known[list(_BROWS)]).query(character.vertices[: basis.n_skin])[0], _BROW_REACH)
    inside, hairy = (np.einsum("nc,nc->n", shares, values[corners]) for values in (region, brows))
    positions = np.einsum("nc,ncd->nd", shares, character.vertices[corners].astype(np.float64))
    eyes = np.stack([known[list(corner)].mean(axis=0) for corner in EYE_CORNERS])
    return Texels(corners, shares, inside, at, hairy, mirror, FrontView(positions, hairy, eyes))


def _region(character: Character, n_skin: int, places: FacePlaces) -> Array:
    """Return how much each vertex of the skin belongs to the face that photos show, 0 to 1, shape (N,)."""
    from scipy.spatial import cKDTree

    skin = character.vertices[:n_skin].astype(np.float64)
    landmarks = places.points.positions(character.vertices, character.triangles)
    result = np.ones(n_skin)
    inner = np.setdiff1d(np.arange(N_POINTS), OVAL)
    for group, limits, inwards in ((inner, _OUTER, True), (LIDS, _LIDS_GAP, False), (INNER_LIPS, _LIPS_GAP, False)):
        distances = cKDTree(landmarks[list(group)]).query(skin)[0]
        rise = smooth_step(distances, limits)
        result *= 1.0 - rise if inwards else rise
    # The inside of mouth and eye sockets lies behind the landmarks.
    front = cKDTree(landmarks[:, :2]).query(skin[:, :2])[1]
    result *= skin[:, 2] > landmarks[front, 2] - 2.5
    return result


def smooth_step(values: NDArray[Real], limits: tuple[float, float]) -> NDArray[Real]:
    """Return 0 below the first limit, 1 above the second, and a smooth rise between them."""
    t = np.clip((values - limits[0]) / (limits[1] - limits[0]), 0.0, 1.0)
    result: NDArray[Real] = t * t * (3.0 - 2.0 * t)
    return result
