"""A photo of the average head, drawn in a light that is known."""

import io
from collections.abc import Callable

import numpy as np
from PIL import Image, ImageDraw
from scipy import ndimage

from faceposer.geometry.camera import Camera
from faceposer.geometry.mesh import VertexNormals
from faceposer.identity.editing import textures_of
from faceposer.identity.identity import SkinTexture
from faceposer.identity.photos.face_camera import FaceCamera
from faceposer.identity.photos.head_basis import HeadBasis
from faceposer.identity.photos.skin_light import SkinLight
from faceposer.identity.photos.unlit_colours import LitPhoto
from faceposer.identity.skin_layers import SkinLayers
from faceposer.identity.texture_model import load_texture_model
from faceposer.landmarks.drawing import visible_triangles

SIZE = (560, 620)
Draw = Callable[[ImageDraw.ImageDraw, Callable[[np.ndarray], list[tuple[float, float]]]], None]


def encoded_skin(brows: str, beard: float = 0.0) -> bytes:
    """Return a texture of the model with short hair."""
    coefficients = np.random.default_rng(3).standard_normal(load_texture_model().n_coefficients)
    layers = SkinLayers(hair="short", brows=brows, beard=beard)
    return textures_of(SkinTexture(tuple(coefficients.tolist()), layers))["skin"]


class Sitting:
    """Photos of the average head with brows and stubble, in even light or that of a lamp."""

    def __init__(self, basis: HeadBasis, lamp: SkinLight | None = None) -> None:
        self.lamp = lamp
        self.vertices = basis.character.vertices.astype(np.float64)
        rotation = np.diag([1.0, -1.0, -1.0])
        middle = np.array([0.0, 0.5, 5.0])
        camera = Camera(rotation, np.array([0.0, 0.0, 80.0]) - rotation @ middle, 2200.0, SIZE)
        self.camera = FaceCamera.of(camera, middle)
        character = basis.character
        triangles = basis.editor.template.triangles
        local = self.camera.local(self.vertices)
        depth = local[:, 2] + np.exp(self.camera.log_depth)
        faces, weights = visible_triangles(self.camera.pixels(local), depth, triangles, SIZE)
        seen = np.flatnonzero(faces >= 0)
        ids = character.triangle_uvs[faces[seen]]
        uv = np.einsum("nc,ncd->nd", weights[seen], character.uv[ids].astype(np.float64))
        skin = np.asarray(Image.open(io.BytesIO(encoded_skin("straight", 0.6))).convert("RGB"), dtype=np.float32)
        at = [(1.0 - uv[:, 1]) * len(skin) - 0.5, uv[:, 0] * len(skin) - 0.5]
        albedo = np.stack(
            [ndimage.map_coordinates(skin[..., k], at, order=1, mode="nearest") for k in range(3)], axis=1
        )
        image = np.full((SIZE[0] * SIZE[1], 3), 90.0)
        image[seen] = albedo
        self.albedo = image.reshape(SIZE[1], SIZE[0], 3) / 255.0
        if lamp is not None:
            normals = VertexNormals(character.triangles, len(self.vertices))(self.vertices) @ rotation.T
            corners, shares = triangles[faces[seen]], weights[seen]
            directions = np.einsum("nc,ncd->nd", shares, normals[corners].astype(np.float64))
            directions /= np.linalg.norm(directions, axis=1, keepdims=True)
            places = np.einsum("nc,ncd->nd", shares, local[corners]) + (0.0, 0.0, np.exp(self.camera.log_depth))
            image[seen] = 255.0 * lamp.lit(albedo / 255.0, directions, places).colours
        noise = np.random.default_rng(0).normal(0.0, 2.0, image.shape)
        self.pixels = np.clip(image + noise, 0.0, 255.0).astype(np.uint8).reshape(SIZE[1], SIZE[0], 3)

    def photo(self, draw: Draw | None = None) -> LitPhoto:
        """Return the photo, with something drawn over it."""
        picture = Image.fromarray(self.pixels)
        if draw is not None:
            draw(ImageDraw.Draw(picture), lambda points: [tuple(p) for p in self.camera.project(points)])
        light = np.zeros((9, 3))
        light[0] = 1.0
        return LitPhoto(np.asarray(picture, dtype=np.float32) / 255.0, self.camera, self.vertices, light, self.lamp)
