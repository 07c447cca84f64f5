"""Expression lines follow the compression of the skin: none at rest, more with the muscle, and each by its own."""

from collections.abc import Mapping
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from faceposer.model.character import Character
from faceposer.model.character_file import load_character
from faceposer.model.expression_line_map import DENSITY, EXTENT, LAYERS, line_heights
from faceposer.model.expression_lines import GROUPS, ZONES, ExpressionLines, expression_lines, strength_map
from faceposer.model.face_chart import face_chart

CHARACTERS = ("man", "woman", "low", "creature")
WITH_MUSCLES = ("man", "woman", "low")
#: The group that a muscle must wrinkle, and others that go with it.
MUSCLES = {
    "browInnerUp": ("forehead", ()),
    "browOuterUp": ("forehead", ()),
    "browDown": ("frown", ("bunny", "nasolabial")),
    "cheekSquint": ("crows_feet", ("nasolabial",)),
    "noseSneer": ("bunny", ("frown", "nasolabial")),
    "mouthSmile": ("nasolabial", ("crows_feet",)),
    "mouthFrown": ("marionette", ()),
}
STILL = ("jawOpen", "mouthPucker", "mouthFunnel", "eyeBlink", "eyeWide", "eyeLookDown", "cheekPuff", "tongueOut")


@cache
def with_lines(name: str) -> tuple[Character, ExpressionLines]:
    character = load_character(name)
    lines = expression_lines(character)
    assert lines is not None
    return character, lines


def posed(character: Character, weights: Mapping[str, float]) -> np.ndarray:
    """Return the vertices; a shape without side is one of both sides where it has them."""
    vertices = character.vertices.copy()
    for i, name in enumerate(character.shape_names):
        weight = weights.get(name, weights.get(name.removesuffix("Left").removesuffix("Right"), 0.0))
        vertices += np.float32(weight) * character.shapes[i]
    return vertices


def by_group(strengths: Mapping[str, float]) -> dict[str, float]:
    return {group: max(s for zone, s in strengths.items() if zone.startswith(group)) for group in GROUPS}


@pytest.mark.parametrize("name", CHARACTERS)
def test_nothing_at_rest_nor_under_rigid_motion(name: str) -> None:
    character, lines = with_lines(name)
    assert not np.any(lines.strengths(character.vertices))
    turn, _ = np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))
    moved = (character.vertices @ turn.T + [3.0, -8.0, 20.0]).astype(np.float32)
    np.testing.assert_allclose(lines.compression(moved), 0.0, atol=2e-5)
    assert not np.any(lines.strengths(moved))


def test_compression_is_the_relative_shortening_of_the_skin() -> None:
    character, lines = with_lines("man")
    shorter = lines.compression(0.9 * character.vertices)
    plain = [i for i, zone in enumerate(ZONES) if not zone.startswith("nasolabial")]
    np.testing.assert_allclose(shorter[plain], 0.1, atol=1e-5)
    # Across the forehead, not along it.
    lower = lines.compression(character.vertices * np.float32([1.0, 0.9, 1.0]))
    narrower = lines.compression(character.vertices * np.float32([0.9, 1.0, 1.0]))
    forehead, frown = ZONES.index("forehead_inner_left"), ZONES.index("frown_left")
    assert lower[forehead] > 0.08
    assert narrower[forehead] < 0.02
    assert narrower[frown] > lower[frown]


@pytest.mark.parametrize("name", WITH_MUSCLES)
@pytest.mark.parametrize("muscle", MUSCLES)
def test_each_muscle_makes_its_own_lines(name: str, muscle: str) -> None:
    character, lines = with_lines(name)
    group, others = MUSCLES[muscle]
    strengths = by_group(lines.by_zone(posed(character, {muscle: 1.0})))
    assert strengths[group] > 0.7
    for other in set(GROUPS) - {group, *others}:
        assert strengths[other] < 0.2, other


@pytest.mark.parametrize("name", WITH_MUSCLES)
@pytest.mark.parametrize("shape", STILL)
def test_what_stretches_or_slides_makes_none(name: str, shape: str) -> None:
    character, lines = with_lines(name)
    # The coarse lids of the low-poly head stretch unevenly.
    assert lines.strengths(posed(character, {shape: 1.0})).max() < (0.25 if name == "low" else 0.15)


@pytest.mark.parametrize("name", WITH_MUSCLES)
@pytest.mark.parametrize("muscle", MUSCLES)
def test_strength_rises_smoothly_from_nothing(name: str, muscle: str) -> None:
    character, lines = with_lines(name)
    weights = np.linspace(0.0, 1.0, 41)
    rows = [lines.by_zone(posed(character, {muscle: w})) for w in weights]
    strengths = np.array([by_group(row)[MUSCLES[muscle][0]] for row in rows])
    steps = np.diff(strengths)
    assert strengths[0] == 0.0
    assert strengths[2] < 0.02
    assert steps.min() >= -1e-6
    assert steps.max() < 0.06


@pytest.mark.parametrize("name", WITH_MUSCLES)
@pytest.mark.parametrize("muscle", [m for m in MUSCLES if m != "browInnerUp"])
def test_sides_are_alike_and_apart(name: str, muscle: str) -> None:
    character, lines = with_lines(name)
    left = lines.strengths(posed(character, {f"{muscle}Left": 0.8}))
    right = lines.strengths(posed(character, {f"{muscle}Right": 0.8}))
    half = len(ZONES) // 2
    np.testing.assert_allclose(left[:half], right[half:], atol=0.02)
    group = [i for i, zone in enumerate(ZONES[:half]) if zone.startswith(MUSCLES[muscle][0])]
    assert left[group].max() > 0.5
    assert left[half:][group].max() < 0.2


def test_the_surface_counts_not_what_has_posed_it() -> None:
    """A brow pushed up by hand, as a contact or an edit might, wrinkles the forehead above it."""
    character, lines = with_lines("creature")
    assert not set(character.shape_names) & {"browInnerUp", "browOuterUpLeft"}
    vertices = character.vertices.copy()
    brow = vertices[character.feature_points["4.3"]]
    near = np.exp(-0.5 * ((vertices - brow) ** 2).sum(axis=1) / 1.5**2)
    vertices[:, 1] += 0.8 * near
    strengths = lines.by_zone(vertices)
    assert strengths["forehead_outer_left"] > 0.4
    assert strengths["forehead_outer_right"] == 0.0


@pytest.mark.parametrize("name", CHARACTERS)
def test_the_chart_has_feature_points_in_their_places(name: str) -> None:
    character, _ = with_lines(name)
    chart, man = face_chart(character), face_chart(with_lines("man")[0])
    assert chart is not None
    assert man is not None
    for point in ("3.7", "3.12", "4.1", "4.2", "4.5", "4.6", "8.3", "8.4", "9.1", "9.2"):
        there = man.places[with_lines("man")[0].feature_points[point]]
        assert np.abs(chart.places[character.feature_points[point]] - there).max() < 0.5, point
    # Inner sides of the mouth and of the eyes have no lines.
    skin = character.part("skin")
    assert 0.2 < (chart.visible[slice(*skin.vertices)] > 0.5).mean() < 0.9
    assert not np.any(chart.visible[skin.vertices[1] :])


def test_faces_that_are_not_known_have_no_lines() -> None:
    character, _ = with_lines("low")
    for kept in ((), ("8.3",), tuple(set(character.feature_points) - {"8.3"})):
        points = {key: character.feature_points[key] for key in kept}
        titles = {key: character.feature_titles[key] for key in kept}
        assert expression_lines(replace(character, feature_points=points, feature_titles=titles)) is None
    # Left and right exchanged: such a chart would be turned over.
    exchanged = {
        **character.feature_points,
        "3.7": character.feature_points["3.12"],
        "3.12": character.feature_points["3.7"],
    }
    assert expression_lines(replace(character, feature_points=exchanged)) is None
    nowhere = dict.fromkeys(character.feature_points, 0)
    assert expression_lines(replace(character, feature_points=nowhere)) is None


def test_texture_coordinates_and_shapes_are_not_needed() -> None:
    character, lines = with_lines("low")
    vertices = posed(character, {"mouthSmile": 0.7, "cheekSquint": 0.5})
    flat = np.zeros((1, 2), dtype=np.float32)
    bare = replace(
        character,
        uv=flat,
        polygon_uvs=np.where(character.polygons < 0, -1, 0).astype(np.int32),
        textures={},
        shape_names=(),
        shapes=character.shapes[:0],
        shape_limits=np.zeros((0, 2), dtype=np.float32),
    )
    found = expression_lines(bare)
    assert found is not None
    np.testing.assert_allclose(found.compression(vertices), lines.compression(vertices), atol=1e-6)
    assert by_group(found.by_zone(vertices))["nasolabial"] > 0.5


def test_the_map_is_empty_at_its_edges_and_where_no_line_runs() -> None:
    heights = line_heights()
    left, right, bottom, top = EXTENT
    assert heights.shape == (round((top - bottom) * DENSITY), round((right - left) * DENSITY), LAYERS)
    for edge in (heights[0], heights[-1], heights[:, 0], heights[:, -1]):
        assert not np.any(edge)

    def around(u: float, v: float, size: float = 0.6) -> np.ndarray:
        column, row, reach = ((u - left) * DENSITY, (v - bottom) * DENSITY, size * DENSITY)
        return heights[round(row - reach) : round(row + reach), round(column - reach) : round(column + reach)]

    # Forehead, crow's feet, folds; frown lines, bunny lines.
    for layer, places in enumerate((((0.0, 6.0), (6.2, 1.4), (3.0, -4.2)), ((0.75, 4.0), (0.8, 0.7)))):
        for u, v in places:
            for side in (1.0, -1.0):
                assert around(side * u, v)[..., layer].min() < -0.015
    # Eyeballs, lips and the tip of the nose stay smooth.
    for u, v in ((3.2, 1.6), (-3.2, 1.6), (0.0, -5.0), (0.0, -2.0)):
        assert np.abs(around(u, v)).max() < 6e-3
        assert around(u, v).min() > -1e-3


def test_strengths_are_spread_over_the_map() -> None:
    np.testing.assert_allclose(strength_map(np.ones(len(ZONES))), 1.0, atol=1e-5)
    only = np.zeros(len(ZONES))
    only[ZONES.index("crows_feet_left")] = 1.0
    spread = strength_map(only)
    left, right, bottom, top = EXTENT
    rows, columns, _ = spread.shape

    def at(u: float, v: float) -> float:
        return float(spread[int((v - bottom) / (top - bottom) * rows), int((u - left) / (right - left) * columns), 0])

    assert at(6.0, 1.2) > 0.95
    assert at(-6.0, 1.2) < 0.01
    assert at(3.4, -4.4) < 0.01
    assert at(0.0, 6.2) < 0.01
    assert not np.any(spread[..., 1])
