"""Heads from paintings: the painter's colours stay, and little is taken for light."""

import io

import numpy as np
import pytest
from PIL import Image

from faceposer.identity.photos.dense_fit import DenseSettings
from faceposer.identity.photos.head_from_photos import HeadFromPhotos, head_from_photos
from faceposer.identity.photos.landmark_fit import PhotoFace
from faceposer.landmarks.points import find_landmarks
from tests.landmarks.photos import astronaut

# A face as green as no light makes it.
_PAINT = np.array([0.5, 1.0, 0.45])


@pytest.fixture(scope="module")
def picture() -> np.ndarray:
    return np.clip(astronaut() * _PAINT, 0.0, 255.0).astype(np.uint8)


@pytest.fixture(scope="module")
def head(picture: np.ndarray) -> HeadFromPhotos:
    found = find_landmarks(picture)
    assert found is not None
    height, width = picture.shape[:2]
    quick = DenseSettings(n_samples=600, levels=((4.0, 3), (2.0, 2)))
    face = PhotoFace(found, (width, height), 2.0 * width, 0.3)
    return head_from_photos([face], [picture], ["a.png"], name="a", title="A", painting=True, settings=quick)


def _skin_at(head: HeadFromPhotos, feature: str) -> np.ndarray:
    """Return the mean colour of the skin about a feature point."""
    character = head.character
    vertex = character.feature_points[feature]
    triangle = int(np.flatnonzero((character.triangles == vertex).any(axis=1))[0])
    u, v = character.uv[character.triangle_uvs[triangle]].mean(axis=0)
    skin = np.asarray(Image.open(io.BytesIO(character.textures["skin"])).convert("RGB"), dtype=float)
    row, column = round((1.0 - v) * len(skin)), round(u * skin.shape[1])
    return skin[row - 6 : row + 7, column - 6 : column + 7].reshape(-1, 3).mean(axis=0)


def test_the_skin_keeps_the_colours_of_the_painter(head: HeadFromPhotos, picture: np.ndarray) -> None:
    vertex = head.character.feature_points["9.3"]
    surface = head.model.surface(head.poses[0])
    x, y = head.cameras[0].project(surface[[vertex]])[0].astype(int)
    painted = picture[y - 3 : y + 4, x - 3 : x + 4].reshape(-1, 3).mean(axis=0)
    skin = _skin_at(head, "9.3")
    assert skin[1] > 1.4 * skin[0]
    assert skin[1] > 1.4 * skin[2]
    np.testing.assert_allclose(skin / skin.sum(), painted / painted.sum(), atol=0.03)


def test_the_light_is_grey_and_weak_and_colours_still_refine_the_head(head: HeadFromPhotos) -> None:
    light = head.lights[0]
    np.testing.assert_allclose(light, light[:, :1].repeat(3, axis=1))
    assert np.abs(light[1:4, 0]).max() < 0.6
    assert not light[4:].any()
    assert head.report["refined"] is True
    # All segments have the coefficients of the whole head.
    np.testing.assert_allclose(head.identity.shape, head.identity.shape[:1].repeat(len(head.identity.shape), axis=0))
