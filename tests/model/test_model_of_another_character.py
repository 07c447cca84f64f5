"""A face model in the subspace of another character's."""

import dataclasses

import numpy as np
import pytest

from faceposer.model.character import Character
from faceposer.model.face_model import FaceModel


def test_the_same_character_has_the_same_model(man: FaceModel) -> None:
    same = man.with_character(man.character)
    pose = man.rig_density.projection @ man.rig_density.draws[0]
    np.testing.assert_allclose(same.instance(pose), man.instance(pose), atol=1e-6)
    np.testing.assert_array_equal(same.rig_density.largest, man.rig_density.largest)


def test_coefficients_are_the_same_weights_on_the_other_character(man: FaceModel, woman: FaceModel) -> None:
    model = man.with_character(woman.character)
    pose = man.coefficients_of({"jawOpen": 0.6, "mouthSmileLeft": 0.4})
    weights = man.weights_of(pose).astype(np.float32)
    posed = woman.character.vertices + np.tensordot(weights, woman.character.shapes, axes=1)
    np.testing.assert_allclose(model.instance(pose), posed, atol=1e-4)
    np.testing.assert_array_equal(model.mixture.means, man.mixture.means)
    np.testing.assert_allclose(model.gram, woman.gram)


def test_another_scale_changes_displacements_alone(man: FaceModel) -> None:
    c = man.character
    larger = dataclasses.replace(c, vertices=2 * c.vertices, shapes=2 * c.shapes)
    model = man.with_character(larger)
    np.testing.assert_allclose(model.basis, 2 * man.basis, rtol=1e-5, atol=1e-6)
    np.testing.assert_allclose(model.rig_density.largest, 2 * man.rig_density.largest, rtol=1e-5)


def test_other_shapes_are_refused(man: FaceModel) -> None:
    c = man.character
    fewer: Character = dataclasses.replace(
        c, shape_names=c.shape_names[:-1], shapes=c.shapes[:-1], shape_limits=c.shape_limits[:-1]
    )
    with pytest.raises(ValueError, match="the same shapes"):
        man.with_character(fewer)
