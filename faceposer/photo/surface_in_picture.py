"""A character's surface in a picture: what each pixel shows of it, and in which colours."""

import io
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from faceposer.geometry.camera import Camera
from faceposer.geometry.texture_images import DECODER_ERRORS
from faceposer.landmarks.drawing import visible_triangles
from faceposer.model.character import Character, Part
from faceposer.model.materials import BASE_COLOURS

Array = NDArray[np.float64]
Ints = NDArray[np.integer]

#: Materials of the inside of the mouth, besides the skin's lining.
MOUTH_MATERIALS = ("teeth", "gums", "tongue")
_LARGEST_TEXTURE = 1024
# The lining of the mouth: skin up to this far above and below the lips, and this far behind their inner edges, as
# shares of the head's height.
_LINING_REACH, _LINING_DEPTH = 0.1, 0.02
# Distance of a piece of the lining from the middle of the lips, up or down and behind, as shares of the head's height.
_BETWEEN = (0.02, 0.15)
#: Feature points of the corners of the mouth and of the middles of the inner edges of the lips.
_CORNERS, _MIDDLES = ("2.4", "2.5"), ("2.2", "2.3")


@dataclass(frozen=True, eq=False)
class SurfaceInPicture:
    """The surface that a camera sees.

    Attributes:
        faces: Triangle of the character at each pixel, or -1, shape (h * w,).
        at: Pixels that show the surface, indices into ``faces``, shape (n,).
        corners: Vertices of their triangles, shape (n, 3).
        shares: Barycentric coordinates, shape (n, 3).
        depth: Depth at each pixel, infinite where there is no surface, shape (h, w).
    """

    faces: NDArray[np.int64]
    at: NDArray[np.int64]
    corners: Ints
    shares: Array
    depth: Array

    @classmethod
    def of(cls, character: Character, vertices: Array, camera: Camera) -> "SurfaceInPicture":
        """Return what ``camera`` sees of ``character`` with ``vertices``, (N, 3); lashes are left out."""
        width, height = camera.size
        solid = character.solid_triangles
        triangles = character.triangles[solid]
        depths = camera.to_camera(vertices)[:, 2]
        found, weights = visible_triangles(camera.project(vertices), depths, triangles, (width, height))
        at = np.flatnonzero(found >= 0)
        faces = np.full(len(found), -1, dtype=np.int64)
        faces[at] = solid[found[at]]
        corners, shares = triangles[found[at]], weights[at]
        depth = np.full(len(found), np.inf)
        depth[at] = (shares * depths[corners]).sum(axis=1)
        return cls(faces, at, corners, shares, depth.reshape(height, width))

    def of_vertices(self, values: Array) -> Array:
        """Return ``values`` of vertices, (N, k), at the pixels that show the surface, shape (n, k)."""
        result: Array = np.einsum("nc,ncd->nd", self.shares, values[self.corners])
        return result

    def colours(self, character: Character, among: NDArray[np.bool_] | None = None) -> Array:
        """Return the colours of ``character`` under white light, 0 to 1, at its pixels, or ``among`` them, (n, 3)."""
        chosen = np.arange(len(self.at)) if among is None else np.flatnonzero(among)
        faces, shares = self.faces[self.at[chosen]], self.shares[chosen]
        result = np.full((len(chosen), 3), 0.5)
        for part in character.parts:
            first, last = character.part_triangles(part)
            mine = np.flatnonzero((faces >= first) & (faces < last))
            if not mine.size:
                continue
            texture = _texture_of(character, part)
            if texture is None:
                result[mine] = np.array(BASE_COLOURS.get(part.material, (0.5, 0.5, 0.5))) ** (1.0 / 2.2)
                continue
            result[mine] = _colours_at(character, faces[mine], shares[mine], texture)
        return result

    def looked_up(self, character: Character, image: NDArray[np.float32]) -> Array:
        """Return the values of ``image``, (h, w, k), in the layout of the skin, 0 on other parts, shape (n, k)."""
        faces = self.faces[self.at]
        result = np.zeros((len(self.at), image.shape[2]))
        for part in character.parts:
            if part.material == "skin":
                first, last = character.part_triangles(part)
                mine = np.flatnonzero((faces >= first) & (faces < last))
                result[mine] = _colours_at(character, faces[mine], self.shares[mine], image)
        return result


def _colours_at(character: Character, faces: Ints, shares: Array, image: NDArray[np.float32]) -> Array:
    """Return the values of a texture, (h, w, k), at points of triangles with barycentric coordinates, shape (n, k)."""
    uv = np.einsum("nc,ncd->nd", shares, character.uv[character.triangle_uvs[faces]])
    height, width = image.shape[:2]
    place = np.stack([(1.0 - uv[:, 1] % 1.0) * height - 0.5, uv[:, 0] % 1.0 * width - 0.5])
    looked_up = [
        ndimage.map_coordinates(image[..., channel], place, order=1, mode="nearest")
        for channel in range(image.shape[2])
    ]
    return np.stack(looked_up, axis=1).astype(np.float64)


def _texture_of(character: Character, part: Part) -> NDArray[np.float32] | None:
    data = character.textures.get(part.name, character.textures.get(part.material))
    return None if data is None else _decoded(data)


@lru_cache(maxsize=8)
def _decoded(data: bytes) -> NDArray[np.float32] | None:
    """Return the colours of an encoded texture, 0 to 1, shape (h, w, 3), or None if it is damaged."""
    from PIL import Image

    try:
        with Image.open(io.BytesIO(data)) as image:
            image.thumbnail((_LARGEST_TEXTURE, _LARGEST_TEXTURE))
            return np.asarray(image.convert("RGB"), dtype=np.float32) / 255.0
    except (OSError, *DECODER_ERRORS):
        return None


def inside_of_mouth(character: Character) -> NDArray[np.bool_]:
    """Return the mask of the triangles inside the mouth: teeth, gums, tongue, and the lining of the skin, (T,)."""
    result = triangles_of(character, MOUTH_MATERIALS)
    points = character.feature_points
    if any(name not in points for name in (*_CORNERS, *_MIDDLES)):
        return result
    vertices = character.vertices.astype(np.float64)
    right, left = (vertices[int(points[name])] for name in _CORNERS)
    middle = vertices[[int(points[name]) for name in _MIDDLES]].mean(axis=0)
    half = max(0.5 * abs(float(left[0] - right[0])), 1e-6)
    aside = np.abs(vertices[:, 0] - middle[0]) / half
    # The inner edge of the lips recedes towards the corners like a parabola.
    edge = middle[2] + (0.5 * (left[2] + right[2]) - middle[2]) * np.minimum(aside, 1.0) ** 2
    near = np.abs(vertices[:, 1] - middle[1]) < _LINING_REACH * character.height
    lining = (aside < 1.0) & near & (vertices[:, 2] < edge - _LINING_DEPTH * character.height)
    skin = triangles_of(character, ("skin",)) & lining[character.triangles].all(axis=1)
    result[np.flatnonzero(skin)[_between_lips(character, character.triangles[skin], middle)]] = True
    return result


def _between_lips(character: Character, triangles: Ints, middle: Array) -> NDArray[np.bool_]:
    """Return which of ``triangles``, (n, 3), belong to pieces of the skin that begin between the lips, (n,).

    Others are as far behind the lips, too: the fold above the chin, and the neck.
    """
    edges = np.concatenate([triangles[:, :2], triangles[:, 1:]])
    count = len(character.vertices)
    links = coo_matrix((np.ones(len(edges), dtype=bool), edges.T), shape=(count, count))
    pieces = connected_components(links, directed=False)[1]
    above = np.abs(character.vertices[:, 1] - middle[1]) / character.height
    behind = (middle[2] - character.vertices[:, 2]) / character.height
    begins = np.unique(pieces[(above < _BETWEEN[0]) & (behind < _BETWEEN[1])])
    result: NDArray[np.bool_] = np.isin(pieces[triangles[:, 0]], begins)
    return result


def triangles_of(character: Character, materials: tuple[str, ...]) -> NDArray[np.bool_]:
    """Return the mask of the triangles of parts with one of ``materials``, shape (T,)."""
    result = np.zeros(len(character.triangles), dtype=bool)
    for part in character.parts:
        if part.material in materials:
            result[slice(*character.part_triangles(part))] = True
    return result
