"""Composition of emotional and verbal keys, as printed, and where the rule switches."""

import numpy as np
import pytest

from faceposer.errors import FacePoserError
from faceposer.model.face_model import FaceModel
from faceposer.transfer.key_models import composed, importance, smoothed, tear


def test_the_rule_is_that_of_the_paper_at_single_vertices() -> None:
    e, p = np.array([[1.0, 1.0, 0.0]] * 4), np.array([[2.0, 0.0, 0.0]] * 4)
    alpha = np.array([1.0, 0.5, 0.49, 0.0])
    result = composed(e, p, alpha, "switch")
    # The part of e perpendicular to p is (0, 1, 0), that of p perpendicular to e is (1, -1, 0).
    expected = [[2, 0, 0], [2, 0.5, 0], [1.49, 0.51, 0], [1, 1, 0]]
    np.testing.assert_allclose(result, expected)
    smooth = composed(e, p, alpha, "smooth")
    np.testing.assert_allclose(smooth[[0, 3]], np.array(expected)[[0, 3]])


def test_zero_displacements_have_no_direction() -> None:
    zero, other = np.zeros((2, 3)), np.array([[0.0, 2.0, 0.0]] * 2)
    alpha = np.array([0.8, 0.2])
    for meeting in ("switch", "smooth"):
        assert not composed(zero, zero, alpha, meeting).any()
    np.testing.assert_allclose(composed(other, zero, alpha, "switch"), [[0, 0.4, 0], [0, 2, 0]])
    np.testing.assert_allclose(composed(zero, other, alpha, "switch"), [[0, 2, 0], [0, 0.4, 0]])


def test_parallel_displacements_are_not_added() -> None:
    same = np.array([[0.0, 1.0, 0.0]])
    for alpha in (0.0, 0.3, 0.5, 0.9):
        np.testing.assert_allclose(composed(0.5 * same, same, [alpha], "switch"), (1.0 if alpha >= 0.5 else 0.5) * same)


def test_importance_follows_the_appendix() -> None:
    vertices = np.array([[0.0, 0, 0], [0.01, 0, 0], [5.0, 0, 0], [9.0, 0, 0]])
    verbal = np.array([[[2.0, 0, 0], [0, 0, 0], [0, 0, 0], [0.1, 0, 0]]])
    emotional = np.array([[[0.5, 0, 0], [0, 0, 0], [0, 1.0, 0], [0, 0, 0]]])
    found = importance(vertices, verbal, emotional, 1.0)
    np.testing.assert_allclose(found.verbal, [1, 0, 0, 0.05])
    np.testing.assert_allclose(found.emotional, [0.5, 0, 1, 0])
    # The second vertex is near the first; the last is too far, and its value too small to spread.
    np.testing.assert_allclose(found.verbal_spread, [1, 1, 0, 0.05])
    np.testing.assert_allclose(found.emotional_spread, [0.5, 0.5, 1, 0])
    np.testing.assert_allclose(found.values, [1, 1, 0, 0.05])


def test_a_mouth_is_for_speech_and_brows_are_not(low: FaceModel) -> None:
    def moved(**weights: float) -> np.ndarray:
        return low.instance(low.coefficients_of(weights)) - low.character.vertices

    verbal = [moved(jawOpen=0.5), moved(mouthPucker=1.0), moved(mouthClose=0.2, jawOpen=0.2)]
    emotional = [
        moved(browInnerUpLeft=1.0, browInnerUpRight=1.0, mouthFrownLeft=0.6, mouthFrownRight=0.6),
        moved(mouthSmileLeft=1.0, mouthSmileRight=1.0, cheekSquintLeft=1.0, cheekSquintRight=1.0),
    ]
    character = low.character
    alpha = importance(character.vertices, verbal, emotional, character.height).values
    assert alpha.min() >= 0.0
    assert alpha.max() <= 1.0
    assert alpha[character.regions["lip_lower"]].mean() > 0.8
    assert alpha[character.regions["brow_left"]].mean() < 0.1
    smooth = smoothed(alpha, character.triangles)
    worst = {}
    for meeting, values in (("switch", alpha), ("smooth", smooth)):
        both = composed(emotional[1], verbal[0], values, meeting, character.height)
        worst[meeting] = np.percentile(tear(both, character.vertices, character.triangles), 99.8)
    assert worst["smooth"] < 0.8 * worst["switch"], "the switch tears, the smooth rule does not"


def test_keys_of_both_kinds_are_needed() -> None:
    some = np.ones((1, 4, 3))
    with pytest.raises(FacePoserError, match="no verbal keys"):
        importance(np.zeros((4, 3)), np.zeros((0, 4, 3)), some, 1.0)
    with pytest.raises(FacePoserError, match="no emotional keys that move the face"):
        importance(np.zeros((4, 3)), some, 0.0 * some, 1.0)
