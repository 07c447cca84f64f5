"""Colours of eyes in photos."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from PIL import Image, ImageDraw

from faceposer.identity.eye_colour import EYE_COLOURS, eye_whites
from faceposer.identity.photos.iris_colour import eye_colour_of, most_probable, whites_of
from faceposer.identity.photos.skin_light import SkinLight
from faceposer.identity.photos.skin_samples import LIDS

_FINE = 4


def _crop(colour: tuple[float, float, float], radius: float, light: tuple[float, ...] = (1.0, 1.0, 1.0)) -> Any:
    """Return a photo of two eyes with irises of ``radius`` pixels: pupil, rim, mirrored lamp, shade of the lid."""
    width, height = round(14 * radius), round(4 * radius)
    shape = (height * _FINE, width * _FINE)
    rows, columns = (np.mgrid[: shape[0], : shape[1]] + 0.5) / _FINE
    image = np.full((*shape, 3), (0.8, 0.62, 0.5))
    points, irises = np.zeros((478, 3)), []
    for side, lids in ((-1.0, LIDS[:16]), (1.0, LIDS[16:])):
        centre = np.array([(7.0 + side * 3.5) * radius, 2.0 * radius])
        turn = np.linspace(0.0, 2.0 * np.pi, 16, endpoint=False)
        points[list(lids), :2] = centre + radius * np.stack([2.4 * np.cos(turn), 0.85 * np.sin(turn)], axis=1)
        opening = Image.new("1", shape[::-1])
        ImageDraw.Draw(opening).polygon([tuple(p) for p in (_FINE * points[list(lids), :2]).tolist()], fill=1)
        inside = np.asarray(opening)
        distance = np.hypot(columns - centre[0], rows - centre[1]) / radius
        image[inside] = 0.9 * np.array(eye_whites())
        rim = np.clip((1.0 - distance) / 0.15, 0.35, 1.0)[..., None]
        iris = np.array(colour) * rim
        eye = np.where((distance < 0.33)[..., None], 0.02, iris)
        image = np.where((inside & (distance < 1.0))[..., None], eye, image)
        mirrored = np.hypot(columns - centre[0] + 0.25 * radius, rows - centre[1] + 0.25 * radius) < 0.18 * radius
        image[mirrored] = 0.95
        shade = np.clip(1.0 - 0.6 * (centre[1] - 0.2 * radius - rows) / radius, 0.5, 1.0)
        image = np.where(inside[..., None], image * shade[..., None], image)
        edge = [(0.0, 0.0), (radius, 0.0), (-radius, 0.0), (0.0, radius), (0.0, -radius)]
        irises.append([(*(centre + offset), 0.0) for offset in edge])
    small = image.reshape(height, _FINE, width, _FINE, 3).mean(axis=(1, 3)) * np.array(light) ** (1.0 / 2.2)
    noisy = np.clip(small + np.random.default_rng(0).normal(0.0, 0.01, small.shape), 0.0, 1.0)
    landmarks = SimpleNamespace(points=points, iris=np.array(irises))
    return SimpleNamespace(image=noisy, face=SimpleNamespace(landmarks=landmarks), factor=1.0)


def _light(colour: tuple[float, ...]) -> SkinLight:
    around = np.zeros((9, 3))
    around[0] = colour
    return SkinLight(around, np.zeros(3), np.array([0.0, 0.0, -1.0]), -20.0, 1.0)


# Of few pixels, grey irises cannot be told from blue ones, which are commoner.
@pytest.mark.parametrize(
    ("name", "radius"),
    [(name, radius) for radius in (4.0, 12.0) for name in EYE_COLOURS if (name, radius) != ("grey", 4)],
)
def test_irises_of_few_pixels_have_their_colour(name: str, radius: float) -> None:
    warm = (1.1, 0.9, 0.7)
    for light in ((1.0, 1.0, 1.0), warm):
        crop = _crop(EYE_COLOURS[name], radius, light)
        assert eye_colour_of([crop], [_light(light)]) == EYE_COLOURS[name]


def test_what_is_common_decides_where_little_is_seen() -> None:
    between = np.array([0.36, 0.25, 0.11])
    assert most_probable(between, 0.5) == EYE_COLOURS["brown"]
    assert most_probable(np.array(EYE_COLOURS["hazel"]), 3.0) == EYE_COLOURS["hazel"]
    assert most_probable(np.array(EYE_COLOURS["hazel"]), 0.0) == EYE_COLOURS["dark brown"]
    assert eye_colour_of([_crop(EYE_COLOURS["blue"], 2.0)]) is None


def test_whites_have_the_tone_of_the_photo() -> None:
    crop = _crop(EYE_COLOURS["brown"], 12.0)
    assert whites_of([crop]) == pytest.approx((0.9, 0.9, 0.9), abs=0.05)
    crop.image = crop.image * 0.5
    assert np.mean(whites_of([crop])) == pytest.approx(0.72)
    assert whites_of([]) == (0.88, 0.88, 0.88)
