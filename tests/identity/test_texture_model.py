"""Textures of skins: learned ones are reproduced, layers act where they should, and skins are recognised."""

import dataclasses
import io
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from faceposer.errors import FacePoserError
from faceposer.identity.companion_file import read_companion, save_companion
from faceposer.identity.skin_layers import SkinLayers, random_layers
from faceposer.identity.skin_reading import layers_of
from faceposer.identity.skin_tones import line_tone, scale_tone
from faceposer.identity.texture_model import FORMAT, LIMIT, NOUN, SIZE, TextureModel, load_texture_model
from faceposer.resources import asset_path

BARE = SkinLayers(hair="none", brows="none", lash_line=0.0)


@pytest.fixture(scope="module")
def model() -> TextureModel:
    return load_texture_model()


@pytest.fixture(scope="module")
def mean(model: TextureModel) -> np.ndarray:
    return model.instance(np.zeros(model.n_coefficients))


def _at(texture: np.ndarray, u: float, v: float) -> np.ndarray:
    row, column = int(v * len(texture)), int(u * len(texture))
    return texture[row - 8 : row + 8, column - 8 : column + 8].reshape(-1, 3).mean(axis=0)


FOREHEAD, SCALP, LIPS, CHIN, CHEEK = (0.5, 0.26), (0.5, 0.06), (0.5, 0.585), (0.5, 0.70), (0.36, 0.5)


def test_a_texture_has_skin_hair_and_lips(model: TextureModel, mean: np.ndarray) -> None:
    assert mean.shape == (SIZE, SIZE, 3)
    assert mean.dtype == np.uint8
    small = Image.open(io.BytesIO(model.encoded(np.zeros(model.n_coefficients), size=256)))
    reduced = np.asarray(Image.fromarray(mean).resize((256, 256), Image.Resampling.LANCZOS), dtype=float)
    assert np.abs(np.asarray(small, dtype=float) - reduced).mean() < 3.0
    forehead, scalp, lips = (_at(mean, *place) for place in (FOREHEAD, SCALP, LIPS))
    assert forehead[0] > forehead[1] > forehead[2]
    assert scalp.mean() < 0.7 * forehead.mean()
    assert lips[0] / lips[1] > 1.1 * forehead[0] / forehead[1]


def test_tone_darkens_the_skin(model: TextureModel) -> None:
    c = model.sample(3)[0]
    light, dark = (model.instance(model.with_tone(c, tone), BARE) for tone in (-1.0, 1.5))
    assert _at(dark, *FOREHEAD).mean() < 0.6 * _at(light, *FOREHEAD).mean()
    assert model.tone(model.with_tone(c, 0.7)) == 0.7


@pytest.mark.parametrize("seed", [0, 8])
def test_every_tone_is_human_skin(model: TextureModel, seed: int) -> None:
    c = np.zeros(model.n_coefficients) if seed == 0 else model.sample(seed)[0]
    below = np.full(3, np.inf)
    for tone in (-LIMIT, -1.0, 0.0, 1.0, LIMIT):
        texture = model.instance(model.with_tone(c, tone), BARE, size=512)
        for place in (FOREHEAD, CHEEK, CHIN):
            red, green, blue = _at(texture, *place)
            assert 60.0 < red < 246.0
            assert red > 1.1 * green > 1.1 * blue
        forehead = _at(texture, *FOREHEAD)
        assert (forehead < below).all()
        below = forehead


def test_tones_are_found_from_the_line(model: TextureModel) -> None:
    for tone in (-2.2, -0.9, 0.0, 1.6, 2.4):
        assert scale_tone(line_tone(tone)) == pytest.approx(tone)
        slope = (line_tone(tone + 1e-6) - line_tone(tone - 1e-6)) / 2e-6
        assert 0.0 < slope < 1.0 + 1e-6
    assert np.isfinite([scale_tone(-50.0), scale_tone(50.0)]).all()
    found = model.of_line(np.full(model.n_coefficients, -0.8))
    assert line_tone(found[0]) == pytest.approx(-0.8)
    assert (found[1:] == -0.8).all()


def test_brows_stay_visible_on_dark_skin(model: TextureModel) -> None:
    c = model.with_tone(np.zeros(model.n_coefficients), LIMIT)
    brown = SkinLayers(hair_colour=(0.45, 0.3, 0.2), brow_strength=1.0)
    bare, painted = (model.instance(c, style, size=512).astype(float).sum(axis=2) for style in (BARE, brown))
    face = (slice(130, 220), slice(140, 372))
    assert np.quantile(painted[face] / bare[face], 0.005) < 0.75


def test_layers_act_where_they_are(model: TextureModel, mean: np.ndarray) -> None:
    zero = np.zeros(model.n_coefficients)
    blond = model.instance(zero, SkinLayers(hair_colour=(0.8, 0.65, 0.4), beard=1.0, lip_redness=1.0))
    assert _at(blond, *SCALP).mean() > 1.3 * _at(mean, *SCALP).mean()
    assert _at(blond, *CHIN).mean() < 0.95 * _at(mean, *CHIN).mean()
    assert _at(blond, *LIPS)[1] < 0.8 * _at(mean, *LIPS)[1]
    assert np.array_equal(_at(blond, *CHEEK), _at(mean, *CHEEK))


def test_skins_are_recognised_under_other_layers(model: TextureModel) -> None:
    known = next(c for name, c in model.skins.items() if name.startswith("young_lightskinned_female"))
    texture = model.instance(known, SkinLayers(hair="combed", brows="arched", hair_colour=(0.5, 0.4, 0.2)), size=512)
    found = model.project(texture)
    assert np.abs(found[:3] - known[:3]).max() < 0.35
    half = np.zeros((512, 512))
    half[:, :256] = 1.0
    assert np.abs(model.project(texture, half)[:2] - known[:2]).max() < 0.5


@pytest.mark.parametrize(
    "layers",
    [
        SkinLayers("combed", (0.55, 0.4, 0.22), "arched", (0.3, 0.2, 0.1), 0.7, 0.0, 0.8, 0.6),
        SkinLayers("short", (0.08, 0.07, 0.06), "heavy", (0.1, 0.08, 0.07), 1.0, 0.75, 0.0, 0.3),
        BARE,
    ],
)
def test_layers_are_read_from_an_image(model: TextureModel, layers: SkinLayers) -> None:
    c = np.zeros(model.n_coefficients)
    found = layers_of(model, c, model.instance(c, layers), SkinLayers())
    assert (found.hair, found.brows) == (layers.hair, layers.brows)
    assert found.beard == pytest.approx(layers.beard, abs=0.16)
    assert found.lip_redness == pytest.approx(layers.lip_redness, abs=0.05)
    assert found.lash_line == pytest.approx(layers.lash_line, abs=0.1)
    if layers is not BARE:
        np.testing.assert_allclose(found.hair_colour, layers.hair_colour, atol=0.04)
        np.testing.assert_allclose(found.brow_colour, layers.brow_colour, atol=0.06)
        assert found.brow_strength == pytest.approx(layers.brow_strength, abs=0.16)


def test_labels_are_those_of_the_skins(model: TextureModel) -> None:
    women = [model.label(c, "gender") for name, c in model.skins.items() if "female" in name]
    men = [model.label(c, "gender") for name, c in model.skins.items() if "female" not in name]
    assert min(women) > max(men)
    ages = {name: model.label(c, "age") for name, c in model.skins.items()}
    assert ages["old_darkskinned_male_diffuse"] == max(ages.values())
    assert max(ages.values()) - np.mean([age for name, age in ages.items() if "young" in name]) == pytest.approx(1.0)
    c = model.sample(5)[0]
    older = model.with_label(c, "age", 0.8)
    assert model.label(older, "age") == pytest.approx(0.8)
    assert model.tone(older) == pytest.approx(model.tone(c))
    assert model.label(older, "gender") == pytest.approx(model.label(c, "gender"))


def test_age_folds_the_skin_and_keeps_its_colour(model: TextureModel) -> None:
    c = model.with_tone(np.zeros(model.n_coefficients), -0.5)
    young, old = (model.instance(model.with_label(c, "age", age), BARE, size=512).astype(float) for age in (-0.5, 1.0))
    face = (slice(112, 440), slice(128, 384))
    brightness = [np.log(image[face].mean(axis=2)) for image in (young, old)]
    fold = brightness[1] - brightness[0]
    assert np.quantile(fold, 0.01) < -0.12
    assert np.abs(np.median(fold)) < 0.05
    ratio = [np.median(image[face][..., 0] / image[face][..., 2]) for image in (young, old)]
    assert ratio[1] < 1.25 * ratio[0]


def test_random_layers_suit_the_person() -> None:
    dark = [random_layers(seed, tone=1.6) for seed in range(20)]
    assert max(np.mean(layers.hair_colour) for layers in dark) < 0.15
    old = [random_layers(seed, tone=-0.5, age=1.0) for seed in range(20)]
    assert min(np.mean(layers.hair_colour) for layers in old) > 0.4
    assert all(random_layers(seed, 0.0, gender=1.2).beard == 0.0 for seed in range(20))
    assert random_layers(4, 0.0) == random_layers(4, 0.0)


def test_bad_input_is_named(model: TextureModel, tmp_path: Path) -> None:
    with pytest.raises(FacePoserError, match="no style 'mohawk' of hair"):
        SkinLayers(hair="mohawk")
    with pytest.raises(FacePoserError, match="finite numbers"):
        dataclasses.replace(BARE, beard=np.nan)
    with pytest.raises(FacePoserError, match="another version of the model"):
        model.instance([0.0])
    with pytest.raises(FacePoserError, match="three channels"):
        model.project(np.zeros((8, 8)))
    with pytest.raises(FacePoserError, match="too little bare skin"):
        model.project(np.full((64, 64, 3), 128), np.zeros((64, 64)))
    meta, arrays = read_companion(asset_path("identity-textures.npz"), FORMAT, NOUN)
    damaged = tmp_path / "textures.npz"
    for changed in ({"masks": arrays["masks"][:0]}, {"skin.0.luma": arrays["skin.0.luma"][:100]}):
        save_companion(damaged, FORMAT, NOUN, meta, {**arrays, **changed})
        with pytest.raises(FacePoserError, match="do not belong together"):
            load_texture_model(damaged)
