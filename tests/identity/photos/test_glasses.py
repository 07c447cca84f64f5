"""The skin of photos with glasses."""

import io
from collections.abc import Callable

import numpy as np
import pytest
from PIL import Image, ImageDraw
from scipy import ndimage

from faceposer.geometry.camera import Camera
from faceposer.identity.editing import textures_of
from faceposer.identity.identity import SkinTexture
from faceposer.identity.photos.face_camera import FaceCamera
from faceposer.identity.photos.face_places import FacePlaces
from faceposer.identity.photos.head_basis import HeadBasis
from faceposer.identity.photos.photo_texture import LitPhoto, _seen, face_texels, photo_texture
from faceposer.identity.skin_layers import SkinLayers
from faceposer.identity.texture_model import load_texture_model
from faceposer.landmarks.drawing import visible_triangles

_SIZE = (560, 620)
Draw = Callable[[ImageDraw.ImageDraw, Callable[[np.ndarray], list[tuple[float, float]]]], None]


def _encoded(brows: str, beard: float = 0.0) -> bytes:
    coefficients = np.random.default_rng(3).standard_normal(load_texture_model().n_coefficients)
    layers = SkinLayers(hair="short", brows=brows, beard=beard)
    return textures_of(SkinTexture(tuple(coefficients.tolist()), layers))["skin"]


@pytest.fixture(scope="module")
def under() -> bytes:
    """The texture that the model would give, without brows."""
    return _encoded("none")


class _Sitting:
    """Photos of the average head with brows and stubble, in even light."""

    def __init__(self, basis: HeadBasis) -> None:
        self.vertices = basis.character.vertices.astype(np.float64)
        rotation = np.diag([1.0, -1.0, -1.0])
        middle = np.array([0.0, 0.5, 5.0])
        camera = Camera(rotation, np.array([0.0, 0.0, 80.0]) - rotation @ middle, 2200.0, _SIZE)
        self.camera = FaceCamera.of(camera, middle)
        character = basis.character
        triangles = basis.editor.template.triangles
        local = self.camera.local(self.vertices)
        depth = local[:, 2] + np.exp(self.camera.log_depth)
        faces, weights = visible_triangles(self.camera.pixels(local), depth, triangles, _SIZE)
        seen = np.flatnonzero(faces >= 0)
        ids = character.triangle_uvs[faces[seen]]
        uv = np.einsum("nc,ncd->nd", weights[seen], character.uv[ids].astype(np.float64))
        skin = np.asarray(Image.open(io.BytesIO(_encoded("straight", 0.6))).convert("RGB"), dtype=np.float32)
        at = [(1.0 - uv[:, 1]) * len(skin) - 0.5, uv[:, 0] * len(skin) - 0.5]
        image = np.full((_SIZE[0] * _SIZE[1], 3), 90.0, dtype=np.float32)
        for k in range(3):
            image[seen, k] = ndimage.map_coordinates(skin[..., k], at, order=1, mode="nearest")
        noise = np.random.default_rng(0).normal(0.0, 2.0, image.shape)
        self.pixels = np.clip(image + noise, 0.0, 255.0).astype(np.uint8).reshape(_SIZE[1], _SIZE[0], 3)

    def photo(self, draw: Draw | None = None) -> LitPhoto:
        picture = Image.fromarray(self.pixels)
        if draw is not None:
            draw(ImageDraw.Draw(picture), lambda points: [tuple(p) for p in self.camera.project(points)])
        light = np.zeros((9, 3))
        light[0] = 1.0
        return LitPhoto(np.asarray(picture, dtype=np.float32) / 255.0, self.camera, self.vertices, light)


@pytest.fixture(scope="module")
def sitting(basis: HeadBasis) -> _Sitting:
    return _Sitting(basis)


def _glasses(colour: tuple[int, int, int], width: int) -> Draw:
    def draw(pen: ImageDraw.ImageDraw, project: Callable[[np.ndarray], list[tuple[float, float]]]) -> None:
        turn = np.linspace(0.0, 2.0 * np.pi, 60)
        for side in (-1.0, 1.0):
            ring = [side * (3.1 + 2.3 * np.cos(turn)), 1.6 + 2.1 * np.sin(turn), np.full(60, 8.8)]
            pen.line(project(np.stack(ring, axis=1)), fill=colour, width=width, joint="curve")
            pen.line(project(np.array([[side * 5.4, 2.2, 8.8], [side * 7.0, 2.4, 7.0]])), fill=colour, width=width)
        pen.line(project(np.array([[-0.8, 2.0, 9.0], [0.0, 2.3, 9.4], [0.8, 2.0, 9.0]])), fill=colour, width=width)

    return draw


def _moles(pen: ImageDraw.ImageDraw, project: Callable[[np.ndarray], list[tuple[float, float]]]) -> None:
    for x, y in project(np.array([[3.0, -0.6, 8.8], [-2.5, -0.9, 9.0], [-4.5, -1.5, 8.0], [0.5, 4.5, 9.4]])):
        pen.ellipse([x - 5.0, y - 5.0, x + 5.0, y + 5.0], fill=(70, 45, 40))


def _decoded(encoded: bytes) -> np.ndarray:
    picture = Image.open(io.BytesIO(encoded)).convert("RGB").resize((1024, 1024))
    return np.asarray(picture, dtype=np.float64).reshape(-1, 3)


def _kept(photo: LitPhoto, under: bytes, basis: HeadBasis, places: FacePlaces) -> tuple[np.ndarray | None, np.ndarray]:
    """Return the factors of glasses, and the colours of the texels."""
    texels = face_texels(basis, places)
    colours, weights = _seen(photo, texels, basis)
    logs = np.log(np.maximum(colours, 0.02)) - np.log(np.maximum(_decoded(under)[texels.at] / 255.0, 0.02))
    return texels.front.kept(logs - np.median(logs[weights > 0.5], axis=0), weights), colours


def test_frames_are_replaced_by_skin(sitting: _Sitting, under: bytes, basis: HeadBasis, places: FacePlaces) -> None:
    worn, bare = sitting.photo(_glasses((35, 25, 25), 9)), sitting.photo()
    texels = face_texels(basis, places)
    colours, weights = _seen(bare, texels, basis)
    truth = 255.0 * colours
    difference = np.abs(255.0 * _seen(worn, texels, basis)[0] - truth).max(axis=1)
    frame, free = (difference > 25.0) & (weights > 0.9), (difference < 2.0) & (weights > 0.9)
    assert frame.sum() > 5000
    errors = np.abs(_decoded(photo_texture([worn], under, basis, places))[texels.at] - truth).max(axis=1)
    skin, brows = frame & (texels.brows < 0.1), texels.brows > 0.9
    assert difference[skin].mean() > 35.0
    assert errors[skin].mean() < 4.0
    # What the frames do not cover is as without them, most of the brows too.
    assert errors[free].mean() < 3.0
    assert np.median(errors[brows]) < 8.0


def test_thin_frames_of_about_the_colour_of_the_skin_are_found(
    sitting: _Sitting, under: bytes, basis: HeadBasis, places: FacePlaces
) -> None:
    kept, colours = _kept(sitting.photo(_glasses((120, 75, 35), 6)), under, basis, places)
    _, bare = _kept(sitting.photo(), under, basis, places)
    assert kept is not None
    texels = face_texels(basis, places)
    frame = (np.abs(colours - bare).max(axis=1) > 0.1) & (texels.brows < 0.1) & (texels.region > 0.9)
    assert frame.sum() > 2000
    assert kept[frame].mean() < 0.1


@pytest.mark.parametrize("draw", [None, _moles])
def test_brows_stubble_and_moles_are_no_glasses(
    sitting: _Sitting, under: bytes, basis: HeadBasis, places: FacePlaces, draw: Draw | None
) -> None:
    assert _kept(sitting.photo(draw), under, basis, places)[0] is None
