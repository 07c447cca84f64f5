"""The texture of a head from photos of it, free of their light (Blanz and Vetter 1999, section 4.1).

Every texel of the face that a photo sees gets its colour there divided by the light that was found. Photos are mixed
by how directly they see it; where none does, the mirrored side is taken, then the texture model. Colours that no skin
under that light has, as of hair over the forehead, of glasses and of highlights, do not count.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from faceposer.geometry.mesh import VertexNormals
from faceposer.identity.photos.face_camera import FaceCamera
from faceposer.identity.photos.face_places import INNER_LIPS, OVAL, FacePlaces
from faceposer.identity.photos.glasses import FrontView
from faceposer.identity.photos.harmonics import harmonics
from faceposer.identity.photos.head_basis import HeadBasis
from faceposer.identity.photos.skin_samples import LIDS
from faceposer.identity.scans.baking import Layer, blended
from faceposer.landmarks.drawing import visible_triangles
from faceposer.landmarks.points import EYE_CORNERS, N_POINTS
from faceposer.model.character import Character

Array = NDArray[np.float64]
Image32 = NDArray[np.float32]

# Sides of the grid on which photos are looked up, and of the texture.
_SIDE, _TEXTURE = 1024, 2048
# Cosines between the surface and the view between which a photo begins to count and counts fully.
_FACING = (0.2, 0.6)
# Distances from the landmarks, in centimetres, between which the face fades out, and from lids and inner lips, in.
_OUTER, _LIDS_GAP, _LIPS_GAP = (0.7, 1.8), (0.05, 0.2), (0.1, 0.3)
# Depth behind the surface in the picture, in centimetres, at which a texel is hidden.
_HIDDEN = 0.35
# Least light, relative to the median, by which colours are divided.
_DARKEST = 0.25
# Colour below which logarithms are not told apart.
_BLACK = 0.02
# Logarithm by which smooth colours differ from the model's where they cannot be of the skin.
_FOREIGN, _FOREIGN_BLUR = 0.3, 6.0
# Least half width of large areas of hair, and reach of strands beside them, in texels.
_LARGE, _STRANDS = 14, (12.0, 24.0)
#: Landmarks on the brows without their outer ends, whose colours are no skin's, and the distance from them, in
#: centimetres, that is brow.
_BROWS = (105, 66, 107, 55, 65, 52, 334, 296, 336, 285, 295, 282)
_BROW_REACH = (0.1, 0.4)
# Weight of the mirrored side relative to the own one.
_MIRRORED = 0.02
_LEAST = 0.004


@dataclass(frozen=True, eq=False)
class LitPhoto:
    """A photo of a head in its light.

    Attributes:
        image: Colours, 0 to 1, shape (h, w, 3).
        camera: Its camera.
        vertices: All vertices of the head in its expression, shape (N, 3).
        light: Coefficients of the light in camera axes, shape (9, 3).
    """

    image: Image32
    camera: FaceCamera
    vertices: Array
    light: Array


@dataclass(frozen=True, eq=False)
class Texels:
    """The texels of the face.

    Attributes:
        at: Indices into the flat grid, shape (n,).
        corners: Vertices of their triangles, shape (n, 3).
        shares: Barycentric coordinates, shape (n, 3).
        region: How much each belongs to the face that photos show, 0 to 1, shape (n,).
        brows: How much each belongs to the brows, 0 to 1, shape (n,).
        mirror: Index in the flat grid of the texel on the other side, shape (n,).
        front: Points of the front of the face, at which glasses are looked for.
    """

    at: NDArray[np.int64]
    corners: NDArray[np.integer]
    shares: Array
    region: Array
    brows: Array
    mirror: NDArray[np.int64]
    front: FrontView

    def of_vertices(self, values: Array) -> Array:
        """Return ``values`` of vertices, (N, k), at the texels, shape (n, k)."""
        result: Array = np.einsum("nc,ncd->nd", self.shares, values[self.corners])
        return result


@lru_cache(maxsize=1)
def face_texels(basis: HeadBasis, places: FacePlaces) -> Texels:
    """Return the texels of the face of the built-in heads, prepared at the first call."""
    from scipy.spatial import cKDTree

    character = basis.character
    triangles = basis.editor.template.triangles
    ids = character.triangle_uvs[: len(triangles)]
    pixels = np.stack([character.uv[:, 0], 1.0 - character.uv[:, 1]], axis=1).astype(np.float64) * _SIDE
    faces, weights = visible_triangles(pixels, np.ones(len(pixels)), ids, (_SIDE, _SIDE))
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
    cells = np.clip(target.astype(np.int64), 0, _SIDE - 1)
    # Corners on both sides of a seam of the layout have no common place.
    mirror = np.where(spread < 0.03 * _SIDE, cells[:, 1] * _SIDE + cells[:, 0], at)
    known = places.points.positions(character.vertices, character.triangles)
    brows = 1.0 - _smooth(cKDTree(known[list(_BROWS)]).query(character.vertices[: basis.n_skin])[0], _BROW_REACH)
    inside, hairy = (np.einsum("nc,nc->n", shares, values[corners]) for values in (region, brows))
    positions = np.einsum("nc,ncd->nd", shares, character.vertices[corners].astype(np.float64))
    eyes = np.stack([known[list(corner)].mean(axis=0) for corner in EYE_CORNERS])
    return Texels(at, corners, shares, inside, hairy, mirror, FrontView(positions, hairy, eyes))


def _region(character: Character, n_skin: int, places: FacePlaces) -> Array:
    """Return how much each vertex of the skin belongs to the face that photos show, 0 to 1, shape (N,)."""
    from scipy.spatial import cKDTree

    skin = character.vertices[:n_skin].astype(np.float64)
    landmarks = places.points.positions(character.vertices, character.triangles)
    result = np.ones(n_skin)
    inner = np.setdiff1d(np.arange(N_POINTS), OVAL)
    for group, limits, inwards in ((inner, _OUTER, True), (LIDS, _LIDS_GAP, False), (INNER_LIPS, _LIPS_GAP, False)):
        distances = cKDTree(landmarks[list(group)]).query(skin)[0]
        rise = _smooth(distances, limits)
        result *= 1.0 - rise if inwards else rise
    # The inside of mouth and eye sockets lies behind the landmarks.
    front = cKDTree(landmarks[:, :2]).query(skin[:, :2])[1]
    result *= skin[:, 2] > landmarks[front, 2] - 2.5
    return result


def _smooth(values: Array, limits: tuple[float, float]) -> Array:
    t = np.clip((values - limits[0]) / (limits[1] - limits[0]), 0.0, 1.0)
    result: Array = t * t * (3.0 - 2.0 * t)
    return result


def photo_texture(
    photos: Iterable[LitPhoto], under: bytes, basis: HeadBasis, places: FacePlaces, tolerance: float = 1.0
) -> bytes:
    """Return the encoded texture, JPEG, of a head in ``photos``, over the encoded texture ``under`` of the model.

    Colours that differ more than skin under one light does, times ``tolerance``, are left out.

    Raises:
        FacePoserError: If ``under`` cannot be decoded.
    """
    return blended([_layer(photos, _grid(under), basis, places, tolerance)], under)


def _layer(photos: Iterable[LitPhoto], model: Array, basis: HeadBasis, places: FacePlaces, tolerance: float) -> Layer:
    """Return the colours of the face in ``photos``, own and mirrored, with ``model``, (side², 3), for comparison."""
    texels = face_texels(basis, places)
    total = np.zeros((_SIDE * _SIDE, 3), dtype=np.float32)
    share = np.zeros(_SIDE * _SIDE, dtype=np.float32)
    for photo in photos:
        colours, weights = _seen(photo, texels, basis)
        weights = weights * _plausible(colours, weights, model, texels, tolerance)
        total[texels.at] += (weights[:, None] * colours).astype(np.float32)
        share[texels.at] += weights.astype(np.float32)
    other_side = share[texels.mirror]
    opposite = total[texels.mirror] / np.maximum(other_side, 1e-9)[:, None]
    total[texels.at] += (_MIRRORED * other_side)[:, None] * opposite
    share[texels.at] += _MIRRORED * other_side
    total *= 255.0 / np.maximum(share, 1e-9)[:, None]
    known = (share > _LEAST).reshape(_SIDE, _SIDE)
    filled = _extended(np.clip(total, 0.0, 255.0).reshape(_SIDE, _SIDE, 3), known)
    factor = _TEXTURE // _SIDE
    large = ndimage.zoom(filled, (factor, factor, 1), order=1, grid_mode=True, mode="nearest")
    return Layer(large, np.repeat(np.repeat(known, factor, 0), factor, 1))


def _seen(photo: LitPhoto, texels: Texels, basis: HeadBasis) -> tuple[Array, Array]:
    """Return the colours of the texels in ``photo`` without its light, (n, 3), and their weights, (n,)."""
    camera, character = photo.camera, basis.character
    vertices = photo.vertices
    local = camera.local(vertices)
    depth = local[:, 2] + np.exp(camera.log_depth)
    height, width = photo.image.shape[:2]
    solid = character.triangles[character.solid_triangles]
    faces, weights = visible_triangles(camera.pixels(local), depth, solid, (width, height))
    front = np.full(width * height, np.inf)
    covered = np.flatnonzero(faces >= 0)
    front[covered] = (weights[covered] * depth[solid[faces[covered]]]).sum(axis=1)
    normals = VertexNormals(character.triangles, len(vertices))(vertices).astype(np.float64) @ camera.rotation.T
    at_texels = texels.of_vertices(np.concatenate([local, normals], axis=1))
    places, normals = at_texels[:, :3], at_texels[:, 3:]
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-9)
    towards = -(places + (*camera.offset, np.exp(camera.log_depth)))
    towards /= np.linalg.norm(towards, axis=1, keepdims=True)
    pixels = camera.pixels(places)
    cells = np.floor(pixels).astype(np.int64)
    inside = ((cells >= 0) & (cells < (width, height))).all(axis=1)
    cells = np.clip(cells, 0, (width - 1, height - 1))
    visible = inside & (places[:, 2] + np.exp(camera.log_depth) < front[cells[:, 1] * width + cells[:, 0]] + _HIDDEN)
    trust = texels.region * visible * _smooth((normals * towards).sum(axis=1), _FACING)
    at = pixels[:, ::-1].T - 0.5
    colours = np.stack(
        [ndimage.map_coordinates(photo.image[..., k], at, order=1, mode="nearest") for k in range(3)], axis=1
    )
    shade = harmonics(normals) @ photo.light
    usual = np.median(shade[trust > 0.5], axis=0) if (trust > 0.5).any() else np.ones(3)
    return colours / np.maximum(shade, _DARKEST * np.maximum(usual, 1e-3)), trust


def _plausible(colours: Array, weights: Array, model: Array, texels: Texels, tolerance: float) -> Array:
    """Return factors on the weights of texels: less where smooth colours are not of this skin, and at glasses, (n,)."""
    logs = np.log(np.maximum(colours, _BLACK)) - np.log(np.maximum(model[texels.at], _BLACK))
    blurred = np.zeros((_SIDE * _SIDE, 4), dtype=np.float32)
    blurred[texels.at, :3] = logs * weights[:, None]
    blurred[texels.at, 3] = weights
    sigma = (_FOREIGN_BLUR, _FOREIGN_BLUR, 0.0)
    grid = ndimage.gaussian_filter(blurred.reshape(_SIDE, _SIDE, 4), sigma).reshape(-1, 4)
    smooth = grid[texels.at, :3] / np.maximum(grid[texels.at, 3:], 1e-6)
    usual = np.median(smooth[weights > 0.5], axis=0) if (weights > 0.5).any() else np.zeros(3)
    off = np.abs(smooth - usual).max(axis=1) / tolerance
    foreign = _smooth(off, (_FOREIGN, 2.0 * _FOREIGN))
    result: Array = np.maximum(1.0 - np.maximum(foreign, _beside(foreign, weights, texels)), texels.brows)
    bare = texels.front.kept((logs - usual) / tolerance, weights)
    return result if bare is None else result * bare


def _beside(foreign: Array, weights: Array, texels: Texels) -> Array:
    """Return how much texels lie beside large areas that are not of the skin, as strands beside hair, (n,)."""
    grid = np.zeros(_SIDE * _SIDE, dtype=bool)
    grid[texels.at] = (foreign > 0.9) & (weights > 0.0)
    large = ndimage.binary_opening(grid.reshape(_SIDE, _SIDE), iterations=_LARGE)
    distance = ndimage.distance_transform_edt(~large) if large.any() else np.full(large.shape, np.inf)
    result: Array = 1.0 - _smooth(distance.ravel()[texels.at], _STRANDS)
    return result


def _extended(image: Image32, known: NDArray[np.bool_]) -> Image32:
    """Return ``image`` with the nearest known colours where none is known, so that interpolation finds no black."""
    if known.all() or not known.any():
        return image
    _, (rows, columns) = ndimage.distance_transform_edt(~known, return_indices=True)
    result: Image32 = image[rows, columns]
    return result


def _grid(encoded: bytes) -> Array:
    """Return an encoded texture on the grid, 0 to 1, shape (side², 3)."""
    import io

    from PIL import Image

    with Image.open(io.BytesIO(encoded)) as picture:
        small = picture.convert("RGB").resize((_SIDE, _SIDE), Image.Resampling.BOX)
    return np.asarray(small, dtype=np.float64).reshape(-1, 3) / 255.0
