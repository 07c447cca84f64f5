"""The parts of the skin that are compared with photos: shape, expression and colour at the triangles of the face."""

from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from faceposer.identity.photos.face_places import INNER_LIPS, OVAL, FacePlaces
from faceposer.identity.photos.head_basis import FacePoints, HeadBasis
from faceposer.identity.texture_model import TextureModel, load_texture_model
from faceposer.landmarks.points import N_POINTS

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

# Side of the images in which colours are looked up.
_TEXTURE = 512
# Distance from the landmarks up to which the skin counts as face, and from lids and inner lips from which it is used.
_REACH, _LID_GAP, _LIP_GAP = 1.2, 0.25, 0.3
#: Landmarks on the edges of the lids.
# fmt: off
LIDS: tuple[int, ...] = (
    33, 7, 163, 144, 145, 153, 154, 155, 133, 246, 161, 160, 159, 158, 157, 173,
    263, 249, 390, 373, 374, 380, 381, 382, 362, 466, 388, 387, 386, 385, 384, 398,
)
# fmt: on


@dataclass(frozen=True, eq=False)
class SkinSamples:
    """Triangles of the face.

    Attributes:
        points: Their vertices with the modes of heads and expressions.
        vertices: Ids of these vertices on the character, shape (n,).
        triangles: Indices into ``points``, shape (T, 3).
        faces: Ids of the triangles on the character, shape (T,).
        colour: Mean logarithm of the colour of each triangle, shape (T, 3).
        colours: Its modes, shape (M, T, 3).
    """

    points: FacePoints
    vertices: Ints
    triangles: Ints
    faces: Ints
    colour: Array
    colours: Array

    @cached_property
    def rows(self) -> Array:
        """Modes of heads and expressions by vertex, shape (n, 3, K + r)."""
        modes = np.concatenate([self.points.identity, self.points.expression])
        return np.ascontiguousarray(modes.transpose(1, 2, 0))

    def places(self, b: Array, p: Array) -> Array:
        """Return the vertices of a head with coefficients ``b``, (K,), in the pose ``p``, (r,), shape (n, 3)."""
        result: Array = self.points.mean + self.rows @ np.concatenate([b, p])
        return result

    def with_identity(self, identity: Array) -> "SkinSamples":
        """Return the samples with other modes of heads, shape (K', n, 3)."""
        return replace(self, points=replace(self.points, identity=identity))


def face_samples(basis: HeadBasis, places: FacePlaces, texture: TextureModel) -> SkinSamples:
    """Return the triangles of the face that photos show as skin: no lids' edges, no inside of the lips, no neck."""
    from scipy.spatial import cKDTree

    character, n = basis.character, basis.n_skin
    skin = character.vertices[:n].astype(np.float64)
    landmarks = places.points.positions(character.vertices, character.triangles)
    inner = np.setdiff1d(np.arange(N_POINTS), OVAL)
    near, _ = cKDTree(landmarks[inner]).query(skin)
    gaps = [
        cKDTree(landmarks[list(group)]).query(skin)[0] > gap
        for group, gap in ((LIDS, _LID_GAP), (INNER_LIPS, _LIP_GAP))
    ]
    used = (near < _REACH) & gaps[0] & gaps[1]
    triangles = character.triangles
    chosen = np.flatnonzero((triangles < n).all(axis=1) & used[np.minimum(triangles, n - 1)].all(axis=1))
    corners = triangles[chosen]
    cross = np.cross(skin[corners[:, 1]] - skin[corners[:, 0]], skin[corners[:, 2]] - skin[corners[:, 0]])
    chosen = chosen[cross[:, 2] > -0.3 * np.linalg.norm(cross, axis=1)]
    vertices, inverse = np.unique(triangles[chosen], return_inverse=True)
    model = basis.model
    expression = model.basis.reshape(model.n_coefficients, -1, 3)[:, vertices].astype(np.float64)
    points = FacePoints(character.vertices[vertices].astype(np.float64), basis.identity_rows(vertices), expression)
    colour, colours = _colours(basis, chosen, texture)
    return SkinSamples(
        points,
        vertices.astype(np.int64),
        inverse.reshape(-1, 3).astype(np.int64),
        chosen.astype(np.int64),
        colour,
        colours,
    )


def _colours(basis: HeadBasis, chosen: Ints, texture: TextureModel) -> tuple[Array, Array]:
    """Return mean and modes of the logarithms of colours at the middles of the triangles ``chosen``."""
    mean, modes = texture.log_basis(_TEXTURE)
    uv = corner_uvs(basis)[chosen].mean(axis=1)
    rows = np.clip(((1.0 - uv[:, 1]) * _TEXTURE).astype(np.int64), 0, _TEXTURE - 1)
    columns = np.clip((uv[:, 0] * _TEXTURE).astype(np.int64), 0, _TEXTURE - 1)
    return (
        mean[:, rows, columns].T.astype(np.float64),
        modes[:, :, rows, columns].transpose(0, 2, 1).astype(np.float64),
    )


def corner_uvs(basis: HeadBasis) -> Array:
    """Return the texture coordinates of the corners of the skin's triangles, shape (T, 3, 2)."""
    character = basis.character
    polygons = character.polygon_uvs[slice(*character.parts[0].polygons)]
    ids = polygons[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3)
    return np.asarray(character.uv[ids], dtype=np.float64)


@lru_cache(maxsize=1)
def shipped_samples(basis: HeadBasis, places: FacePlaces) -> SkinSamples:
    """Return the samples with the shipped texture model, prepared at the first call."""
    return face_samples(basis, places, load_texture_model())
