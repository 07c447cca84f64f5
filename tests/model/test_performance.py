"""Poses frame by frame."""

import numpy as np
import pytest

from faceposer.model.face_model import FaceModel
from faceposer.model.performance import Performance


def test_weights_and_poses_are_the_same_motion(model: FaceModel) -> None:
    rng = np.random.default_rng(3)
    poses = rng.normal(size=(5, model.n_coefficients))
    performance = Performance(poses, 30.0)
    again = Performance.from_weights(model, performance.weights(model), 30.0)
    np.testing.assert_allclose(again.coefficients, poses, atol=1e-9)
    np.testing.assert_allclose(performance.weights(model)[3], model.weights_of(poses[3]))
    assert len(performance) == 5
    assert performance.seconds == pytest.approx(5 / 30)


@pytest.mark.parametrize(("shape", "rate"), [((0, 4), 30.0), ((4,), 30.0), ((2, 4), 0.0), ((2, 4), np.nan)])
def test_what_is_no_performance_is_refused(shape: tuple[int, ...], rate: float) -> None:
    with pytest.raises(ValueError, match="frames"):
        Performance(np.zeros(shape), rate)
