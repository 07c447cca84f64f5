"""Skins from photos: light, lips, brows and hair."""

import io
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image, ImageDraw

from faceposer.identity.photos.face_places import FacePlaces
from faceposer.identity.photos.face_texels import face_texels
from faceposer.identity.photos.hair_colour import colour_of_hair, hair_colour_of
from faceposer.identity.photos.head_basis import HeadBasis
from faceposer.identity.photos.photo_texture import SIDE, Zones, photo_texture, seen_skin
from faceposer.identity.photos.skin_light import SkinLight
from faceposer.identity.photos.unlit_colours import unlit_colours
from faceposer.identity.skin_layers import SkinLayers
from faceposer.identity.texture_model import load_texture_model
from tests.identity.photos.sitting import Sitting


@pytest.fixture(scope="module")
def zones() -> Zones:
    return Zones.of(load_texture_model(), "short")


def _texels(encoded: bytes) -> np.ndarray:
    picture = Image.open(io.BytesIO(encoded)).convert("RGB").resize((SIDE, SIDE), Image.Resampling.BOX)
    return np.asarray(picture, dtype=np.float64).reshape(-1, 3) / 255.0


def test_the_texture_shows_nothing_of_lamp_and_highlight(basis: HeadBasis, places: FacePlaces, under: bytes) -> None:
    around = np.zeros((9, 3))
    around[0] = (0.35, 0.3, 0.25)
    towards = np.array([-0.6, -0.3, -0.74])
    lamp = SkinLight(around, np.array([0.9, 0.8, 0.7]), towards / np.linalg.norm(towards), np.log(0.08), np.log(12.0))
    sitting = Sitting(basis, lamp)
    texels, photo = face_texels(basis, places), sitting.photo()
    colours, weights, _ = unlit_colours(photo, texels, basis)
    truth, _, _ = unlit_colours(replace(photo, image=sitting.albedo.astype(np.float32), lamp=None), texels, basis)
    lit, _, _ = unlit_colours(replace(photo, lamp=None), texels, basis)
    seen = (weights > 0.9) & (texels.brows < 0.1)
    assert np.abs(colours - truth)[seen].mean() < 0.02
    assert np.abs(lit - truth)[seen].mean() > 0.04
    found = _texels(photo_texture([photo], under, basis, places))[texels.at]
    assert np.abs(found - truth)[seen].mean() < 0.025
    # What is left of the difference between the sides.
    left = texels.of_vertices(photo.vertices)[:, 0] < 0.0
    sides = [
        abs(ratio[seen & left].mean() - ratio[seen & ~left].mean())
        for ratio in (np.log(found / truth), np.log(lit / truth))
    ]
    assert sides[0] < 0.15 * sides[1]


def test_teeth_are_no_lips(sitting: Sitting, under: bytes, basis: HeadBasis, places: FacePlaces, zones: Zones) -> None:
    texels = face_texels(basis, places)
    points = sitting.camera.pixels(sitting.camera.local(texels.of_vertices(sitting.vertices)))
    on_lips = (zones.lips.ravel()[texels.at] > 0.8) & (texels.region > 0.9)
    top = points[on_lips & (points[:, 1] < np.median(points[on_lips, 1]))]

    def smile(pen: ImageDraw.ImageDraw, _: object) -> None:
        for x, y in top:
            pen.ellipse([x - 1.5, y - 1.5, x + 1.5, y + 1.5], fill=(205, 200, 185))

    bare, smiling = (
        seen_skin([sitting.photo(draw)], under, basis, places, zones).trust.ravel()[texels.at] for draw in (None, smile)
    )
    upper = on_lips & (points[:, 1] < np.median(points[on_lips, 1])) & (bare > 0.8)
    assert upper.sum() > 500
    assert smiling[upper].mean() < 0.2


def test_brows_that_photos_do_not_show_are_lost(
    sitting: Sitting, under: bytes, basis: HeadBasis, places: FacePlaces, zones: Zones
) -> None:
    seen = seen_skin([sitting.photo()], under, basis, places, zones)
    assert not seen.brows_lost
    assert seen.brow_colour is not None
    # The hairs of the brows are those of the hair.
    assert np.abs(np.array(seen.brow_colour) - SkinLayers().hair_colour).max() < 0.15
    rest = seen.without_brows()
    assert rest.brows_lost
    covered, shown = (_texels(one.over(under)).reshape(SIDE, SIDE, 3) for one in (rest, seen))
    hairs = zones.brows > 0.6
    assert shown[hairs].mean() < 0.8 * covered[hairs].mean()


def test_hair_gets_its_colour_from_photos(sitting: Sitting, basis: HeadBasis) -> None:
    layer = load_texture_model().layer("hair.short", SIDE)
    coefficients = np.random.default_rng(3).standard_normal(load_texture_model().n_coefficients)
    skin = load_texture_model().instance(coefficients, SkinLayers(hair="none"), 256)[140:150, 120:136] / 255.0
    found = hair_colour_of([sitting.photo()], layer, skin.mean(axis=(0, 1)), basis)
    assert found == pytest.approx(SkinLayers().hair_colour, abs=0.06)


@pytest.mark.parametrize(
    ("colours", "hair"),
    [
        ([(0.5, 0.4, 0.25)], True),
        ([(0.06, 0.05, 0.05)], True),
        ([(0.7, 0.69, 0.67)], True),
        ([(0.2, 0.3, 0.6)], False),  # A blue hat.
        ([(0.7, 0.1, 0.1)], False),  # A red one.
        ([(0.05, 0.05, 0.05), (0.9, 0.9, 0.88)], False),  # A cap of two colours.
        ([(0.81, 0.6, 0.47)], False),  # A bald head.
    ],
)
def test_hats_and_bald_heads_are_no_hair(colours: list[tuple[float, float, float]], hair: bool) -> None:
    rng = np.random.default_rng(0)
    seen = np.repeat(np.array(colours), 60, axis=0) * np.exp(rng.normal(0.0, 0.05, (60 * len(colours), 1)))
    assert (colour_of_hair(seen, np.array([0.8, 0.6, 0.48])) is not None) is hair
    assert colour_of_hair(seen[:10], np.array([0.8, 0.6, 0.48])) is None
