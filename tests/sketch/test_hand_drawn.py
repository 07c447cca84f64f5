"""Strokes as people draw them on pictures of the characters are recognised."""

import numpy as np
import pytest

from faceposer.sketch.habits import family_of
from faceposer.sketch.recognition import DrawnStroke
from faceposer.sketch.training_poses import TrainingPoses
from faceposer.sketch.whole_stroke import Tuning, WholeStrokeRecogniser
from tests.sketch.hand_drawn import drawn_strokes, stroke_through
from tests.sketch.test_whole_stroke import camera_of, fitted


@pytest.mark.parametrize("half", [0, 1])
def test_strokes_drawn_by_hand_are_recognised(half: int) -> None:
    # The constants of habits.py and drawing_order.py were chosen with these strokes.
    right, reached, smiles = [], [], []
    for character, view, feature, points in list(drawn_strokes())[half::2]:
        model, recogniser, _ = fitted(character)
        found = recogniser.recognise(stroke_through(points, camera_of(model, view)), model.neutral())
        best = found.best.feature if found.best is not None else ""
        right.append(best == feature)
        names = [candidate.feature for candidate in found.candidates]
        reached.append(feature in names[:3] if feature else not found.accepted)
        if feature == "mouth line":
            smiles.append(best == feature)
    assert len(right) >= 45
    assert np.mean(right) >= 0.97
    assert np.mean(reached) >= 0.97
    assert np.mean(smiles) == 1.0


def test_candidates_are_neighbours_of_the_likeliest() -> None:
    model, recogniser, _ = fitted("man")
    camera = camera_of(model)
    for character, view, feature, points in drawn_strokes():
        if (character, view) != ("man", "front") or not feature:
            continue
        found = recogniser.recognise(stroke_through(points, camera), model.neutral()).candidates
        others = [candidate for candidate in found[1:] if candidate.probability < 0.01]
        assert {candidate.feature for candidate in others} <= set(family_of(found[0].feature))
        if feature in ("mouth line", "outer lower lip"):
            assert len(found) == 5
            assert {"mouth line", "outer lower lip"} <= {candidate.feature for candidate in found}


def test_a_stroke_far_from_its_likeliest_curve_is_no_feature() -> None:
    model, _, _ = fitted("man")
    camera = camera_of(model)
    # Without a model of scribbles, only the distance refuses the fold beside the mouth.
    tuned = WholeStrokeRecogniser(model, TrainingPoses.of(model, 120).coefficients, Tuning(scribble=1e-300))
    fold = stroke_through(np.array([[424.0, 534.0], [385.0, 570.0], [362.0, 605.0], [356.0, 640.0]]), camera)
    found = tuned.recognise(fold, model.neutral())
    assert found.candidates
    assert found.candidates[0].probability > 0.4
    assert not found.accepted
    named = tuned.recognise(DrawnStroke(fold.pixels, camera), model.neutral(), feature="left cheek line")
    assert named.accepted
