"""Colours of the skin in a photo without the light that was found."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from faceposer.geometry.mesh import VertexNormals
from faceposer.identity.photos.face_camera import FaceCamera
from faceposer.identity.photos.face_texels import Spots, smooth_step
from faceposer.identity.photos.harmonics import harmonics
from faceposer.identity.photos.head_basis import HeadBasis
from faceposer.identity.photos.skin_light import GAMMA, SkinLight
from faceposer.landmarks.drawing import visible_triangles

Array = NDArray[np.float64]
Image32 = NDArray[np.float32]

# Cosines between the surface and the view between which a photo begins to count and counts fully.
_FACING = (0.2, 0.6)
# Depth behind the surface in the picture, in centimetres, at which a point is hidden.
_HIDDEN = 0.35
# Least light, relative to the median, by which colours are divided, and largest share of a colour that is highlight.
_DARKEST, _MOST_GLOSS = 0.25, 0.5


@dataclass(frozen=True, eq=False)
class LitPhoto:
    """A photo of a head in its light.

    Attributes:
        image: Colours, 0 to 1, shape (h, w, 3).
        camera: Its camera.
        vertices: All vertices of the head in its expression, shape (N, 3).
        light: Coefficients of the light of a display's colours in camera axes, shape (9, 3).
        lamp: The light in linear colours, with highlights, which then counts instead.
    """

    image: Image32
    camera: FaceCamera
    vertices: Array
    light: Array
    lamp: SkinLight | None = None


def unlit_colours(photo: LitPhoto, spots: Spots, basis: HeadBasis) -> tuple[Array, Array, Array]:
    """Return colours of points of the skin in ``photo`` without its light, (n, 3), their weights and cosines, (n,)."""
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
    at_texels = spots.of_vertices(np.concatenate([local, normals], axis=1))
    places, normals = at_texels[:, :3], at_texels[:, 3:]
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-9)
    middles = places + (*camera.offset, np.exp(camera.log_depth))
    towards = -middles / np.linalg.norm(middles, axis=1, keepdims=True)
    pixels = camera.pixels(places)
    cells = np.floor(pixels).astype(np.int64)
    inside = ((cells >= 0) & (cells < (width, height))).all(axis=1)
    cells = np.clip(cells, 0, (width - 1, height - 1))
    visible = inside & (places[:, 2] + np.exp(camera.log_depth) < front[cells[:, 1] * width + cells[:, 0]] + _HIDDEN)
    facing = (normals * towards).sum(axis=1)
    trust = spots.region * visible * smooth_step(facing, _FACING)
    at = pixels[:, ::-1].T - 0.5
    colours = np.stack(
        [ndimage.map_coordinates(photo.image[..., k], at, order=1, mode="nearest") for k in range(3)], axis=1
    )
    if photo.lamp is None:
        return colours / _bounded(harmonics(normals) @ photo.light, trust), trust, facing
    lit = photo.lamp.lit(np.full_like(normals, 0.5), normals, middles)
    linear = np.maximum(colours, 0.0) ** GAMMA
    linear -= np.minimum(lit.gloss[:, None], _MOST_GLOSS * linear)
    albedo: Array = (linear / _bounded(lit.shade, trust)) ** (1.0 / GAMMA)
    return albedo, trust, facing


def _bounded(shade: Array, trust: Array) -> Array:
    """Return the light at the points, (n, 3), without that which is far below the usual."""
    usual = np.median(shade[trust > 0.5], axis=0) if (trust > 0.5).any() else np.ones(3)
    result: Array = np.maximum(shade, _DARKEST * np.maximum(usual, 1e-3))
    return result
