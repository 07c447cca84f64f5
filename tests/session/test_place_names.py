"""Names of places, on every character of the program and on imported rigs where there are any."""

import os
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from faceposer.geometry.camera import OrbitView
from faceposer.geometry.picking import SurfacePoints
from faceposer.model.character import Character
from faceposer.model.character_file import available_characters, load_character
from faceposer.session.place_names import PointNames
from faceposer.solve.constraints.point import PointConstraint

RIGS = Path(os.environ.get("FACEPOSER_RIGS", ""))
NAMES = [name for name, _ in available_characters()]
IMPORTED = ["facecap.glb", "facecap_multi.glb"]


def character_of(name: str) -> Character:
    if not name.endswith(".glb"):
        return load_character(name)
    if not (RIGS / name).is_file():
        pytest.skip("FACEPOSER_RIGS has no such rig")
    from faceposer.training.request import TrainingRequest, train

    return train(TrainingRequest(kind="rig", source=RIGS / name, name="head", title="Head"))


@pytest.fixture(scope="module", params=[*NAMES, *IMPORTED])
def character(request: pytest.FixtureRequest) -> Character:
    return character_of(request.param)


def place(character: Character, feature: str) -> np.ndarray:
    return character.vertices[character.feature_points[feature]].astype(float)


def skin(character: Character) -> tuple[int, int]:
    """Return the range of the skin's vertices."""
    return next(part.vertices for part in character.parts if part.material == "skin")


def nearest(character: Character, position: np.ndarray) -> int:
    """The vertex of the skin that lies nearest to ``position``."""
    first, last = skin(character)
    return first + int(np.argmin(np.linalg.norm(character.vertices[first:last] - position, axis=1)))


def test_feature_points_are_called_what_they_are(character: Character) -> None:
    names = PointNames(character)
    for feature, vertex in character.feature_points.items():
        title = character.feature_titles.get(feature)
        if title is None or feature in ("3.5", "3.6"):
            continue
        others = {
            other
            for name, other in character.feature_titles.items()
            if name in character.feature_points
            and np.linalg.norm(place(character, name) - place(character, feature)) < 1e-6 * character.height
        }
        assert names.name(vertex) in {title, *others}


@pytest.mark.parametrize(
    ("side", "eye", "brow", "ear"), [("left", "3.7", "4.5", "10.1"), ("right", "3.12", "4.6", "10.2")]
)
def test_beside_eye_and_brow_is_the_temple_and_not_the_cheek(
    character: Character, side: str, eye: str, brow: str, ear: str
) -> None:
    names = PointNames(character)
    corner, end, back = (place(character, name) for name in (eye, brow, ear))
    for share in (0.35, 0.5):
        for height in (0.3, 0.8):
            position = corner + share * (back - corner)
            position[1] = corner[1] + height * (end[1] - corner[1])
            vertex = nearest(character, position)
            if character.vertices[vertex, 1] < corner[1] - 0.02 * character.height:
                continue
            found = names.name(vertex)
            assert "cheek" not in found
            if found not in ("scalp", "forehead"):
                assert side in found


@pytest.mark.parametrize(
    ("points", "words"),
    [
        (("4.5", "4.3"), "left brow"),
        (("4.3", "4.1"), "left brow"),
        (("4.6", "4.4"), "right brow"),
        (("4.4", "4.2"), "right brow"),
    ],
)
def test_a_place_on_a_brow_is_called_after_it_and_not_after_a_lid(
    character: Character, points: tuple[str, str], words: str
) -> None:
    names = PointNames(character)
    begin, end = (place(character, name) for name in points)
    for share in (0.0, 0.25, 0.5, 0.75, 1.0):
        found = names.name(nearest(character, begin + share * (end - begin)))
        assert words in found


def test_the_middle_of_the_face_has_no_side_and_the_mouth_is_at_the_mouth(character: Character) -> None:
    names = PointNames(character)
    first, last = skin(character)
    vertices = np.arange(first, last)
    middle = vertices[np.abs(character.vertices[vertices, 0]) < 1e-4 * character.height]
    lips = place(character, "8.1")
    # What lies in the mouth is left out.
    for vertex in middle[character.vertices[middle, 2] > lips[2] - 0.1 * character.height].tolist():
        found = names.name(vertex)
        away = np.linalg.norm(character.vertices[vertex] - lips) / character.height
        if away > 0.3:
            assert "mouth" not in found
            assert "lip" not in found
        assert found != "face" or away > 0.3


def test_between_the_eyes_is_no_cheek(character: Character) -> None:
    names = PointNames(character)
    left, right = place(character, "3.11"), place(character, "3.8")
    for share in (0.2, 0.35, 0.5, 0.65, 0.8):
        for up in (0.0, 0.02, 0.04):
            position = left + share * (right - left) + (0.0, up * character.height, 0.02 * character.height)
            assert "cheek" not in names.name(nearest(character, position))


def test_both_sides_have_the_same_words(character: Character) -> None:
    names = PointNames(character)
    for feature, title in character.feature_titles.items():
        if "left" not in title or feature not in character.feature_points:
            continue
        other = title.replace("left", "right")
        assert other in character.feature_titles.values()
        vertex = character.feature_points[feature]
        assert "right" not in names.name(vertex)


EYES = (("left", "4.1", "4.3", "4.5", "3.13"), ("right", "4.2", "4.4", "4.6", "3.14"))


@pytest.mark.parametrize(("side", "inner", "top", "outer", "lid"), EYES)
def test_between_brow_and_lid_is_neither_forehead_nor_nameless_lids(
    character: Character, side: str, inner: str, top: str, outer: str, lid: str
) -> None:
    names = PointNames(character)
    ends = [place(character, name) for name in (inner, top, outer)]
    for share in (0.3, 0.5, 0.8, 1.2, 1.5):
        along = ends[0] + share * (ends[1] - ends[0]) if share <= 1.0 else ends[1] + (share - 1) * (ends[2] - ends[1])
        for down in (0.3, 0.5, 0.7):
            position = along + down * (place(character, lid) - along) * (0.0, 1.0, 1.0)
            found = names.name(nearest(character, position))
            assert found != "forehead"
            assert found != f"{side} lids"


@pytest.mark.parametrize(("side", "inner", "top", "outer", "lid"), EYES)
def test_above_a_brow_is_no_lid(character: Character, side: str, inner: str, top: str, outer: str, lid: str) -> None:
    names = PointNames(character)
    for share in (0.0, 0.5, 1.0):
        position = (1.0 - share) * place(character, inner) + share * place(character, top)
        for up in (0.01, 0.03, 0.05):
            found = names.name(nearest(character, position + (0.0, up * character.height, 0.0)))
            assert "lid" not in found


def test_the_inner_edge_of_a_lip_is_named_only_where_the_lips_meet(character: Character) -> None:
    names = PointNames(character)
    inner = [f"2.{number}" for number in range(2, 10) if f"2.{number}" in character.feature_points]
    first, last = skin(character)
    vertices = np.arange(first, last)
    places = np.array([place(character, name) for name in inner])
    away = np.linalg.norm(character.vertices[vertices][:, None] - places[None], axis=2).min(axis=1)
    near = (away > 0.01 * character.height) & (away < 0.06 * character.height)
    assert not any("inner" in names.name(int(vertex)) for vertex in vertices[near])


def along(character: Character, *features: str) -> SurfacePoints:
    """Points of the skin along the straight lines between feature points."""
    places = [place(character, name) for name in features]
    shares = np.linspace(0.0, 1.0, 15)
    vertices = [
        nearest(character, begin + share * (end - begin)) for begin, end in pairwise(places) for share in shares
    ]
    return SurfacePoints.at_vertices(vertices)


def test_a_stroke_is_called_after_all_of_it(character: Character) -> None:
    names = PointNames(character)
    assert names.span(along(character, "8.4", "8.6", "8.1", "8.5", "8.3")) == "upper lip"
    # The straight lines leave the lower lip of the creature.
    assert names.span(along(character, "8.4", "8.8", "8.2", "8.7", "8.3")).endswith("lower lip")
    assert names.span(along(character, "4.1", "4.3", "4.5")) == "left brow"
    assert names.span(along(character, "4.2", "4.4", "4.6")) == "right brow"
    assert names.span(along(character, "9.3", "9.3")) == "nose tip"


def test_an_area_on_one_side_has_that_side(character: Character) -> None:
    names = PointNames(character)

    def points(*regions: str) -> SurfacePoints:
        found = np.concatenate([character.regions[region] for region in regions])
        return SurfacePoints.at_vertices(found)

    assert names.area(points("brow_left")) == "left brow"
    assert names.area(points("brow_left", "brow_right")) == "brow"
    sided = names.area(points("brow_left", "cheek_left"))
    assert sided == "left cheek" or "left brow" in sided


def test_constraints_at_one_place_are_numbered() -> None:
    character = load_character("low")
    camera = OrbitView.preset(character.vertices.min(axis=0), character.vertices.max(axis=0)).camera((100, 100))
    corner, other = character.feature_points["8.3"], character.feature_points["8.4"]
    pins = [PointConstraint(vertex, (0.0, 0.0), camera) for vertex in (corner, other, corner)]
    names = PointNames(character).all_of(pins)
    assert names == ["left mouth corner 1", "right mouth corner", "left mouth corner 2"]
