"""The prior as it looks from a start: about the start, spread towards what is asked for, region by region."""

import itertools

import numpy as np
import pytest

from faceposer.model.face_model import FaceModel
from faceposer.model.mixture import GaussianMixture
from faceposer.solve.priors import Prior, centred_at


def asked(model: FaceModel, start: np.ndarray, **weights: float) -> tuple[np.ndarray, np.ndarray]:
    """Return rows and residuals at ``start`` of constraints that want the rig ``weights`` to within 0.05."""
    names = list(model.subject.shape_names)
    rows = np.array([model.subspace.directions[names.index(name)] for name in weights]) / 0.05
    return rows, rows @ start - np.array(list(weights.values())) / 0.05


def spread(model: FaceModel, density: GaussianMixture, shape: str) -> float:
    direction = model.subspace.directions[model.subject.shape_names.index(shape)]
    return float(direction @ density.covariances[0] @ direction)


@pytest.mark.parametrize("prior", ["regions", "whole"])
def test_the_start_is_the_peak_whatever_is_asked_for(model: FaceModel, prior: Prior) -> None:
    rng = np.random.default_rng(0)
    start = 0.3 * rng.normal(size=model.n_coefficients) * np.sqrt(model.subspace.variances)
    moments = centred_at(model, start, prior)
    for rows, residual in (
        (np.zeros((0, len(start))), np.zeros(0)),
        asked(model, start, jawOpen=0.6, mouthSmileLeft=0.4),
    ):
        density = moments.near(rows, residual)
        np.testing.assert_allclose(density.energy_and_gradient(start)[1], 0.0, atol=1e-8)
        assert np.linalg.eigvalsh(density.precisions[0])[0] > 0.0
        np.testing.assert_allclose(density.covariances[0] @ density.precisions[0], np.eye(len(start)), atol=1e-6)


def test_what_is_asked_for_says_where_to_go(model: FaceModel) -> None:
    start = model.neutral()
    moments = centred_at(model, start)
    everything = moments.near(np.zeros((0, len(start))), np.zeros(0))
    smiling = moments.near(*asked(model, start, mouthSmileLeft=0.7))
    still = moments.near(*asked(model, start, mouthSmileLeft=0.0))
    shape = "mouthSmileRight"
    assert spread(model, smiling, shape) > 2.0 * spread(model, everything, shape)
    assert spread(model, still, shape) < spread(model, everything, shape)


def test_it_follows_a_target_without_jumps(model: FaceModel) -> None:
    start = model.neutral()
    moments = centred_at(model, start)
    covariances = [
        moments.near(*asked(model, start, jawOpen=value)).covariances[0] for value in np.linspace(0.0, 0.8, 161)
    ]
    steps = np.array([np.linalg.norm(b - a) for a, b in itertools.pairwise(covariances)])
    assert steps.max() < 0.1 * np.linalg.norm(covariances[-1])


def test_regions_tell_of_each_other_only_as_far_as_they_must(model: FaceModel) -> None:
    names = list(model.subject.shape_names)
    brow, mouth = (model.subspace.directions[names.index(name)] for name in ("browInnerUpLeft", "mouthFrownLeft"))
    rows, residual = asked(model, model.neutral(), browInnerUpLeft=0.8)
    tied = []
    for prior in ("regions", "whole"):
        covariance = centred_at(model, model.neutral(), prior).near(rows, residual).covariances[0]
        tied.append(abs(brow @ covariance @ mouth) / np.sqrt(brow @ covariance @ brow * (mouth @ covariance @ mouth)))
    assert tied[0] < 0.5 * tied[1]


def test_draws_are_of_the_mixture_and_within_the_limits(model: FaceModel) -> None:
    draws = model.rig_density.draws
    lower, upper = model.rig_density.limits.T
    assert ((draws >= lower) & (draws <= upper)).all()
    mixture = GaussianMixture(
        np.array([0.3, 0.7]), np.array([[-2.0, 0.0], [1.0, 3.0]]), np.array([np.eye(2), [[0.5, 0.2], [0.2, 0.4]]])
    )
    points = mixture.draws(20_000, np.random.default_rng(1))
    mean, covariance = mixture.moments()
    np.testing.assert_allclose(points.mean(axis=0), mean, atol=0.03)
    np.testing.assert_allclose(np.cov(points.T), covariance, atol=0.08)
