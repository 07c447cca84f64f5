"""Every term against finite differences, over random poses, cameras and all kinds of constraints."""

import json
from collections.abc import Callable

import numpy as np
import pytest

from faceposer.errors import FacePoserError
from faceposer.geometry.camera import OrbitView
from faceposer.geometry.picking import SurfacePoint
from faceposer.model.face_model import FaceModel
from faceposer.solve.constraints.point import PointConstraint
from faceposer.solve.constraints.registry import CONSTRAINTS, constraint_from_json
from faceposer.solve.problem import PoseProblem
from faceposer.solve.term import ResidualTerm


def random_pose(model: FaceModel, rng: np.random.Generator) -> np.ndarray:
    return rng.normal(size=model.n_coefficients) * np.sqrt(model.subspace.variances)


def random_point(model: FaceModel, rng: np.random.Generator) -> PointConstraint:
    lower, upper = model.subject.vertices.min(axis=0), model.subject.vertices.max(axis=0)
    view = OrbitView.preset(lower, upper).orbited(*rng.uniform(-150, 150, 2), (800, 800))
    weights = rng.dirichlet(np.ones(3))
    anchor = SurfacePoint(int(rng.integers(len(model.triangles))), tuple(weights.tolist()))
    return PointConstraint(anchor, tuple(rng.uniform(100, 700, 2)), view.camera((800, 800)), rng.uniform(0.5, 2))


def central_differences(function: Callable[[np.ndarray], float], p: np.ndarray, step: float = 1e-6) -> np.ndarray:
    steps = step * np.eye(len(p))
    return np.array([(function(p + s) - function(p - s)) / (2 * step) for s in steps])


MAKERS = {"point": random_point}


def test_every_kind_is_tried() -> None:
    assert set(MAKERS) == set(CONSTRAINTS)


@pytest.mark.parametrize("kind", CONSTRAINTS)
def test_gradient_and_jacobian_agree_with_finite_differences(model: FaceModel, kind: str) -> None:
    rng = np.random.default_rng(0)
    for _ in range(5):
        constraints = [MAKERS[kind](model, rng) for _ in range(4)]
        problem = PoseProblem(model, constraints, prior_weight=0)
        term = next(term for term in problem.terms if isinstance(term, ResidualTerm))
        p = random_pose(model, rng)
        state = problem.state(p)
        value, gradient = term.value_and_gradient(state)
        assert value == pytest.approx(float(term.weights @ term.residual(state) ** 2))
        numeric = central_differences(lambda x, t=term, q=problem: t.value_and_gradient(q.state(x))[0], p)
        np.testing.assert_allclose(gradient, numeric, rtol=1e-3, atol=1e-4 * np.abs(gradient).max())
        step = rng.normal(size=len(p)) * 1e-5
        change = term.residual(problem.state(p + step)) - term.residual(problem.state(p - step))
        np.testing.assert_allclose(term.jacobian(state) @ (2 * step), change, rtol=1e-3, atol=1e-8)
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
    constraints = [make(model, rng) for make in MAKERS.values() for _ in range(3)]
    problem = PoseProblem(model, constraints, prior_weight=0.7)
    p = random_pose(model, rng)
    numeric = central_differences(lambda x: problem.energy_and_gradient(x)[0], p)
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
        ({"target": [1]}, "must be a list of 2 numbers"),
        ({"anchor": {"vertex": -1}}, "whole number"),
        ({"anchor": {"face": 3, "barycentric": [1, 1, 1]}}, "sum to 1"),
        ({"anchor": {}}, "lacks the key 'barycentric'"),
        ({"weight": -1}, "from 0 to"),
        ({"enabled": 1}, "true or false"),
        ({"camera": {"rotation": []}}, r"camera lacks the key 'focal'"),
    ],
)
def test_wrong_json_is_refused_with_its_place(model: FaceModel, change: dict, said: str) -> None:
    data = random_point(model, np.random.default_rng(4)).to_json() | change
    with pytest.raises(FacePoserError, match=said):
        constraint_from_json(data, "constraints[0]")


def test_a_camera_that_mirrors_is_refused(model: FaceModel) -> None:
    data = random_point(model, np.random.default_rng(5)).to_json()
    data["camera"]["rotation"] = [[1, 0, 0], [0, 1, 0], [0, 0, -1]]
    with pytest.raises(FacePoserError, match="rotation must be a rotation matrix"):
        constraint_from_json(data, "constraints[0]")
