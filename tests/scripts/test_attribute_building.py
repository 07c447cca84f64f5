"""Parts of the building of attributes and textures that need no source data; the rest is checked by ``--check``."""

import io

import numpy as np
import pytest
from PIL import Image
from scipy.spatial.transform import Rotation

from faceposer.identity.attributes import without_motion
from scripts.identity_building.attributes import person_functionals
from scripts.identity_building.layers import encoded
from scripts.identity_building.measures import MEASURES, PERSON, PLACES
from scripts.identity_building.skins import filled


def test_labels_are_recovered_from_heads_and_do_not_depend_on_size() -> None:
    rng = np.random.default_rng(1)
    n, c = len(PERSON), 60
    place = 10.0 * rng.standard_normal((c, 3))
    modes = 12.0 * rng.standard_normal((40, 3 * c))
    directions = rng.standard_normal((n, 40)) @ modes
    # The ethnicities, the last three, are contrasts and add up to zero.
    directions[-3:] -= directions[-3:].mean(axis=0)
    functionals = person_functionals(place, directions, modes)
    labels = rng.standard_normal(n)
    labels[-3:] -= labels[-3:].mean()
    head = labels @ directions
    # Regularised by what modes do not explain, which is small here.
    assert functionals @ head == pytest.approx(labels, abs=0.02)
    larger = 0.3 * (place - place.mean(axis=0)).ravel()
    assert functionals @ (head + larger) == pytest.approx(functionals @ head, abs=1e-9)


def test_functionals_without_motion_ignore_small_motions() -> None:
    rng = np.random.default_rng(2)
    points, weights = rng.standard_normal((50, 3)), rng.random(50)
    rows = without_motion(rng.standard_normal((3, 150)), points, weights)
    moved = Rotation.from_rotvec([1e-4, -2e-4, 1.5e-4]).apply(points) + [0.3, -0.2, 0.1]
    assert np.abs(rows @ (moved - points).ravel()).max() < 1e-5
    assert np.abs(rows @ rng.standard_normal(150)).max() > 0.1


def test_skins_are_filled_smoothly_and_kept_where_they_are_known() -> None:
    rows, columns = np.mgrid[0:128, 0:128].astype(np.float32)
    image = np.stack([rows, columns, np.full_like(rows, 7.0)], axis=-1) / 128.0
    known = ((rows - 64) ** 2 + (columns - 64) ** 2 > 30**2).astype(np.float32)
    spoiled = np.where(known[..., None] > 0, image, np.float32(99.0))
    result = filled(spoiled, known)
    assert np.array_equal(result[known > 0], image[known > 0])
    hole = result[known == 0]
    assert hole.max() <= 1.0
    assert hole.min() >= 0.0
    assert hole[:, 2] == pytest.approx(7.0 / 128.0, abs=1e-4)
    # A slope is continued across the hole.
    assert np.corrcoef(hole[:, 0], rows[known == 0])[0, 1] > 0.9
    assert np.abs(np.diff(result[64, :, 1])).max() < 0.1


def test_planes_are_stored_as_pictures() -> None:
    plane = np.tile(np.linspace(0.0, 1.0, 64, dtype=np.float32), (128, 1))
    picture = Image.open(io.BytesIO(encoded(plane, 32, 90).tobytes()))
    assert picture.size == (32, 64)
    assert np.asarray(picture, dtype=float)[20, ::8] == pytest.approx([1, 66, 131, 196], abs=8)


def test_measures_are_of_places_and_of_whole_measures() -> None:
    found_on_the_mesh = {"eye outer", "eye inner", "upper lid", "lower lid", "upper contact", "lower contact"}
    for name, measure in MEASURES.items():
        assert {place for place, _, _ in measure.terms} <= PLACES.keys() | found_on_the_mesh, name
        if measure.relative_to:
            assert not MEASURES[measure.relative_to].relative_to
        # Sums of heights and depths vanish, so that lengths do not depend on where the head is.
        for axis in (1, 2):
            assert sum(factor for _, along, factor in measure.terms if along == axis) == pytest.approx(0.0)
