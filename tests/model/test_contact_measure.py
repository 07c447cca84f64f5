"""Penetration is measured on the meshes: what is pushed in by hand is found, and how deep."""

import numpy as np
import pytest

from faceposer.model.character_file import load_character
from faceposer.model.contact.eyeballs import find_eyeballs
from faceposer.model.contact.measure import KINDS, penetration_mm
from faceposer.model.face_model import FaceModel


@pytest.mark.parametrize("name", ["man", "woman", "low", "creature"])
def test_the_neutral_face_penetrates_nothing(name: str) -> None:
    character = load_character(name)
    assert penetration_mm(character, character.vertices) == dict.fromkeys(KINDS, 0.0)


def test_both_sides_are_treated_alike() -> None:
    character = load_character("man")
    balls = find_eyeballs(character)
    assert len(balls) == 2
    np.testing.assert_allclose(balls[0].centre * [-1, 1, 1], balls[1].centre, atol=1e-4)
    assert balls[0].radius == pytest.approx(balls[1].radius, rel=1e-4)


def test_a_lid_pushed_into_the_eye_is_found(model: FaceModel) -> None:
    character = model.character
    ball = find_eyeballs(character)[0]
    vertex = character.feature_points["3.13"]
    vertices = character.vertices.astype(np.float64)
    out = vertices[vertex] - ball.centre
    vertices[vertex] = ball.centre + out * (ball.radius - 0.13) / np.linalg.norm(out)
    depth = penetration_mm(model, vertices)
    # The foot of the cornea, which lies beneath that lid, stands a little above the sphere.
    assert depth["lids_eyeballs"] == pytest.approx(1.3, abs=0.15)
    assert depth["lips_teeth"] == depth["teeth_skin"] == 0.0


def test_lids_past_each_other_are_found(model: FaceModel) -> None:
    closed = penetration_mm(model, model.instance(model.coefficients_of({"eyeBlinkLeft": 1.0})))
    beyond = penetration_mm(model, model.instance(model.coefficients_of({"eyeBlinkLeft": 1.6})))
    assert beyond["lid_lid"] > closed["lid_lid"] + 1.0


@pytest.mark.parametrize(("forward", "outside"), [(0.4, False), (1.5, True)])
def test_skin_behind_the_teeth_and_teeth_outside_are_found(model: FaceModel, forward: float, outside: bool) -> None:
    vertices = model.character.vertices.astype(np.float64)
    for name in ("teeth_lower", "gums_lower"):
        vertices[slice(*model.character.part(name).vertices), 2] += forward
    depth = penetration_mm(model, vertices)
    assert depth["lips_teeth"] > 0.4
    assert (depth["teeth_skin"] > 1.0) == outside


def test_another_number_of_vertices_is_refused(model: FaceModel) -> None:
    with pytest.raises(ValueError, match="vertices must have shape"):
        penetration_mm(model, model.character.vertices[1:])
