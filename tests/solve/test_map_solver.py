"""Solving recovers known poses, starts where it should, and can be watched and stopped."""

import numpy as np
import pytest

from faceposer.geometry.camera import Camera, OrbitView
from faceposer.geometry.picking import SurfacePoint, surface_positions
from faceposer.model.face_model import FaceModel
from faceposer.solve.constraints.point import PointConstraint
from faceposer.solve.map_solver import best_start, solve
from faceposer.solve.problem import PoseProblem
from faceposer.solve.weight_fit import fit_weights

SIZE = (800, 800)


@pytest.fixture
def camera(model: FaceModel) -> Camera:
    return OrbitView.preset(model.character.vertices.min(axis=0), model.character.vertices.max(axis=0)).camera(SIZE)


def corner(model: FaceModel) -> SurfacePoint:
    return SurfacePoint.at_vertex(model.triangles, model.character.feature_points["8.3"])


def pixels(model: FaceModel, p: np.ndarray, camera: Camera, points: list[SurfacePoint]) -> np.ndarray:
    return camera.project(surface_positions(model.instance(p), model.triangles, points))


def points_made_from(
    model: FaceModel, p: np.ndarray, camera: Camera, count: int, seed: int = 0
) -> list[PointConstraint]:
    faces = np.random.default_rng(seed).integers(0, len(model.triangles), count)
    anchors = [SurfacePoint(int(face), (0.4, 0.3, 0.3)) for face in faces]
    targets = pixels(model, p, camera, anchors)
    return [PointConstraint(a, (float(t[0]), float(t[1])), camera) for a, t in zip(anchors, targets, strict=True)]


def test_constraints_made_from_a_pose_are_met_again(model: FaceModel, camera: Camera) -> None:
    truth = model.coefficients_of({"mouthSmileLeft": 0.7, "mouthSmileRight": 0.6, "browInnerUp": 0.5, "jawOpen": 0.2})
    constraints = points_made_from(model, truth, camera, 60)
    solution = solve(PoseProblem(model, constraints))
    assert max(solution.residuals_px) < 3.5
    error = np.linalg.norm(model.instance(solution.coefficients) - model.instance(truth), axis=1).mean()
    assert error < 0.42 * np.linalg.norm(model.instance(truth) - model.character.vertices, axis=1).mean()


def test_without_a_prior_enough_points_give_the_pose_back(model: FaceModel, camera: Camera) -> None:
    truth = model.coefficients_of({"jawOpen": 0.6, "mouthFunnel": 0.4})
    side = OrbitView.preset(
        model.character.vertices.min(axis=0), model.character.vertices.max(axis=0), "three-quarter"
    ).camera(SIZE)
    constraints = points_made_from(model, truth, camera, 300) + points_made_from(model, truth, side, 300, seed=1)
    solution = solve(PoseProblem(model, constraints, bare=True))
    np.testing.assert_allclose(model.instance(solution.coefficients), model.instance(truth), atol=0.02)


@pytest.mark.parametrize("prior_weight", [0.0, 1.0, 50.0])
def test_a_point_placed_where_it_is_changes_nothing(model: FaceModel, camera: Camera, prior_weight: float) -> None:
    constraints = points_made_from(model, model.neutral(), camera, 3)
    for x0 in (None, model.neutral()):
        solution = solve(PoseProblem(model, constraints, prior_weight=prior_weight), x0)
        np.testing.assert_allclose(model.instance(solution.coefficients), model.character.vertices, atol=1e-3)


def test_the_first_pixel_of_a_drag_moves_the_face_by_about_a_pixel(model: FaceModel, camera: Camera) -> None:
    anchor = corner(model)
    begun = pixels(model, model.neutral(), camera, [anchor])[0]
    target = begun + (0.8, -0.6)
    problem = PoseProblem(model, [PointConstraint(anchor, (float(target[0]), float(target[1])), camera)])
    solution = solve(problem, model.neutral())
    moved = pixels(model, solution.coefficients, camera, [anchor])[0] - begun
    assert 0.3 < moved @ (0.8, -0.6) <= 1.05
    everything = np.linalg.norm(
        camera.project(model.instance(solution.coefficients)) - camera.project(model.character.vertices), axis=1
    )
    assert everything.max() < 3.0


def test_a_long_drag_is_followed_without_a_jump(model: FaceModel, camera: Camera) -> None:
    anchor = corner(model)
    begun = pixels(model, model.neutral(), camera, [anchor])[0]
    p, previous = model.neutral(), model.character.vertices
    for step in np.linspace(0, 1, 41)[1:]:
        target = begun + step * np.array([22.0, -22.0])
        problem = PoseProblem(model, [PointConstraint(anchor, (float(target[0]), float(target[1])), camera)])
        p = solve(problem, p).coefficients
        vertices = model.instance(p)
        moved = np.linalg.norm(camera.project(vertices) - camera.project(previous), axis=1)
        assert moved.max() < 8.0, "a pixel of the pointer must not throw the face about"
        previous = vertices
    reached = pixels(model, p, camera, [anchor])[0]
    assert np.linalg.norm(reached - (begun + (22.0, -22.0))) < 6.0


def test_prior_weight_trades_naturalness_for_obedience(model: FaceModel, camera: Camera) -> None:
    anchor = corner(model)
    begun = pixels(model, model.neutral(), camera, [anchor])[0]
    constraint = PointConstraint(anchor, (float(begun[0] + 15), float(begun[1] - 15)), camera)
    residuals = [
        solve(PoseProblem(model, [constraint], prior_weight=weight)).residuals_px[0] for weight in (0.0, 0.1, 1.0, 10.0)
    ]
    assert residuals[0] < 1.0
    assert residuals == sorted(residuals)


def test_disabled_constraints_do_not_pull_but_are_measured(model: FaceModel, camera: Camera) -> None:
    begun = pixels(model, model.neutral(), camera, [corner(model)])[0]
    constraint = PointConstraint(corner(model), (float(begun[0] + 30), float(begun[1])), camera, enabled=False)
    solution = solve(PoseProblem(model, [constraint]))
    assert solution.residuals_px[0] == pytest.approx(30, abs=0.1)


def test_constraints_keep_their_own_cameras(model: FaceModel, camera: Camera) -> None:
    truth = model.coefficients_of({"jawOpen": 0.5})
    lower, upper = model.character.vertices.min(axis=0), model.character.vertices.max(axis=0)
    side = OrbitView.preset(lower, upper, "left").camera((500, 700))
    anchors = [SurfacePoint.at_vertex(model.triangles, model.character.feature_points[name]) for name in ("2.1", "8.3")]
    constraints = [
        PointConstraint(anchor, tuple(pixels(model, truth, view, [anchor])[0].tolist()), view)
        for anchor, view in zip(anchors, (camera, side), strict=True)
    ]
    assert max(solve(PoseProblem(model, constraints)).residuals_px) < 4.0


def test_best_start_is_the_candidate_of_least_energy(model: FaceModel, camera: Camera) -> None:
    constraints = points_made_from(model, model.mixture.means[3], camera, 40)
    for mixture in (None, model.mixture):
        problem = PoseProblem(model, constraints, mixture=mixture)
        candidates = problem.conditional_means()
        assert candidates.shape == (problem.mixture.n_components, model.n_coefficients)
        chosen, compared = best_start(problem)
        assert compared == len(candidates) + 1
        energy = problem.energy_and_gradient(chosen)[0]
        assert energy <= min(problem.energy_and_gradient(candidate)[0] for candidate in candidates)
        assert energy < problem.energy_and_gradient(model.neutral())[0]


def test_the_mixture_as_learned_pulls_a_face_that_nobody_touches(model: FaceModel, camera: Camera) -> None:
    assert PoseProblem(model, []).at_rest
    problem = PoseProblem(model, [], prior="plain")
    assert problem.mixture is model.mixture
    found = solve(problem)
    assert found.energy < problem.energy_and_gradient(model.neutral())[0] - 1.0
    assert np.linalg.norm(model.instance(found.coefficients) - model.character.vertices, axis=1).max() > 0.05


def test_conditional_means_answer_the_linearised_problem(model: FaceModel, camera: Camera) -> None:
    constraints = points_made_from(model, model.coefficients_of({"jawOpen": 0.05}), camera, 20)
    gaussian = model.mixture.as_gaussian()
    problem = PoseProblem(model, constraints, mixture=gaussian, start=gaussian.means[0])
    solution = solve(problem, gaussian.means[0])
    np.testing.assert_allclose(
        model.instance(problem.conditional_means()[0]), model.instance(solution.coefficients), atol=0.02
    )


def test_iterates_are_shown_and_a_solve_can_be_stopped(model: FaceModel, camera: Camera) -> None:
    truth = model.coefficients_of({"jawOpen": 0.9, "mouthSmileLeft": 0.9})
    problem = PoseProblem(model, points_made_from(model, truth, camera, 30))
    seen: list[np.ndarray] = []
    full = solve(problem, model.neutral(), on_iterate=lambda p: seen.append(p.copy()))
    assert len(seen) == full.iterations > 1
    assert full.converged
    stopped = solve(problem, model.neutral(), should_stop=lambda: True)
    assert stopped.iterations == 1
    assert not stopped.converged
    assert full.energy < stopped.energy < problem.energy_and_gradient(model.neutral())[0]


def test_scaled_coordinates_need_few_evaluations(model: FaceModel, camera: Camera) -> None:
    truth = model.coefficients_of({"jawOpen": 0.3, "mouthSmileLeft": 0.5})
    solution = solve(PoseProblem(model, points_made_from(model, truth, camera, 8)), model.neutral())
    assert solution.evaluations <= 40


def test_fitted_weights_are_those_that_made_the_pose(model: FaceModel) -> None:
    weights = {"jawOpen": 0.6, "mouthSmileLeft": 0.8, "browOuterUpLeft": 0.4}
    fitted = fit_weights(model, model.coefficients_of(weights))
    assert set(fitted) == set(model.character.shape_names)
    assert all(0.0 <= value <= 1.0 for value in fitted.values())
    for name, value in weights.items():
        assert fitted[name] == pytest.approx(value, abs=0.1)


def test_a_view_from_very_near_is_solved_too(model: FaceModel) -> None:
    vertices = model.character.vertices
    view = OrbitView.preset(vertices.min(axis=0), vertices.max(axis=0))
    camera = view.zoomed(1e9).camera((4000, 4000))
    constraints = points_made_from(model, model.coefficients_of({"jawOpen": 0.3}), camera, 20)
    solution = solve(PoseProblem(model, constraints), model.neutral())
    assert np.isfinite(solution.coefficients).all()
    assert np.isfinite(solution.energy)
