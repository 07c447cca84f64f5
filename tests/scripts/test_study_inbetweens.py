"""The study of in-betweens measures what it says; it is run whole by hand."""

from dataclasses import replace

import numpy as np
import pytest

from faceposer.model.face_model import FaceModel
from scripts import study_inbetweens
from scripts.study_animation import Study
from scripts.study_inbetweens import METHODS, key_animation, linear, measures
from tests.evaluation.performances import weights
from tests.scripts.test_study_animation import rig
from tests.scripts.test_study_animation import study as study  # noqa: PLC0414


@pytest.fixture
def truth(study: Study) -> np.ndarray:
    return rig(study.model, weights(41, 0)) @ study.model.subspace.projection.T


def test_all_methods_are_exact_where_the_truth_is(study: Study, truth: np.ndarray) -> None:
    # Linear interpolation is exact where all frames without a key lie on a line between their neighbours.
    straight = truth.copy()
    straight[1::2][: len(straight) // 2] = 0.5 * (straight[:-2:2] + straight[2::2])
    found = measures(study, linear, straight, 2)
    assert found["error"] < 1e-4
    assert found["beyond"] == pytest.approx(0.0, abs=1e-9)
    for name, method in METHODS.items():
        row = measures(study, method, truth, 10)
        assert np.isfinite(list(row.values())).all()
        assert row["error"] > 0.0
        at_keys = method(study.model, key_animation(truth, 10), np.arange(0.0, 41.0, 10.0))
        exact = np.abs(at_keys - truth[::10]).max() < 1e-9
        assert exact == ("not restored" not in name), name


def test_the_setting_named_chosen_is_that_of_the_program(model: FaceModel, truth: np.ndarray) -> None:
    _, *setting = next(study_inbetweens.settings())
    keyframes, times = key_animation(truth, 10), np.linspace(0.0, 40.0, 30)
    found = study_inbetweens._spline_method(model, *setting)(model, keyframes, times)
    expected = replace(keyframes, inbetweens="feature points").sampled(model, times)
    np.testing.assert_allclose(found, expected, atol=1e-9)
