"""Eyes in any colour."""

import io

import numpy as np
import pytest
from PIL import Image

from faceposer.errors import FacePoserError
from faceposer.identity.eye_colour import EYE_COLOURS, eye_texture, random_eye_colour
from faceposer.model.character_file import load_character


def test_the_iris_gets_the_colour_and_all_else_stays() -> None:
    before = np.asarray(Image.open(io.BytesIO(load_character("man").textures["eye"])), dtype=float)
    after = np.asarray(Image.open(io.BytesIO(eye_texture((0.4, 0.2, 0.1)))), dtype=float)
    size = len(before)
    rows, columns = np.mgrid[:size, :size]
    radius = np.hypot(rows + 0.5 - size / 2, columns + 0.5 - size / 2) / size
    iris = (radius > 0.065) & (radius < 0.09)
    assert after[iris].mean(axis=0) / 255.0 == pytest.approx([0.4, 0.2, 0.1], rel=0.12)
    assert np.abs(after - before)[radius > 0.14].mean() < 2.0
    assert after[radius < 0.02].max() < 30.0
    # Fibres remain.
    assert after[iris][:, 0].std() > 0.5 * before[iris][:, 0].std()


def test_colours_suit_the_skin() -> None:
    dark = {random_eye_colour(seed, 1.5) for seed in range(30)}
    assert dark == {EYE_COLOURS["dark brown"]}
    light = {random_eye_colour(seed, -0.8) for seed in range(60)}
    assert len(light) >= 4


def test_bad_colours_are_named() -> None:
    with pytest.raises(FacePoserError, match="three finite numbers"):
        eye_texture((np.nan, 0.0, 0.0))
