"""Smooth deformations of a head."""

import numpy as np
import pytest
from numpy.typing import NDArray

from faceposer.identity.scans import smooth_modes as module
from faceposer.identity.scans.smooth_modes import smooth_modes

_FLIP = np.array([-1.0, 1.0, 1.0])


@pytest.fixture(scope="module")
def places() -> NDArray[np.float64]:
    """Return places on an ellipsoid as large as a head, each with its mirror image."""
    rng = np.random.default_rng(0)
    half = rng.normal(size=(400, 3))
    half = half / np.linalg.norm(half, axis=1, keepdims=True) * [7.0, 10.0, 8.0]
    half[:, 0] = np.abs(half[:, 0])
    return np.concatenate([half, half * _FLIP])


def test_modes_have_the_covariance_of_the_process(places: NDArray[np.float64], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "_ASYMMETRIC", 1.0)
    monkeypatch.setattr(module, "_N_FUNCTIONS", 250)
    modes = smooth_modes(places, np.arange(len(places)))
    some = np.array([0, 5, 17, 405])
    found = np.einsum("kid,kje->ijde", modes[:, some], modes[:, some])
    expected = module._covariance(places[some], places[some])
    for axis in range(3):
        np.testing.assert_allclose(found[..., axis, axis], expected, atol=0.02 * expected.max())
    np.testing.assert_allclose(found[..., 0, 1], 0.0, atol=1e-12)


def test_each_mode_moves_both_sides_alike_or_opposite(places: NDArray[np.float64]) -> None:
    modes = smooth_modes(places, np.arange(len(places)))
    mirrored = np.roll(modes, 400, axis=1) * _FLIP
    same = np.abs(modes - mirrored).max(axis=(1, 2)) < 1e-6
    opposite = np.abs(modes + mirrored).max(axis=(1, 2)) < 1e-6
    assert (same | opposite).all()
    sizes = np.linalg.norm(modes, axis=(1, 2))
    assert (np.diff(sizes) <= 1e-9).all()
    assert np.square(sizes[opposite]).sum() < 0.1 * np.square(sizes[same]).sum()
