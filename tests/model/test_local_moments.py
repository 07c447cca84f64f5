"""The regional prior: its derivative, its one minimum, and a brow that leaves the mouth alone."""

import numpy as np
import pytest
from scipy.optimize import approx_fprime

from faceposer.model.face_model import FaceModel
from faceposer.solve.priors import Prior, centred_at


@pytest.mark.parametrize("prior", ["regions", "whole"])
def test_gradient_and_the_only_minimum(model: FaceModel, prior: Prior) -> None:
    rng = np.random.default_rng(0)
    start = 0.3 * rng.normal(size=model.n_coefficients) * np.sqrt(model.subspace.variances)
    density = centred_at(model, start, prior)
    for _ in range(5):
        step = rng.normal(size=len(start)) * np.sqrt(model.subspace.variances)
        gradient = density.energy_and_gradient(start + step)[1]
        numeric = approx_fprime(start + step, lambda p: density.energy_and_gradient(p)[0], 1e-8)
        np.testing.assert_allclose(gradient, numeric, atol=1e-3 * np.abs(gradient).max())
        assert gradient @ step > 0.0, "the energy rises from the start outwards"
        assert np.linalg.eigvalsh(density.curvature(start + step))[0] > 0.0
    np.testing.assert_allclose(density.energy_and_gradient(start)[1], 0.0, atol=1e-8)
    moved = density.moved_by(np.full_like(start, 0.1))
    assert moved.energy_and_gradient(start + 0.1 + step)[0] == pytest.approx(
        density.energy_and_gradient(start + step)[0]
    )
