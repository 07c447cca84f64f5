"""Rivals of cloning by examples: they return what is known, and follow what is not."""

from dataclasses import replace

import numpy as np
import pytest

from faceposer.evaluation.cloning.correspondence import Skin, facing_triangles, fitted
from faceposer.evaluation.cloning.deformation_transfer import DeformationTransfer
from faceposer.evaluation.cloning.expression_cloning import ExpressionCloning
from faceposer.evaluation.cloning.measures import clone_errors
from faceposer.model.face_model import FaceModel


def skins(low: FaceModel) -> tuple[Skin, np.ndarray, np.ndarray]:
    """The low head's skin, the same with open jaw and smile, and the mask of what stays still."""
    skin = Skin.of(low.character)
    count = len(skin.vertices)
    posed = low.instance(low.coefficients_of({"jawOpen": 0.6, "mouthSmileLeft": 0.8}))[:count].astype(np.float64)
    still = np.abs(low.character.shapes[:, :count]).max(axis=(0, 2)) < 1e-6
    return skin, posed, still


def test_a_face_clones_to_itself_exactly(low: FaceModel) -> None:
    skin, posed, still = skins(low)
    for rival in (ExpressionCloning(skin, skin), DeformationTransfer(skin, skin, still)):
        assert np.abs(rival.clone(posed) - posed).max() < 1e-3


def test_a_larger_head_moves_more(low: FaceModel) -> None:
    skin, posed, still = skins(low)
    large = replace(skin, vertices=1.5 * skin.vertices + 3.0, height=1.5 * skin.height)
    np.testing.assert_allclose(fitted(skin, large), large.vertices, atol=1e-5)
    for rival in (ExpressionCloning(skin, large), DeformationTransfer(skin, large, still)):
        assert np.abs(rival.clone(posed) - (1.5 * posed + 3.0)).max() < 2e-3
        np.testing.assert_allclose(rival.clone(skin.vertices), large.vertices, atol=1e-4)


def test_an_expression_reaches_another_mesh(low: FaceModel, man: FaceModel) -> None:
    skin, posed, _ = skins(low)
    other = Skin.of(man.character)
    truth = man.instance(man.coefficients_of({"jawOpen": 0.6, "mouthSmileLeft": 0.8}))[: len(other.vertices)]
    clone = ExpressionCloning(skin, other).clone(posed)
    assert clone_errors(clone[None], truth[None].astype(np.float64), other.vertices).displacement < 0.4


def test_touching_surfaces_are_told_apart_by_their_normals_and_what_is_missing_has_no_counterpart() -> None:
    # Two lips, 0.1 apart, that face each other, at half the height of a head of 10.
    square = np.array([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [2.0, 0.0, 2.0], [0.0, 0.0, 2.0]])
    vertices = np.vstack([square, square + [0.0, 0.1, 0.0]])
    triangles = np.array([[0, 2, 1], [0, 3, 2], [4, 5, 6], [4, 6, 7]])
    places = np.array([[1.2, 0.09, 0.8], [1.2, 0.01, 0.8], [1.2, -5.0, 0.8]])
    normals = np.array([[0.0, 1.0, 0.0], [0.0, -1.0, 0.0], [0.0, 1.0, 0.0]])
    faces, weights, shares = facing_triangles(places, normals, vertices, triangles, 10.0)
    assert [face < 2 for face in faces] == [True, False, True]
    found = np.einsum("nc,ncd->nd", weights, vertices[triangles[faces]])
    np.testing.assert_allclose(found[:, [0, 2]], places[:, [0, 2]], atol=1e-12)
    assert shares.tolist() == [1.0, 1.0, 0.0]


def test_errors_are_those_of_the_paper() -> None:
    truths = np.array([[[3.0, 4.0, 0.0], [0.0, 0.0, 5.0]]])
    clones = truths + np.array([[[0.3, 0.0, 0.0], [0.0, 0.0, 0.0]]])
    found = clone_errors(clones, truths, np.zeros((2, 3)))
    assert found.paper == pytest.approx(3.0)
    assert found.paper_axes == pytest.approx((10.0, 0.0, 0.0))
    assert found.displacement == pytest.approx(0.03)
