"""Every term against finite differences, over random poses, cameras and all kinds of constraints."""

import json
from collections.abc import Callable

import numpy as np
import pytest

from faceposer.errors import FacePoserError
from faceposer.geometry.camera import Camera, OrbitView
from faceposer.geometry.curves import curve_at, relaxed_bezier
from faceposer.geometry.picking import SurfacePoint, SurfacePoints
from faceposer.model.face_model import FaceModel
from faceposer.model.feature_curves import FEATURES
from faceposer.solve.constraints.curve import CurveConstraint
from faceposer.solve.constraints.distance import DistanceConstraint
from faceposer.solve.constraints.fixed import FixedConstraint
from faceposer.solve.constraints.gaze import GazeConstraint
from faceposer.solve.constraints.point import PointConstraint
from faceposer.solve.constraints.registry import CONSTRAINTS, constraint_from_json
from faceposer.solve.constraints.sketch import SketchConstraint
from faceposer.solve.constraints.stroke import StrokeConstraint, as_pixels
from faceposer.solve.constraints.stroke_terms import StrokeDistanceTerm, StrokeImageTerm
from faceposer.solve.problem import PoseProblem
from faceposer.solve.term import ResidualTerm, Term


def random_pose(model: FaceModel, rng: np.random.Generator) -> np.ndarray:
    return rng.normal(size=model.n_coefficients) * np.sqrt(model.subspace.variances)


def random_point(model: FaceModel, rng: np.random.Generator) -> PointConstraint:
    lower, upper = model.character.vertices.min(axis=0), model.character.vertices.max(axis=0)
    view = OrbitView.preset(lower, upper).orbited(*rng.uniform(-150, 150, 2), (800, 800))
    weights = rng.dirichlet(np.ones(3))
    anchor = SurfacePoint(int(rng.integers(len(model.triangles))), tuple(weights.tolist()))
    camera = view.camera((800, 800))
    return PointConstraint(anchor, tuple(rng.uniform(100, 700, 2)), camera, weight=rng.uniform(0.5, 2))


def random_points(model: FaceModel, rng: np.random.Generator, count: int) -> SurfacePoints:
    return SurfacePoints(rng.integers(0, len(model.triangles), count), rng.dirichlet(np.ones(3), count))


def random_distance(model: FaceModel, rng: np.random.Generator) -> DistanceConstraint:
    first, second = random_point(model, rng), random_point(model, rng)
    return DistanceConstraint((first.anchor, second.anchor), rng.uniform(1, 200), first.camera, weight=1.5)


def random_stroke(model: FaceModel, rng: np.random.Generator) -> StrokeConstraint:
    camera = random_point(model, rng).camera
    target = as_pixels(rng.uniform(300, 500, 2) + np.cumsum(rng.uniform(-4, 10, (8, 2)), axis=0))
    return StrokeConstraint(random_points(model, rng, 150), target, 5.0, camera, weight=rng.uniform(0.5, 2))


def random_curve(model: FaceModel, rng: np.random.Generator) -> CurveConstraint:
    camera = random_point(model, rng).camera
    source, target = (as_pixels(rng.uniform(100, 700, (4, 2))) for _ in range(2))
    parameters = tuple(np.sort(rng.uniform(0, 3, 20)).tolist())
    return CurveConstraint(source, target, camera, random_points(model, rng, 20), parameters, weight=0.7)


def random_fixed(model: FaceModel, rng: np.random.Generator) -> FixedConstraint:
    points = SurfacePoints.at_vertices(rng.choice(len(model.character.vertices), 40, replace=False))
    return FixedConstraint(points, model.positions_at(points, random_pose(model, rng)), weight=rng.uniform(0.5, 2))


def random_gaze(model: FaceModel, rng: np.random.Generator) -> GazeConstraint:
    yaw, pitch = rng.uniform(-20, 20, 2).tolist()
    return GazeConstraint((yaw, pitch))


def random_sketch(model: FaceModel, rng: np.random.Generator) -> SketchConstraint:
    camera, feature = random_point(model, rng).camera, rng.choice(list(FEATURES))
    stroke = as_pixels(rng.uniform(300, 500, 2) + np.cumsum(rng.uniform(-4, 10, (30, 2)), axis=0))
    names = FEATURES[feature].points
    matched = tuple((names[i], stroke[10 * i]) for i in sorted(rng.choice(3, 2, replace=False)))
    sketch = SketchConstraint(stroke, camera, feature, matched, weight=rng.uniform(0.5, 2))
    return sketch.resolved(model, model.neutral())


def central_differences(function: Callable[[np.ndarray], float], p: np.ndarray, step: float = 1e-6) -> np.ndarray:
    steps = step * np.eye(len(p))
    return np.array([(function(p + s) - function(p - s)) / (2 * step) for s in steps])


def keeps_its_pairs(term: Term, problem: PoseProblem, p: np.ndarray, step: float = 1e-6) -> np.ndarray:
    """Tell for each coefficient whether a step leaves every point of a stroke its neighbour: else there is a kink."""
    if not isinstance(term, StrokeDistanceTerm):
        return np.ones(len(p), dtype=bool)

    def pairs(x: np.ndarray) -> np.ndarray:
        match = term._match_at(problem.state(x))
        return np.concatenate([match.nearest_target, match.nearest_source])

    here, steps = pairs(p), step * np.eye(len(p))
    return np.array([all((pairs(p + sign * s) == here).all() for sign in (-1, 1)) for s in steps])


MAKERS = {
    "point": random_point,
    "distance": random_distance,
    "stroke": random_stroke,
    "curve": random_curve,
    "fixed": random_fixed,
    "gaze": random_gaze,
    "sketch": random_sketch,
}


def test_every_kind_is_tried() -> None:
    assert set(MAKERS) == set(CONSTRAINTS)


@pytest.mark.parametrize("kind", CONSTRAINTS)
def test_gradient_and_jacobian_agree_with_finite_differences(model: FaceModel, kind: str) -> None:
    rng = np.random.default_rng(0)
    for _ in range(5):
        constraints = [MAKERS[kind](model, rng) for _ in range(4)]
        problem = PoseProblem(model, constraints, bare=True)
        term = problem.terms[1]
        p = random_pose(model, rng)
        state = problem.state(p)
        value, gradient = term.value_and_gradient(state)
        numeric = central_differences(lambda x, t=term, q=problem: t.value_and_gradient(q.state(x))[0], p)
        smooth = keeps_its_pairs(term, problem, p)
        assert smooth.mean() > 0.5
        np.testing.assert_allclose(gradient[smooth], numeric[smooth], rtol=1e-3, atol=1e-4 * np.abs(gradient).max())
        if not isinstance(term, ResidualTerm):
            continue
        assert value == pytest.approx(float(term.weights @ term.residual(state) ** 2))
        step = rng.normal(size=len(p)) * 1e-8
        change = term.residual(problem.state(p + step)) - term.residual(problem.state(p - step))
        np.testing.assert_allclose(term.jacobian(state) @ (2 * step), change, rtol=1e-3, atol=1e-9)
        by_residual = rng.normal(size=len(term.residual(state)))
        np.testing.assert_allclose(
            term.pull_back(state, by_residual), by_residual @ term.jacobian(state), rtol=1e-6, atol=1e-6
        )


@pytest.mark.parametrize("kind", CONSTRAINTS)
def test_json_round_trip_is_exact(model: FaceModel, kind: str) -> None:
    constraint = MAKERS[kind](model, np.random.default_rng(1))
    text = json.dumps(constraint.to_json())
    assert constraint_from_json(json.loads(text), "constraints[0]") == constraint


def test_whole_energy_agrees_with_finite_differences(model: FaceModel) -> None:
    rng = np.random.default_rng(2)
    constraints = [make(model, rng) for kind, make in MAKERS.items() for _ in range(3) if kind != "stroke"]
    problem = PoseProblem(model, constraints, prior_weight=0.7)
    p = random_pose(model, rng)
    numeric = central_differences(lambda x: problem.energy_and_gradient(x)[0], p, step=1e-5)
    gradient = problem.energy_and_gradient(p)[1]
    np.testing.assert_allclose(gradient, numeric, rtol=1e-3, atol=1e-4 * np.abs(gradient).max())


def test_a_vertex_anchor_is_that_vertex(model: FaceModel) -> None:
    rng = np.random.default_rng(3)
    vertex = int(model.triangles[1234, 1])
    constraint = PointConstraint(vertex, (10.0, 20.0), random_point(model, rng).camera)
    problem = PoseProblem(model, [constraint])
    p = random_pose(model, rng)
    np.testing.assert_allclose(problem.state(p).points[0], model.instance(p)[vertex], atol=1e-4)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"type": "pont"}, r"constraints\[0\]\.type is 'pont'"),
        ({"colour": 1}, r"constraints\[0\] has the unknown key 'colour'"),
        ({"target": [1, float("nan")]}, r"constraints\[0\]\.target\[1\] must be a number"),
        ({"target": [1, 10**400]}, r"target\[1\] must be a number"),
        ({"target": [1, float("-inf")]}, r"target\[1\] must be a number"),
        ({"target": [1]}, "must be a list of 2 numbers"),
        ({"anchor": {"vertex": -1}}, "whole number"),
        ({"anchor": {"face": 3, "barycentric": [1, 1, 1]}}, "sum to 1"),
        ({"anchor": {}}, "'vertex', or 'face' and 'barycentric'"),
        ({"weight": -1}, "from 0 to"),
        ({"enabled": 1}, "true or false"),
        ({"camera": {"rotation": []}}, r"camera lacks the key 'translation'"),
    ],
)
def test_wrong_json_is_refused_with_its_place(model: FaceModel, change: dict, said: str) -> None:
    data = random_point(model, np.random.default_rng(4)).to_json()
    with pytest.raises(FacePoserError, match=said):
        constraint_from_json(plain(data) | change, "constraints[0]")


def plain(data: dict) -> dict:
    """Return ``data`` as a file has it, without NumPy's numbers."""
    return json.loads(json.dumps(data))


def test_a_camera_that_mirrors_is_refused(model: FaceModel) -> None:
    data = plain(random_point(model, np.random.default_rng(5)).to_json())
    data["camera"]["rotation"] = [[1, 0, 0], [0, 1, 0], [0, 0, -1]]
    with pytest.raises(FacePoserError, match="rotation must be a rotation matrix"):
        constraint_from_json(data, "constraints[0]")


def test_the_image_energy_counts_pixels_and_slopes_downhill(model: FaceModel) -> None:
    rng = np.random.default_rng(6)
    camera = random_front(model)
    brow = model.character.feature_points["4.3"]
    u, v = camera.project(model.character.vertices[[brow]])[0]
    way = np.array([[u - 25.0, v], [u + 25.0, v]])
    stroke = StrokeConstraint(as_pixels(way), as_pixels(way + (0.0, -6.0)), 10.0, camera, energy="image")
    stroke = stroke.resolved(model, model.neutral())
    problem = PoseProblem(model, [stroke], bare=True)
    (term,) = problem.terms[1:]
    assert isinstance(term, StrokeImageTerm)
    value, gradient = term.value_and_gradient(problem.state(model.neutral()))
    covered = {
        tuple(row) for row in np.floor(camera.project(model.positions_at(stroke.points, model.neutral()))).tolist()
    }
    wanted = {tuple(row) for row in np.floor(stroke.target_pixels).tolist()}
    apart = 6.0
    assert value == pytest.approx(len(covered ^ wanted) / 100.0 + apart**2 / 2.25, rel=0.02)
    # The estimate must point uphill on the scale of pixels, where the binary image is no staircase.
    for _ in range(10):
        direction = rng.normal(size=len(gradient)) * np.sqrt(model.subspace.variances)
        shift = np.abs(problem.state(model.neutral()).pixel_jacobian(np.arange(len(stroke.points))) @ direction).mean()
        step = direction * (3.0 / shift)
        change = term.value_and_gradient(problem.state(step))[0] - term.value_and_gradient(problem.state(-step))[0]
        if abs(change) > 2.0:
            assert np.sign(change) == np.sign(gradient @ step)


def random_front(model: FaceModel) -> Camera:
    lower, upper = model.character.vertices.min(axis=0), model.character.vertices.max(axis=0)
    return OrbitView.preset(lower, upper).camera((800, 800))


def test_fixed_points_cost_the_same_however_many(model: FaceModel) -> None:
    rng = np.random.default_rng(7)
    p = random_pose(model, rng)
    energies = []
    for count in (200, 400):
        points = SurfacePoints.at_vertices(model.character.regions["mouth"][:: 1200 // count])
        problem = PoseProblem(model, [FixedConstraint(points).resolved(model, model.neutral())], bare=True)
        energies.append(problem.terms[1].value_and_gradient(problem.state(p))[0])
        assert problem.constraints[0].residual_px(model, model.neutral()) < 1e-6
    assert energies[0] == pytest.approx(energies[1], rel=0.05)


@pytest.mark.parametrize(
    ("kind", "change", "said"),
    [
        ("distance", {"target": -1}, r"target must be a number from 0"),
        ("distance", {"anchors": [{"vertex": 1}]}, "anchors must be a list of 2 anchors"),
        ("stroke", {"width": 0}, "width must be a number from 1"),
        ("stroke", {"shape": "round"}, "shape is 'round'; it must be one of 'line', 'closed', 'filled'"),
        ("stroke", {"energy": 3}, "energy is 3"),
        ("stroke", {"source": []}, "source must be a list of 1 to 100000 pixels"),
        ("stroke", {"source": {"vertices": [1]}}, "source has the unknown key 'vertices'"),
        ("curve", {"source": [[1, 2]]}, "source must be a list of 2 to 64 pixels"),
        ("curve", {"target": [[1, 2], [3, 4]]}, "as many points as its source"),
        ("curve", {"parameters": [9.0] * 20}, "parameters must be from 0 to 3"),
        ("fixed", {"positions": [[0, 0, 0]]}, "positions must be a list of 40 positions"),
        ("fixed", {"anchors": []}, "anchors must be a list of 1 to"),
        ("gaze", {"direction": [1]}, "direction must be a list of 2 numbers"),
        ("sketch", {"stroke": [[1, 2]]}, "stroke must be a list of 2 to 10000 pixels"),
        ("sketch", {"stroke": [[1, 2], [1, 2]]}, "stroke must have a length"),
        ("sketch", {"stroke": [[1, 2], [1, float("inf")]]}, r"stroke\[1\]\[1\] must be a number"),
        ("sketch", {"feature": "left eyebrow"}, "feature must be the name of a feature: left brow, right brow"),
        ("sketch", {"points": []}, "points must be a list of 1 to 32"),
        ("sketch", {"points": [{"feature_point": "9.9", "pixel": [1, 2]}]}, "points must name feature points of the"),
        ("sketch", {"points": [{"feature_point": "4.1"}]}, r"points\[0\] lacks the key 'pixel'"),
        ("sketch", {"anchors": []}, "has the unknown key 'anchors'"),
        ("gaze", {"locked": 1}, "locked must be true or false"),
    ],
)
def test_wrong_json_of_every_kind_is_refused(model: FaceModel, kind: str, change: dict, said: str) -> None:
    data = MAKERS[kind](model, np.random.default_rng(8)).to_json()
    with pytest.raises(FacePoserError, match=said):
        constraint_from_json(plain(data) | change, "constraints[0]")


def test_a_curve_keeps_its_place_when_points_come_and_go(model: FaceModel) -> None:
    curve = random_curve(model, np.random.default_rng(9))
    more = curve.with_point_at(1.3)
    assert len(more.source) == len(more.target) == 5
    old, _ = curve_at(relaxed_bezier(curve.target), [1.3])
    np.testing.assert_allclose(more.target[2], old[0])
    at = np.array(more.parameters)
    assert (np.diff(at) > 0).all()
    assert at[0] >= 0
    assert at[-1] <= 4
    assert len(more.without_point(2).points) == len(curve.points)
    np.testing.assert_allclose(more.without_point(2).target, curve.target)
    short = curve.without_point(0)
    assert len(short.points) == sum(value >= 1.0 for value in curve.parameters)
    with pytest.raises(ValueError, match="at least two"):
        short.without_point(0).without_point(0)


def test_points_without_a_place_in_the_image_are_infinitely_far(model: FaceModel) -> None:
    stroke = random_stroke(model, np.random.default_rng(0))
    assert stroke.residual_of(np.full((9, 2), np.nan)) == np.inf
