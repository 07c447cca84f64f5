"""Default views show the face, from chin to hairline, of whatever character."""

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from faceposer.model.character import Character
from faceposer.model.character_file import load_character
from faceposer.model.framing import ABOVE, BELOW, face_frame, face_view
from faceposer.render.offscreen import plain_character

RIGS = os.environ.get("FACEPOSER_RIGS")


def ends(character: Character, known: Character, size: tuple[int, int], view: str = "front") -> tuple[float, float]:
    """Return where the view shows hairline and chin, as shares of the picture's height from its top."""
    camera = face_view(known, view, size[0] / size[1]).camera(size)
    points = character.vertices[[character.feature_points[name] for name in ("11.1", "2.1")]]
    hairline, chin = (camera.project(points)[:, 1] / size[1]).tolist()
    return hairline, chin


@pytest.mark.parametrize("name", ["man", "woman", "low", "creature"])
def test_the_face_fills_the_picture(name: str) -> None:
    character = load_character(name)
    hairline, chin = ends(character, character, (1280, 800))
    assert hairline == pytest.approx(ABOVE)
    assert chin == pytest.approx(1.0 - BELOW)
    assert 0.70 <= chin - hairline <= 0.75


@pytest.mark.parametrize("name", ["man", "woman", "low"])
def test_so_it_does_in_square_pictures_and_without_feature_points(name: str) -> None:
    character = load_character(name)
    assert ends(character, character, (600, 600)) == pytest.approx((ABOVE, 1.0 - BELOW))
    hairline, chin = ends(character, replace(character, feature_points={}, feature_titles={}), (600, 600))
    assert 0.64 <= chin - hairline <= 0.75
    assert hairline > 0.10
    assert chin < 0.88


def test_long_ears_fit_where_the_face_may_be_smaller_for_them() -> None:
    goblin = load_character("creature")
    pixels = face_view(goblin, "front").camera((600, 600)).project(goblin.vertices)
    assert pixels[:, 0].min() > 0
    assert pixels[:, 0].max() < 600
    hairline, chin = ends(goblin, goblin, (600, 600))
    assert chin - hairline > 0.45
    assert hairline == pytest.approx(1.0 - chin, abs=0.05)


def test_narrow_pictures_show_the_whole_width_of_the_head() -> None:
    man = load_character("man")
    pixels = face_view(man, "front", 0.5).camera((300, 600)).project(man.vertices)
    assert pixels[:, 0].min() > 0
    assert pixels[:, 0].max() < 300


def test_other_views_keep_the_distance_and_show_the_profile() -> None:
    man = load_character("man")
    front, left = face_view(man, "front"), face_view(man, "left")
    assert left.distance == front.distance
    assert left.target == front.target
    nose = left.camera((600, 600)).project(man.vertices[[man.feature_points["9.3"]]])[0]
    assert 0 < nose[0] < 300


def test_a_mesh_without_a_face_is_framed_as_a_whole() -> None:
    man = load_character("man")
    bare = plain_character(man.vertices, man.triangles)
    assert face_frame(bare) is None
    pixels = face_view(bare, "front").camera((600, 600)).project(man.vertices)
    assert pixels.min() > 0
    assert pixels.max() < 600


@pytest.mark.skipif(not RIGS, reason="FACEPOSER_RIGS names no folder of rigs")
@pytest.mark.parametrize("rig", ["facecap", "facecap_multi"])
def test_rigs_of_others_are_framed_alike(rig: str) -> None:
    from faceposer.training.request import TrainingRequest, train

    character = train(TrainingRequest("rig", Path(RIGS or "") / f"{rig}.glb", rig, rig))
    for size in ((1280, 800), (600, 600)):
        assert ends(character, character, size) == pytest.approx((ABOVE, 1.0 - BELOW))
        hairline, chin = ends(character, replace(character, feature_points={}, feature_titles={}), size)
        assert 0.65 <= chin - hairline <= 0.78
        assert np.isfinite(chin)
