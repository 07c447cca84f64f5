"""Mirror correspondence of characters whose faces are not symmetric."""

import dataclasses

import numpy as np

from faceposer.identity.editing import head_editor
from faceposer.model.character_mirror import character_mirror
from faceposer.model.face_model import FaceModel


def test_heads_of_people_have_points_across(man: FaceModel) -> None:
    editor = head_editor(man.character)
    uneven = editor.with_head(editor.with_attributes(editor.own, {"asymmetry": 1.0}, seed=1))
    points = man.character.feature_points
    mirror = character_mirror(uneven).vertices
    assert np.mean(mirror >= 0) > 0.95
    assert mirror[points["8.3"]] == points["8.4"]
    assert mirror[points["4.1"]] == points["4.2"]


def test_other_meshes_are_their_own_measure(man: FaceModel, low: FaceModel) -> None:
    np.testing.assert_array_equal(character_mirror(low.character).vertices[:5] >= 0, True)
    bent = low.character.vertices + [[0.0, 0.0, 0.0]]
    bent[:, 1] += 0.2 * bent[:, 0]
    uneven = dataclasses.replace(low.character, vertices=bent.astype(np.float32))
    assert np.mean(character_mirror(uneven).vertices >= 0) < 0.5
