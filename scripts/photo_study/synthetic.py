"""Synthetic photos of heads that are known: random people, skins, expressions, cameras, light and backgrounds.

They are drawn with Phong's light in linear colours, apart from the spherical harmonics that are fitted.
"""

import io
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from scipy import ndimage

from faceposer.geometry.camera import Camera
from faceposer.identity.editing import HeadEditor, textures_of
from faceposer.identity.identity import Identity, SkinTexture
from faceposer.identity.photos.face_camera import rotation_of
from faceposer.identity.skin_layers import random_layers
from faceposer.identity.texture_model import load_texture_model
from faceposer.landmarks.drawing import PaintedMesh, visible_triangles
from faceposer.landmarks.painting import painted_parts
from faceposer.model.character import Character
from faceposer.model.face_model import FaceModel
from scripts.photo_study.lights import Light, ManyLights, PhongLight

Array = NDArray[np.float64]

SIZE = 512


@dataclass(frozen=True, eq=False)
class Person:
    """A head that is known.

    Attributes:
        identity: Its identity.
        vertices: Its neutral vertices, shape (N, 3).
        shapes: Its shapes, (S, N, 3), or None for those of the average head.
        textures: Its textures.
    """

    identity: Identity
    vertices: Array
    shapes: Array
    textures: dict[str, bytes]


@dataclass(frozen=True, eq=False)
class Photo:
    """A photo whose truth is known.

    Attributes:
        pixels: The image, shape (h, w, 3).
        camera: Its camera.
        weights: Weights of the shapes, shape (S,).
        vertices: Vertices shown, shape (N, 3).
    """

    pixels: NDArray[np.uint8]
    camera: Camera
    weights: Array
    vertices: Array


def random_person(
    editor: HeadEditor, base: Character, seed: int, own_shapes: bool = True, textured: bool = True
) -> Person:
    """Return a random person, reproducible by ``seed``."""
    identity = editor.random(seed)
    model = load_texture_model()
    skin = model.sample(seed + 7919)[0]
    rng = np.random.default_rng(seed)
    layers = random_layers(seed, model.tone(skin), float(rng.choice([-1.0, 1.0])), float(rng.uniform(-0.5, 0.8)))
    head = editor.maker.head(editor.skin(identity))
    shapes = editor.maker.shapes(head) if own_shapes else base.shapes.astype(np.float64)
    textures = dict(base.textures)
    if textured:
        textures |= textures_of(SkinTexture(tuple(skin.tolist()), layers))
    return Person(identity, head.vertices, shapes, textures)


def random_weights(model: FaceModel, rng: np.random.Generator) -> Array:
    """Return weights, (S,), of a random expression from the examples of the prior."""
    draws = model.rig_density.draws
    weights = np.zeros(len(model.character.shape_names))
    weights[model.rig_density.shape_rows] = draws[rng.integers(len(draws))].clip(0.0, 1.0)
    return weights


def photo_of(
    person: Person,
    base: Character,
    weights: Array,
    rng: np.random.Generator,
    yaw: float = 0.0,
    size: int = SIZE,
    finer: int = 2,
    many: np.random.Generator | None = None,
) -> Photo:
    """Return a photo of ``person`` with the expression ``weights``, the face turned by about ``yaw`` radians.

    With the source of random numbers ``many``, several lamps light it, and the sky.
    """
    vertices = person.vertices + np.tensordot(weights, person.shapes, 1)
    mesh = painted_parts(vertices, base.polygons, base.uv, base.polygon_uvs, base.parts, person.textures)
    pixels, camera = picture_of(mesh, rng, yaw, size, finer, many)
    return Photo(pixels, camera, weights, vertices)


def picture_of(
    mesh: PaintedMesh,
    rng: np.random.Generator,
    yaw: float = 0.0,
    size: int = SIZE,
    finer: int = 2,
    many: np.random.Generator | None = None,
) -> tuple[NDArray[np.uint8], Camera]:
    """Return a photo of ``mesh``, upright and in centimetres, with a random camera, light and background."""
    turn = rotation_of(np.array([rng.normal(0.0, 0.12), 0.0, 0.0])) @ rotation_of(
        np.array([0.0, yaw + rng.normal(0.0, 0.12), 0.0])
    )
    rotation = rotation_of(np.array([0.0, 0.0, rng.normal(0.0, 0.08)])) @ np.diag([1.0, -1.0, -1.0]) @ turn
    focal = size * 2.0 * math.exp(rng.normal(0.0, 0.2))
    width = 27.0 * math.exp(rng.normal(0.0, 0.1))
    middle = np.array([0.0, 1.0, 3.0])
    place = np.array([*rng.normal(0.0, 0.8, 2), focal * width / size])
    camera = Camera(rotation, place - rotation @ middle, focal, (size, size))
    across = rotation_of(np.array([0.0, 0.0, rng.uniform(0.0, 2.0 * np.pi)])) @ np.array([0.0, 1.0, 0.0])
    tilt = rng.uniform(0.2, 1.1)
    lamp = math.sin(tilt) * across + math.cos(tilt) * np.array([0.0, 0.0, -1.0])
    ambient = rng.uniform(0.2, 0.6) * np.exp(rng.normal(0.0, 0.08, 3))
    diffuse = rng.uniform(0.5, 1.1) * np.exp(rng.normal(0.0, 0.08, 3))
    light = PhongLight(lamp, ambient, diffuse, rng.uniform(0.0, 0.15))
    image = shaded(
        mesh, camera, light if many is None else ManyLights.about(light, many), soft_background(rng, size), finer
    )
    image = np.clip(image + rng.normal(0.0, 0.008, image.shape), 0.0, 1.0)
    return _as_jpeg(image, int(rng.integers(75, 96))), camera


def shaded(mesh: PaintedMesh, camera: Camera, light: Light, background: Array, finer: int) -> Array:
    """Return the picture, 0..1, of a mesh in a light."""
    width, height = (side * finer for side in camera.size)
    pixels, local = camera.project(mesh.vertices) * finer, camera.to_camera(mesh.vertices)
    faces, weights = visible_triangles(pixels, local[:, 2], mesh.triangles, (width, height))
    covered = np.flatnonzero(faces >= 0)
    corners, shares = mesh.triangles[faces[covered]], weights[covered]
    normals = np.einsum("pc,pcd->pd", shares, mesh.normals[corners].astype(np.float64)) @ camera.rotation.T
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    towards = -np.einsum("pc,pcd->pd", shares, local[corners])
    towards /= np.linalg.norm(towards, axis=1, keepdims=True)
    image = ndimage.zoom(background, (finer, finer, 1), order=0).reshape(-1, 3)
    image[covered] = light.colours(_albedo(mesh, faces[covered], corners, shares), normals, towards)
    result: Array = image.reshape(height // finer, finer, width // finer, finer, 3).mean(axis=(1, 3))
    return result


def _albedo(mesh: PaintedMesh, faces: NDArray[np.int64], corners: NDArray[np.integer], shares: Array) -> Array:
    """Return colours, 0..1, at points of triangles ``faces``, (p,), with ``corners`` and weights, (p, 3)."""
    if mesh.colours.ndim == 1:
        colours = np.tile(mesh.colours / 255.0, (len(faces), 1))
    else:
        colours = np.einsum("pc,pcd->pd", shares, mesh.colours[corners]) / 255.0
    uv, image_of = np.einsum("pc,pcd->pd", shares, mesh.uv[faces]), mesh.image_of[faces]
    for number, texture in enumerate(mesh.textures):
        chosen = np.flatnonzero(image_of == number)
        height, width = texture.shape[:2]
        at = np.stack([(1.0 - uv[chosen, 1]) * height - 0.5, uv[chosen, 0] * width - 0.5])
        for k in range(3):
            colours[chosen, k] = (
                ndimage.map_coordinates(texture[..., k].astype(np.float32), at, order=1, mode="nearest") / 255.0
            )
    return np.clip(colours, 0.0, 1.0)


def soft_background(rng: np.random.Generator, size: int) -> Array:
    """Return random soft colours, 0..1, shape (size, size, 3)."""
    coarse = rng.uniform(0.1, 0.9, 3) + rng.normal(0.0, rng.uniform(0.02, 0.2), (6, 6, 3))
    return np.clip(ndimage.zoom(coarse, (size / 6, size / 6, 1), order=1, grid_mode=True, mode="nearest"), 0.0, 1.0)


def _as_jpeg(image: Array, quality: int) -> NDArray[np.uint8]:
    data = io.BytesIO()
    Image.fromarray(np.rint(image * 255.0).astype(np.uint8)).save(data, "JPEG", quality=quality)
    return np.asarray(Image.open(data).convert("RGB"))
