"""Poses of a character with another head, transferred by key poses of the character as it is."""

from dataclasses import replace

import numpy as np

from faceposer.model.face_model import FaceModel, build_face_model
from faceposer.transfer.examples import ExampleTransfer, KeyPair
from faceposer.transfer.source_heads import HeadTransfer, is_same_rig
from tests.rigs import with_fewer_shapes


def test_a_pose_of_any_head_has_the_clone_of_the_same_weights(low: FaceModel) -> None:
    character = low.character
    # A head twice as large, built anew, whose coefficients mean other weights.
    head = build_face_model(replace(character, vertices=2.0 * character.vertices, shapes=2.0 * character.shapes))
    slow = build_face_model(character, n_components=20)
    weights = {"jawOpen": 0.7}
    pairs = [KeyPair("open", low.coefficients_of(weights), low.coefficients_of({"mouthSmileLeft": 1.0}))]
    keys = ExampleTransfer(low, low, pairs)
    for model in (low, head, slow):
        found = HeadTransfer(keys, model).pose(model.coefficients_of(weights))
        np.testing.assert_allclose(found, pairs[0].target, atol=0.02 * np.abs(pairs[0].target).max())


def test_a_rig_is_known_by_its_name_and_shapes(low: FaceModel, man: FaceModel) -> None:
    few, fewer = (build_face_model(with_fewer_shapes(low.character, count)) for count in (30, 20))
    bigger = build_face_model(replace(few.character, vertices=2.0 * few.character.vertices))
    assert is_same_rig(few, bigger)
    assert not is_same_rig(few, fewer)
    assert not is_same_rig(low, man)
