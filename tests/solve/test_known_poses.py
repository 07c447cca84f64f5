"""Constraints of every kind made from a known pose bring back what they speak of."""

from dataclasses import replace

import numpy as np
import pytest

from faceposer.geometry.camera import Camera, OrbitView
from faceposer.geometry.mirror import SurfaceMirror
from faceposer.geometry.picking import SurfacePoint, SurfacePoints
from faceposer.geometry.strokes import stroke_pixels
from faceposer.model.face_model import FaceModel
from faceposer.solve.constraints.curve import CurveConstraint
from faceposer.solve.constraints.distance import DistanceConstraint
from faceposer.solve.constraints.fixed import FixedConstraint
from faceposer.solve.constraints.gaze import GazeConstraint, gaze_direction
from faceposer.solve.constraints.point import PointConstraint
from faceposer.solve.constraints.stroke import StrokeConstraint, as_pixels
from faceposer.solve.map_solver import solve
from faceposer.solve.problem import PoseProblem

SMILE = {"mouthSmileLeft": 0.7, "mouthSmileRight": 0.6}


@pytest.fixture(params=["front", "three-quarter"])
def camera(request: pytest.FixtureRequest, model: FaceModel) -> Camera:
    lower, upper = model.character.vertices.min(axis=0), model.character.vertices.max(axis=0)
    return OrbitView.preset(lower, upper, request.param).camera((900, 800))


def feature(model: FaceModel, name: str, p: np.ndarray, camera: Camera) -> np.ndarray:
    vertex = model.character.feature_points[name]
    return camera.project(model.positions_at(SurfacePoints.at_vertices([vertex]), p))[0]


def moved(model: FaceModel, p: np.ndarray, regions: tuple[str, ...]) -> float:
    rest = model.character.vertices
    ids = np.concatenate([model.character.regions[name] for name in regions])
    return float(np.linalg.norm((model.instance(p) - rest)[ids], axis=1).mean())


@pytest.mark.parametrize("weights", [{"jawOpen": 0.5}, {"jawOpen": 0.15, "mouthSmileLeft": 0.4}])
def test_distances(model: FaceModel, camera: Camera, weights: dict[str, float]) -> None:
    features, truth = model.character.feature_points, model.coefficients_of(weights)
    constraints = []
    for first, second in (("2.2", "2.3"), ("8.3", "8.4"), ("2.1", "9.3")):
        pair = DistanceConstraint((features[first], features[second]), 0.0, camera)
        constraints.append(replace(pair, target=pair.measured(model, truth)))
    solution = solve(PoseProblem(model, constraints))
    assert max(solution.residuals_px) < 1.5
    mouth = DistanceConstraint((features["2.2"], features["2.3"]), 0.0, camera)
    neutral = mouth.measured(model, model.neutral())
    assert mouth.measured(model, solution.coefficients) > neutral + 0.7 * (mouth.measured(model, truth) - neutral)


def test_points_that_coincide_are_pulled_apart_without_a_crash(model: FaceModel, camera: Camera) -> None:
    vertex = model.character.feature_points["8.3"]
    solution = solve(PoseProblem(model, [DistanceConstraint((vertex, vertex), 10.0, camera)]))
    assert np.isfinite(solution.coefficients).all()


@pytest.mark.parametrize("energy", ["distance", "image"])
def test_strokes(model: FaceModel, camera: Camera, energy: str) -> None:
    truth = model.coefficients_of({"browInnerUp": 0.6, "browOuterUpLeft": 0.6})
    names = ("4.1", "4.3", "4.5")
    source = as_pixels([feature(model, name, model.neutral(), camera) for name in names])
    target = as_pixels([feature(model, name, truth, camera) for name in names])
    stroke = StrokeConstraint(source, target, 5.0, camera, energy=energy).resolved(model, model.neutral())
    before = stroke.residual_px(model, model.neutral())
    solution = solve(PoseProblem(model, [stroke]), model.neutral())
    assert solution.residuals_px[0] < (0.35 if energy == "distance" else 0.6) * before
    reached = [feature(model, name, solution.coefficients, camera)[1] for name in names]
    wanted = [feature(model, name, truth, camera)[1] for name in names]
    assert np.abs(np.subtract(reached, wanted)).mean() < (3.0 if energy == "distance" else 6.0)


@pytest.mark.parametrize("energy", ["distance", "image"])
def test_a_target_far_away_pulls_the_source_to_it(model: FaceModel, camera: Camera, energy: str) -> None:
    corner = feature(model, "8.3", model.neutral(), camera)
    source = as_pixels(corner + [[-12.0, 0.0], [0.0, 0.0]])
    stroke = StrokeConstraint(source, as_pixels(np.array(source) + (40.0, -90.0)), 4.0, camera, energy=energy)
    stroke = stroke.resolved(model, model.neutral())
    solution = solve(PoseProblem(model, [stroke]), model.neutral())
    shift = feature(model, "8.3", solution.coefficients, camera) - corner
    assert shift @ (40.0, -90.0) / np.hypot(40.0, 90.0) > 8.0


def test_the_image_of_a_source_that_a_line_search_throws_far_away_stays_small(model: FaceModel, camera: Camera) -> None:
    way = as_pixels([feature(model, name, model.neutral(), camera) for name in ("4.1", "4.3", "4.5")])
    stroke = StrokeConstraint(way, way, 5.0, camera, energy="image").resolved(model, model.neutral())
    energy, gradient = PoseProblem(model, [stroke]).energy_and_gradient(np.full(model.n_coefficients, 1e6))
    assert np.isfinite(energy)
    assert np.isfinite(gradient).all()


def test_a_stroke_drawn_where_it_is_changes_nothing(model: FaceModel, camera: Camera) -> None:
    way = as_pixels([feature(model, name, model.neutral(), camera) for name in ("4.1", "4.3", "4.5")])
    stroke = StrokeConstraint(way, way, 6.0, camera).resolved(model, model.neutral())
    solution = solve(PoseProblem(model, [stroke]), model.neutral())
    offsets = camera.project(model.instance(solution.coefficients)) - camera.project(model.character.vertices)
    assert np.abs(offsets).max() < 1.0


def test_curves(model: FaceModel, camera: Camera) -> None:
    truth = model.coefficients_of(SMILE)
    names = ("8.4", "8.9", "8.1", "8.10", "8.3")
    source, target = (as_pixels([feature(model, name, p, camera) for name in names]) for p in (model.neutral(), truth))
    curve = CurveConstraint(source, source, camera).resolved(model, model.neutral())
    assert curve.residual_px(model, model.neutral()) < 0.1
    rest = solve(PoseProblem(model, [curve]), model.neutral())
    np.testing.assert_allclose(model.instance(rest.coefficients), model.character.vertices, atol=0.02)
    solution = solve(PoseProblem(model, [replace(curve, target=target)]), model.neutral())
    assert solution.residuals_px[0] < 3.0
    for name in ("8.3", "8.4"):
        reached = feature(model, name, solution.coefficients, camera)
        assert np.hypot(*(reached - feature(model, name, truth, camera))) < 4.0


def test_fixed_points_trade_against_others_by_their_weight(model: FaceModel, camera: Camera) -> None:
    corner = feature(model, "8.3", model.neutral(), camera)
    pull = PointConstraint(model.character.feature_points["2.1"], (float(corner[0]), 0.0), camera)
    chin = feature(model, "2.1", model.neutral(), camera)
    pull = replace(pull, target=(float(chin[0]), float(chin[1]) + 30.0))
    points = SurfacePoints.at_vertices(model.character.regions["mouth"][::3])
    motions = []
    for weight in (0.0, 0.1, 1.0, 100.0):
        hold = FixedConstraint(points, weight=weight).resolved(model, model.neutral())
        solution = solve(PoseProblem(model, [pull, hold]), model.neutral())
        motions.append(moved(model, solution.coefficients, ("mouth",)))
    assert motions == sorted(motions, reverse=True)
    assert motions[0] > 0.2
    assert motions[-1] < 0.02


def test_fixed_points_stay_where_they_were_when_they_were_fixed(model: FaceModel, camera: Camera) -> None:
    posed = model.coefficients_of({"jawOpen": 0.5})
    points = SurfacePoints.at_vertices(model.character.regions["mouth"][::3])
    hold = FixedConstraint(points, weight=10.0).resolved(model, posed)
    solution = solve(PoseProblem(model, [hold]), model.neutral())
    off = np.linalg.norm(model.positions_at(points, solution.coefficients) - model.positions_at(points, posed), axis=1)
    assert off.mean() < 0.1


def test_eyes_look_where_they_should_and_the_rest_stays(model: FaceModel) -> None:
    for direction in ((20.0, 10.0), (-25.0, -15.0)):
        solution = solve(PoseProblem(model, [GazeConstraint(direction)]), model.neutral())
        assert gaze_direction(model, solution.coefficients) == pytest.approx(direction, abs=0.5)
        assert moved(model, solution.coefficients, ("mouth", "brow_left", "brow_right", "nose")) < 0.01
        assert moved(model, solution.coefficients, ("eye_left",)) > 0.1
    down = solve(PoseProblem(model, [GazeConstraint((0.0, -20.0))]), model.neutral()).coefficients
    assert moved(model, down, ("lids_left",)) > 0.02


def test_gaze_does_not_change_what_other_constraints_do(model: FaceModel, camera: Camera) -> None:
    corner = feature(model, "8.3", model.neutral(), camera)
    pull = PointConstraint(
        model.character.feature_points["8.3"], (float(corner[0]) + 12, float(corner[1]) - 14), camera
    )
    alone = solve(PoseProblem(model, [pull]), model.neutral()).coefficients
    both = solve(PoseProblem(model, [pull, GazeConstraint((20.0, 0.0))]), model.neutral()).coefficients
    ids = np.concatenate([model.character.regions[name] for name in ("mouth", "jaw", "brow_left")])
    np.testing.assert_allclose(model.instance(both)[ids], model.instance(alone)[ids], atol=0.03)


def test_mirrored_constraints_do_the_same_across(model: FaceModel, camera: Camera) -> None:
    mirror = SurfaceMirror(model.character.vertices, model.triangles, 0.05)
    corner = feature(model, "8.3", model.neutral(), camera)
    u, v = corner.tolist()
    brow = as_pixels([feature(model, name, model.neutral(), camera) for name in ("4.1", "4.3", "4.5")])
    raised = as_pixels(np.array(brow) + (0.0, -8.0))
    features = model.character.feature_points
    drawn = [
        PointConstraint(features["8.3"], (u + 10.0, v - 10.0), camera),
        StrokeConstraint(brow, raised, 5.0, camera).resolved(model, model.neutral()),
        CurveConstraint(brow, raised, camera).resolved(model, model.neutral()),
        DistanceConstraint((features["3.1"], features["3.3"]), 2.0, camera),
    ]
    for constraint in drawn:
        across = constraint.mirrored(mirror, model, model.neutral())
        assert across is not None
        p = solve(PoseProblem(model, [constraint, across]), model.neutral()).coefficients
        vertices = model.instance(p)
        np.testing.assert_allclose(vertices[mirror.vertices] * (-1, 1, 1), vertices, atol=0.03)
    hold = FixedConstraint(SurfacePoints.at_vertices([features["8.3"]])).resolved(model, model.neutral())
    across = hold.mirrored(mirror, model, model.neutral())
    assert across is not None
    assert across.points[0] == features["8.4"]


def test_mirrored_constraints_keep_what_is_uneven(model: FaceModel, camera: Camera) -> None:
    mirror = SurfaceMirror(model.character.vertices, model.triangles, 0.05)
    uneven = model.coefficients_of({"mouthSmileRight": 0.5})
    u, v = feature(model, "8.3", uneven, camera).tolist()
    constraint = PointConstraint(model.character.feature_points["8.3"], (u, v), camera)
    across = constraint.mirrored(mirror, model, uneven)
    assert across is not None
    assert across.residual_px(model, uneven) < 1e-6


def test_pixels_are_found_on_the_face_as_single_rays_find_them(model: FaceModel, camera: Camera) -> None:
    from faceposer.geometry.picking import pick

    p = model.coefficients_of({"jawOpen": 0.4})
    pixels = stroke_pixels([(330.0, 300.0), (460.0, 420.0), (500.0, 60.0)], 3.0)[::9]
    points, met = model.pick(p, camera, pixels)
    vertices, solid = model.instance(p), model.character.solid_triangles
    brute = [pick(vertices, model.triangles[solid], camera, pixel) for pixel in pixels]
    assert [hit is not None for hit in brute] == met.tolist()
    found = points.positions(vertices, model.triangles)
    hits = SurfacePoints.of([SurfacePoint(int(solid[hit.face]), hit.barycentric) for hit in brute if hit is not None])
    np.testing.assert_allclose(found, hits.positions(vertices, model.triangles), atol=1e-3)
