"""Checks of the creature as it is built; they need the source wheel, which is not part of the project."""

import os
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from faceposer.geometry.camera import OrbitView
from faceposer.geometry.obj_io import read_obj
from faceposer.geometry.picking import pick
from faceposer.identity.anatomy.eyeballs import CORNEA_HEIGHT
from faceposer.model.character import Character
from faceposer.model.character_file import load_character
from scripts.asset_building.builder import Builder
from scripts.asset_building.creature import build_creature
from scripts.asset_building.creature_expressions import EXPRESSIONS
from scripts.asset_building.source import WHEEL_NAME, Source
from scripts.build_assets import ROOT, write_examples

NAMES = list(EXPRESSIONS)


@pytest.fixture(scope="module")
def creature() -> tuple[Character, NDArray[np.float32]]:
    wheel = Path(os.environ.get("FACEPOSER_WHEEL", ROOT / "build" / "source" / WHEEL_NAME))
    if not wheel.is_file():
        pytest.skip("the source wheel is not here: run scripts/build_assets.py, or set FACEPOSER_WHEEL")
    return build_creature(Builder(Source(wheel)))


def test_it_is_another_mesh_without_a_rig(creature: tuple[Character, NDArray[np.float32]]) -> None:
    character, examples = creature
    man = load_character("man")
    assert 8_000 < len(character.vertices) < 0.6 * len(man.vertices)
    assert character.shape_names == ()
    assert examples.shape == (50, len(character.vertices), 3)
    assert np.isfinite(examples).all()
    is_triangle = character.polygons[:, 3] < 0
    assert 0.02 < is_triangle.mean() < 0.3
    assert len(np.unique(character.polygons[character.polygons >= 0])) == len(character.vertices)


def test_it_is_symmetric_with_regions_and_feature_points(creature: tuple[Character, NDArray[np.float32]]) -> None:
    character, examples = creature
    man = load_character("man")
    assert character.regions.keys() == man.regions.keys()
    assert min(map(len, character.regions.values())) > 50
    assert character.feature_titles == man.feature_titles
    distance, partner = cKDTree(character.vertices).query(character.vertices * np.float32([-1, 1, 1]))
    assert distance.max() < 2e-3
    for left in (name for name in character.regions if name.endswith("_left")):
        right = left.replace("_left", "_right")
        assert set(partner[character.regions[left]].tolist()) == set(character.regions[right].tolist())
    for name in (name for name in NAMES if name.endswith("_left")):
        mirrored = examples[NAMES.index(name.replace("_left", "_right"))] * np.float32([-1, 1, 1])
        assert cKDTree(examples[NAMES.index(name)]).query(mirrored)[0].max() < 5e-3, name


def test_its_ears_are_long_and_pointed(creature: tuple[Character, NDArray[np.float32]]) -> None:
    character, examples = creature
    man = load_character("man")
    ear, his = (one.vertices[one.regions["ear_left"]] for one in (character, man))
    extent, his_extent = (np.linalg.norm(np.ptp(points, axis=0)) for points in (ear, his))
    assert extent > 1.5 * his_extent
    tip = character.vertices[character.feature_points["10.1"]]
    assert tip[0] > np.abs(character.vertices[character.regions["scalp"], 0]).max() + 3.0
    # Few of its vertices lie near the tip, in depth close together.
    near = ear[np.linalg.norm(ear - tip, axis=1) < 1.0]
    assert np.ptp(near[:, 2]) < 1.2
    heights = {
        name: examples[NAMES.index(name), character.feature_points["10.1"], 1] for name in ("surprise", "sorrow")
    }
    assert heights["surprise"] > tip[1] + 0.9
    assert heights["sorrow"] < tip[1] - 1.5


@pytest.mark.parametrize("side", ["left", "right"])
def test_its_lids_shut_and_stay_in_front_of_its_eyes(
    creature: tuple[Character, NDArray[np.float32]], side: str
) -> None:
    character, examples = creature
    upper, lower = (character.feature_points[name] for name in (("3.1", "3.3") if side == "left" else ("3.2", "3.4")))
    assert character.vertices[upper, 1] - character.vertices[lower, 1] > 0.9
    blink = examples[NAMES.index("blink")]
    assert abs(blink[upper, 1] - blink[lower, 1]) < 0.1
    ball = character.vertices[slice(*character.part(f"eye_{side}").vertices)]
    radius = float(ball[0, 2] - ball[-1, 2]) / (2.0 + CORNEA_HEIGHT)
    centre = ball[-1] + [0.0, 0.0, radius]
    lids = character.regions[f"lids_{side}"]
    ahead = lids[character.vertices[lids, 2] > centre[2] + 0.5 * radius]
    outside = ahead[np.linalg.norm(character.vertices[ahead] - centre, axis=1) > radius]
    assert len(outside) > 60
    for name, example in zip(NAMES, examples, strict=True):
        for strength in (0.5, 1.0):
            lid = character.vertices[outside] + strength * (example - character.vertices)[outside]
            assert np.linalg.norm(lid - centre, axis=1).min() > radius - 0.02, (name, strength)


def test_its_lips_are_shut_where_they_should_be(creature: tuple[Character, NDArray[np.float32]]) -> None:
    character, examples = creature
    camera = OrbitView.preset(character.vertices.min(axis=0), character.vertices.max(axis=0), "front").camera(
        (800, 800)
    )
    first, stop = character.part_triangles(character.part("skin"))
    shut = {"neutral": character.vertices, "blink": examples[NAMES.index("blink")]}
    for vertices in shut.values():
        corner = vertices[character.feature_points["8.3"]]
        top, bottom = (vertices[character.feature_points[name], 1] for name in ("2.2", "2.3"))
        # No ray in the plane of symmetry: it would run along edges.
        for x in np.linspace(-0.95, 0.95, 10) * corner[0]:
            for y in np.linspace(min(bottom, corner[1]) - 0.1, top + 0.1, 9):
                (pixel,) = camera.project(np.array([[x, y, corner[2] + 1.0]]))
                hit = pick(vertices, character.triangles, camera, (pixel[0], pixel[1]))
                assert hit is not None
                assert first <= hit.face < stop, (x, y)


def test_its_textures_are_of_a_moderate_size(creature: tuple[Character, NDArray[np.float32]]) -> None:
    character, _ = creature
    assert set(character.textures) == {"skin", "eye", "teeth", "gums", "throat", "tongue"}
    assert sum(map(len, character.textures.values())) < 400_000
    assert character.uv.min() >= 0
    assert character.uv.max() <= 1


def test_examples_are_written_as_obj(creature: tuple[Character, NDArray[np.float32]], tmp_path: Path) -> None:
    character, examples = creature
    write_examples(tmp_path, character, examples)
    assert {path.stem for path in tmp_path.glob("*.obj")} == {"neutral", *NAMES}
    mesh = read_obj(tmp_path / "smile.obj")
    np.testing.assert_allclose(mesh.vertices, examples[NAMES.index("smile")], atol=1e-6)
    np.testing.assert_array_equal(mesh.polygons, character.polygons)
    assert [group.name for group in mesh.groups] == [part.name for part in character.parts]
