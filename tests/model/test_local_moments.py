"""The prior as it looks from a start: about the start, spread towards what is asked for, region by region."""

import itertools

import numpy as np
import pytest

from faceposer.model.face_model import FaceModel
from faceposer.model.mixture import GaussianMixture
from faceposer.solve.priors import prior_at


def asked(model: FaceModel, start: np.ndarray, **weights: float) -> tuple[np.ndarray, np.ndarray]:
    """Return rows and residuals at ``start`` of constraints that want the rig ``weights`` to within 0.05."""
    names = list(model.character.shape_names)
    rows = np.array([model.subspace.directions[names.index(name)] for name in weights]) / 0.05
    return rows, rows @ start - np.array(list(weights.values())) / 0.05


def spread(model: FaceModel, density: GaussianMixture, shape: str) -> float:
    direction = model.subspace.directions[model.character.shape_names.index(shape)]
    return float(direction @ density.covariances[0] @ direction)


def test_the_start_is_the_peak_whatever_is_asked_for(model: FaceModel) -> None:
    rng = np.random.default_rng(0)
    start = 0.3 * rng.normal(size=model.n_coefficients) * np.sqrt(model.subspace.variances)
    moments = prior_at(model, start)
    for rows, residual in (
        (np.zeros((0, len(start))), np.zeros(0)),
        asked(model, start, jawOpen=0.6, mouthSmileLeft=0.4),
    ):
        density = moments.near(rows, residual)
        np.testing.assert_allclose(density.energy_and_gradient(start)[1], 0.0, atol=1e-8)
        assert np.linalg.eigvalsh(density.precisions[0])[0] > 0.0
        np.testing.assert_allclose(density.covariances[0] @ density.precisions[0], np.eye(len(start)), atol=1e-6)


@pytest.mark.parametrize("wholeness", [0.0, 0.5, 1.0])
def test_where_nothing_is_asked_for_the_start_is_the_peak(model: FaceModel, wholeness: float) -> None:
    start = model.coefficients_of({"jawOpen": 0.4, "mouthSmileLeft": 0.5})
    rows, _ = asked(model, start, jawOpen=0.4)
    for residual in (np.zeros(0), np.zeros(len(rows))):
        density = prior_at(model, start, wholeness=wholeness).near(rows[: len(residual)], residual)
        np.testing.assert_allclose(density.means[0], start, atol=1e-12)


def test_wholeness_goes_over_to_the_examples_own_expressions(model: FaceModel) -> None:
    start = model.neutral()
    rows, residual = asked(model, start, mouthSmileLeft=0.7)

    def shift(wholeness: float) -> float:
        mean = prior_at(model, start, wholeness=wholeness).near(rows, residual).means[0]
        return float(np.linalg.norm(model.instance(mean) - model.character.vertices, axis=1).mean())

    shifts = [shift(wholeness) for wholeness in np.linspace(0.0, 1.0, 21)]
    assert shifts[0] == 0.0
    assert shifts == sorted(shifts)
    assert max(np.diff(shifts)) < 0.25 * shifts[-1], "it goes over without a step"
    whole, named = (
        moments.near(rows, residual)
        for moments in (prior_at(model, start, "whole"), prior_at(model, start, wholeness=1.0))
    )
    np.testing.assert_array_equal(whole.means, named.means)


def test_what_is_asked_for_says_where_to_go(model: FaceModel) -> None:
    start = model.neutral()
    moments = prior_at(model, start)
    everything = moments.near(np.zeros((0, len(start))), np.zeros(0))
    smiling = moments.near(*asked(model, start, mouthSmileLeft=0.7))
    still = moments.near(*asked(model, start, mouthSmileLeft=0.0))
    shape = "mouthSmileRight"
    assert spread(model, smiling, shape) > 2.0 * spread(model, everything, shape)
    assert spread(model, still, shape) < spread(model, everything, shape)


def test_it_follows_a_target_without_jumps(model: FaceModel) -> None:
    start = model.neutral()
    moments = prior_at(model, start)
    covariances = [
        moments.near(*asked(model, start, jawOpen=value)).covariances[0] for value in np.linspace(0.0, 0.8, 161)
    ]
    steps = np.array([np.linalg.norm(b - a) for a, b in itertools.pairwise(covariances)])
    assert steps.max() < 0.1 * np.linalg.norm(covariances[-1])


def test_regions_tell_of_each_other_only_as_far_as_they_must(model: FaceModel) -> None:
    names = list(model.character.shape_names)
    brow = model.subspace.directions[names.index("browOuterUpLeft")]
    mouth = model.subspace.directions[[i for i, name in enumerate(names) if name.startswith(("mouth", "jaw"))]]
    rows, residual = asked(model, model.neutral(), browOuterUpLeft=0.8)
    tied = []
    for prior in ("regions", "whole"):
        covariance = prior_at(model, model.neutral(), prior).near(rows, residual).covariances[0]
        spreads = np.sqrt(brow @ covariance @ brow * np.einsum("mr,rs,ms->m", mouth, covariance, mouth))
        tied.append(np.linalg.norm(mouth @ covariance @ brow / spreads))
    assert tied[0] < 0.6 * tied[1]


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


def test_what_is_asked_of_both_sides_alike_is_given_alike(model: FaceModel) -> None:
    density, start = model.rig_density, model.neutral()
    mirror = density.mirror
    assert mirror is not None
    names = [model.character.shape_names[row] for row in density.shape_rows]
    assert {names[i]: names[j] for i, j in enumerate(mirror)}["mouthSmileLeft"] == "mouthSmileRight"
    assert (mirror[mirror] == np.arange(len(mirror))).all()
    moments = density.conditioned_on(start)

    def gap(**weights: float) -> float:
        found = moments.near(*asked(model, start, **weights))
        sides = [spread(model, found, f"mouthSmile{side}") for side in ("Left", "Right")]
        return abs(sides[0] / sides[1] - 1.0)

    assert gap(mouthSmileLeft=0.6, mouthSmileRight=0.6) < 0.02
    assert gap(mouthSmileLeft=0.6, mouthSmileRight=0.1) > 0.1
    whole = density.conditioned_on(start, 1.0)
    assert not np.allclose(
        whole.near(*asked(model, start, mouthSmileLeft=0.6, mouthSmileRight=0.6)).precisions[0],
        moments.near(*asked(model, start, mouthSmileLeft=0.6, mouthSmileRight=0.6)).precisions[0],
    )


def test_moments_about_another_pose_are_as_if_conditioned_on_it(model: FaceModel) -> None:
    begin, end = (model.coefficients_of({"mouthSmileLeft": s, "jawOpen": j}) for s, j in ((0.8, 0.1), (0.2, 0.0)))
    rows = np.random.default_rng(2).normal(size=(4, model.n_coefficients))
    residual = np.array([3.0, -1.0, 0.5, 2.0])
    found, exact = (
        moments.near(rows, residual)
        for moments in (model.rig_density.conditioned_on(begin).about(end), model.rig_density.conditioned_on(end))
    )
    np.testing.assert_array_equal(found.means, exact.means)
    np.testing.assert_allclose(found.precisions, exact.precisions, rtol=1e-3, atol=1e-4 * exact.precisions.max())
