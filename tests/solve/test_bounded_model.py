"""Gauss-Newton with bounds: the least value of a model, few evaluations, and one result from wherever it starts."""

import numpy as np
import pytest

from faceposer.geometry.camera import Camera, OrbitView
from faceposer.model.face_model import FaceModel
from faceposer.solve import problem as problems
from faceposer.solve import reach
from faceposer.solve.bounded_model import BoundedModel
from faceposer.solve.constraints.point import PointConstraint
from faceposer.solve.constraints.registry import Constraint
from faceposer.solve.constraints.stroke import StrokeConstraint
from faceposer.solve.definite import robust_cholesky, solve_definite, solve_triangular
from faceposer.solve.map_solver import solve
from faceposer.solve.problem import PoseProblem, Ridge


@pytest.fixture(scope="module")
def camera(model: FaceModel) -> Camera:
    return OrbitView.preset(model.character.vertices.min(axis=0), model.character.vertices.max(axis=0)).camera(
        (800, 800)
    )


def pixel(model: FaceModel, camera: Camera, place: str) -> np.ndarray:
    return camera.project(model.character.vertices[[model.character.feature_points[place]]].astype(np.float64))[0]


def pulls(model: FaceModel, camera: Camera, count: int, far: float, seed: int) -> list[Constraint]:
    """Points that are pulled about ``far`` pixels each its own way, beyond what weights within limits can do."""
    rng = np.random.default_rng(seed)
    constraints: list[Constraint] = []
    for place in rng.choice(sorted(model.character.feature_points), count, replace=False):
        u, v = (pixel(model, camera, str(place)) + far * rng.normal(size=2)).tolist()
        constraints.append(PointConstraint(int(model.character.feature_points[str(place)]), (u, v), camera))
    return constraints


def drawn_stroke(model: FaceModel, camera: Camera, offset: tuple[float, float]) -> StrokeConstraint:
    share = np.linspace(0.0, 1.0, 24)[:, None]
    way = (1.0 - share) * pixel(model, camera, "8.3") + share * pixel(model, camera, "8.4")
    source, target = (tuple((u, v) for u, v in each.tolist()) for each in (way, way + offset))
    return StrokeConstraint(source, target, 8.0, camera).resolved(model, model.neutral())


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_the_step_leads_to_where_the_model_is_least(model: FaceModel, camera: Camera, seed: int) -> None:
    problem = PoseProblem(model, pulls(model, camera, 8, 60.0, seed), prior_weight=0.1, spread=1.0)
    state = problem.state(problem.start)
    _, gradient = problem.energy_and_gradient_at(state)
    step, promised = BoundedModel(problem, state, gradient).minimise()
    curvature = problem.curvature_at(state, bounded=False)
    at_start = sum(np.asarray(bound.evaluate(state.p)[1]) for bound in problem.bounds)

    def value(d: np.ndarray) -> float:
        held = sum(bound.evaluate(state.p + d)[0] - bound.evaluate(state.p)[0] for bound in problem.bounds)
        return float(d @ (gradient - at_start) + 0.5 * d @ curvature @ d) + held

    assert any(bound.evaluate(state.p + step)[2].any() for bound in problem.bounds), "bounds are met"
    assert value(step) == pytest.approx(-promised)
    assert promised > 0.0
    rng = np.random.default_rng(seed)
    for size in (1e-3, 1e-1, 1.0):
        for _ in range(20):
            aside = size * rng.normal(size=len(step)) * np.sqrt(model.subspace.variances)
            assert value(step + aside) > value(step) - 1e-9 * promised


@pytest.mark.parametrize(("weight", "spread"), [(0.0, 0.5), (0.1, 0.0), (0.1, 1.0), (1.0, 0.5)])
def test_far_pulls_take_few_evaluations_from_everywhere(
    model: FaceModel, camera: Camera, weight: float, spread: float
) -> None:
    for seed, (count, far) in enumerate(((1, 80.0), (2, 200.0), (8, 60.0), (20, 40.0))):
        problem = PoseProblem(model, pulls(model, camera, count, far, seed), prior_weight=weight, spread=spread)
        elsewhere = 0.5 * np.random.default_rng(seed).normal(size=model.n_coefficients)
        elsewhere *= np.sqrt(model.subspace.variances)
        found = [solve(problem, start) for start in (None, model.neutral(), elsewhere)]
        assert all(solution.converged for solution in found)
        assert max(solution.evaluations for solution in found) <= 12
        weights = [model.weights_of(solution.coefficients) for solution in found]
        np.testing.assert_allclose(weights[1], weights[0], atol=5e-3)
        np.testing.assert_allclose(weights[2], weights[0], atol=5e-3)


@pytest.mark.parametrize("weight", [0.0, 0.1, 1.0])
def test_strokes_far_away_converge(model: FaceModel, camera: Camera, weight: float) -> None:
    for offset in ((6.0, -8.0), (40.0, -60.0), (150.0, -200.0), (0.0, 250.0)):
        solution = solve(PoseProblem(model, [drawn_stroke(model, camera, offset)], prior_weight=weight))
        assert solution.converged
        assert solution.iterations <= 35


def test_many_constraints_of_all_kinds_converge_at_low_weights(model: FaceModel, camera: Camera) -> None:
    constraints = [*pulls(model, camera, 25, 12.0, 0), drawn_stroke(model, camera, (8.0, 10.0))]
    for weight in (0.0, 0.1, 1.0):
        solution = solve(PoseProblem(model, constraints, prior_weight=weight))
        assert solution.converged
        assert solution.iterations <= 35


def test_what_was_solved_before_makes_no_difference(model: FaceModel, camera: Camera) -> None:
    constraints = pulls(model, camera, 4, 10.0, 5)
    first = solve(PoseProblem(model, constraints)).coefficients
    solve(PoseProblem(model, pulls(model, camera, 3, 30.0, 6), 0.2 * first))
    again = solve(PoseProblem(model, constraints)).coefficients
    for remembered in (problems._gathered, problems._state_at, problems._limits_at, reach._reach_of_points):
        remembered.cache_clear()
    fresh = solve(PoseProblem(model, constraints)).coefficients
    np.testing.assert_array_equal(again, first)
    np.testing.assert_array_equal(fresh, first)


def test_a_term_that_is_added_counts(model: FaceModel, camera: Camera) -> None:
    problem = PoseProblem(model, pulls(model, camera, 2, 10.0, 0))
    before = problem.energy_and_gradient(problem.start)[0]
    aside = np.ones(model.n_coefficients)
    problem.add(Ridge(problem.start + aside, aside))
    assert problem.energy_and_gradient(problem.start)[0] == pytest.approx(before + model.n_coefficients)


def test_definite_matrices_are_solved_even_where_rounding_has_made_them_none() -> None:
    rng = np.random.default_rng(0)
    rows = rng.normal(size=(40, 12))
    matrix, right = rows.T @ rows, rng.normal(size=12)
    lower = robust_cholesky(matrix)
    np.testing.assert_allclose(lower @ lower.T, matrix)
    np.testing.assert_allclose(lower @ solve_triangular(lower, right), right)
    np.testing.assert_allclose(lower.T @ solve_triangular(lower, right, transposed=True), right)
    np.testing.assert_allclose(matrix @ solve_definite(matrix, right), right)
    thin = 1e8 * np.outer(right, right) - 1e-9 * np.eye(12)
    root = robust_cholesky(thin)
    assert np.isfinite(root).all()
    np.testing.assert_allclose(root @ root.T, thin, atol=1e-3 * np.abs(thin).max())
