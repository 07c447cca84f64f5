"""The terms of the prior beside its density: least motion, bounds and a parallel gaze."""

import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from faceposer.geometry.camera import Camera, OrbitView
from faceposer.model.character import ARKIT_SHAPES
from faceposer.model.face_model import FaceModel
from faceposer.solve.constraints.point import PointConstraint
from faceposer.solve.constraints.registry import Constraint
from faceposer.solve.gaze_terms import HeldGaze, ParallelGaze, eye_turns, gaze_differences
from faceposer.solve.least_motion import LeastMotion
from faceposer.solve.map_solver import solve
from faceposer.solve.priors import PRIORS, Prior, WeightBounds
from faceposer.solve.problem import PoseProblem
from faceposer.solve.term import ResidualTerm, Term

WEIGHTS = (0.0, 0.1, 1.0, 10.0)


@pytest.fixture(scope="module")
def camera(model: FaceModel) -> Camera:
    return OrbitView.preset(model.character.vertices.min(axis=0), model.character.vertices.max(axis=0)).camera(
        (800, 800)
    )


def pulled(
    model: FaceModel, camera: Camera, place: str, pull: tuple[float, float], p: np.ndarray | None = None
) -> PointConstraint:
    vertex = model.character.feature_points[place]
    vertices = model.character.vertices if p is None else model.instance(p)
    u, v = (camera.project(vertices[[vertex]].astype(np.float64))[0] + pull).tolist()
    return PointConstraint(vertex, (u, v), camera)


def random_pose(model: FaceModel, rng: np.random.Generator, share: float = 0.7) -> np.ndarray:
    return share * rng.normal(size=model.n_coefficients) * np.sqrt(model.subspace.variances)


def term_of(problem: PoseProblem, kind: type) -> Term:
    (found,) = [term for term in problem.terms if isinstance(term, kind)]
    return found


def of_bounds_from_a_pose_beyond_them(model: FaceModel, camera: Camera) -> Term:
    start = model.coefficients_of({"jawOpen": 1.4, "mouthSmileLeft": -0.3})
    return term_of(PoseProblem(model, [pulled(model, camera, "8.3", (9.0, -9.0))], start), WeightBounds)


MAKERS: dict[str, Callable[[FaceModel, Camera], Term]] = {
    "least motion": lambda model, camera: term_of(
        PoseProblem(model, [pulled(model, camera, "8.3", (9.0, -9.0))]), LeastMotion
    ),
    "gaze": lambda model, camera: term_of(
        PoseProblem(model, [pulled(model, camera, "8.3", (9.0, -9.0))]), ParallelGaze
    ),
    "held gaze": lambda model, camera: term_of(
        PoseProblem(model, [pulled(model, camera, "8.3", (9.0, -9.0))]), HeldGaze
    ),
    "bounds": of_bounds_from_a_pose_beyond_them,
}


@pytest.mark.parametrize("kind", MAKERS)
def test_derivatives_agree_with_finite_differences(model: FaceModel, camera: Camera, kind: str) -> None:
    term = MAKERS[kind](model, camera)
    problem = PoseProblem(model, [])
    rng = np.random.default_rng(0)
    step = 1e-6
    for _ in range(4):
        p = random_pose(model, rng, 1.5)
        state = problem.state(p)
        value, gradient = term.value_and_gradient(state)
        assert value > 0.0
        numeric = np.array(
            [
                (
                    term.value_and_gradient(problem.state(p + step * e))[0]
                    - term.value_and_gradient(problem.state(p - step * e))[0]
                )
                / (2.0 * step)
                for e in np.eye(len(p))
            ]
        )
        np.testing.assert_allclose(gradient, numeric, rtol=3e-4, atol=1e-5 * np.abs(gradient).max())
        curvature = term.curvature(state)
        direction = rng.normal(size=len(p)) * np.sqrt(model.subspace.variances)
        change = (
            term.value_and_gradient(problem.state(p + step * direction))[1]
            - term.value_and_gradient(problem.state(p - step * direction))[1]
        )
        np.testing.assert_allclose(
            curvature @ (2.0 * step * direction), change, rtol=1e-3, atol=1e-5 * np.abs(change).max()
        )
        assert np.linalg.eigvalsh(curvature)[0] > -1e-6 * np.abs(curvature).max()
        if isinstance(term, ResidualTerm):
            assert value == pytest.approx(float(term.weights @ term.residual(state) ** 2))


@pytest.mark.parametrize("prior", PRIORS)
@pytest.mark.parametrize("weight", WEIGHTS)
def test_the_eyes_look_the_same_way(model: FaceModel, camera: Camera, prior: Prior, weight: float) -> None:
    apart = gaze_differences(model)
    assert apart.shape == (2, model.n_coefficients)
    gestures = {
        "smile": [pulled(model, camera, "8.3", (14.0, -16.0)), pulled(model, camera, "8.4", (-14.0, -16.0))],
        "one brow": [pulled(model, camera, "4.1", (0.0, -18.0))],
        "lid": [pulled(model, camera, "3.1", (0.0, 14.0))],
        "pupil": [pulled(model, camera, "3.5", (12.0, 0.0))],
        "far": [pulled(model, camera, "8.2", (200.0, 120.0))],
    }
    for name, constraints in gestures.items():
        pose = solve(PoseProblem(model, constraints, prior_weight=weight, prior=prior)).coefficients
        assert np.abs(apart @ pose).max() < 0.08, name


@pytest.mark.parametrize("spread", [0.0, 0.5, 0.75])
def test_lids_do_not_turn_the_eyes(model: FaceModel, camera: Camera, spread: float) -> None:
    turns = eye_turns(model)
    assert turns.shape == (4, model.n_coefficients)
    for lid, dy in (("3.1", 10.0), ("3.1", -6.0), ("3.3", 6.0), ("3.3", -5.0)):
        problem = PoseProblem(model, [pulled(model, camera, lid, (0.0, dy))], spread=spread)
        pose = solve(problem).coefficients
        assert np.abs(turns @ pose).max() < np.radians(1.5), (lid, dy)
    pose = solve(PoseProblem(model, [pulled(model, camera, "3.5", (8.0, 0.0))], spread=spread)).coefficients
    assert np.abs(turns @ pose).max() > np.radians(5.0), "a pupil that is pulled turns them"
    pose = solve(PoseProblem(model, [pulled(model, camera, "3.1", (0.0, 10.0))], spread=1.0)).coefficients
    assert np.abs(turns @ pose).max() > np.radians(1.5), "with the whole face they look down, as in performances"


@pytest.mark.parametrize("prior", PRIORS)
@pytest.mark.parametrize("weight", WEIGHTS)
def test_a_far_drag_leaves_a_face(model: FaceModel, camera: Camera, prior: Prior, weight: float) -> None:
    lower, upper = model.character.shape_limits.T
    bounded = upper > lower
    features, names = model.character.feature_points, list(model.character.shape_names)
    for place in ("8.3", "8.2", "2.10", "4.1", "3.1"):
        for pull in ((0.0, -300.0), (220.0, -220.0), (0.0, 300.0)):
            constraint = pulled(model, camera, place, pull)
            solution = solve(PoseProblem(model, [constraint], prior_weight=weight, prior=prior))
            weights = model.weights_of(solution.coefficients)
            beyond = np.maximum(lower - weights, weights - upper)[bounded]
            assert beyond.max() < 0.3, (place, pull)
            assert weights[names.index("mouthClose")] < max(weights[names.index("jawOpen")], 0.0) + 0.3
            posed = model.instance(solution.coefficients)
            assert posed[features["2.2"], 1] - posed[features["2.3"], 1] > -1.0, "the lips do not pass each other"


@pytest.mark.parametrize("spread", [0.0, 0.5, 1.0])
def test_the_pose_follows_a_pull_without_jumps(model: FaceModel, camera: Camera, spread: float) -> None:
    for place, direction in (("8.3", (0.6, -0.8)), ("4.1", (0.1, 1.0)), ("2.10", (0.0, 1.0))):
        before, steps = model.character.vertices, []
        for length in np.arange(0.25, 30.0, 0.25):
            pull = (length * direction[0], length * direction[1])
            solution = solve(PoseProblem(model, [pulled(model, camera, place, pull)], spread=spread))
            after = model.instance(solution.coefficients)
            steps.append(float(np.linalg.norm(after - before, axis=1).max()))
            before = after
        # A quarter of a pixel is 0.011 cm of the man.
        assert max(steps) < 0.12, place


def test_a_small_pull_stays_local_and_the_spread_widens_it(model: FaceModel, camera: Camera) -> None:
    def moved_elsewhere(spread: float) -> float:
        problem = PoseProblem(model, [pulled(model, camera, "8.3", (6.0, -8.0))], spread=spread)
        posed = model.instance(solve(problem).coefficients)
        far = np.linalg.norm(
            model.character.vertices - model.character.vertices[model.character.feature_points["8.3"]], axis=1
        )
        return float(np.linalg.norm(posed - model.character.vertices, axis=1)[far > 5.0].mean())

    local, usual, whole = (moved_elsewhere(spread) for spread in (0.0, 0.5, 1.0))
    assert local < usual < whole
    assert local < 0.5 * whole


def test_least_motion_yields_to_pulls_that_say_much(model: FaceModel, camera: Camera) -> None:
    truth = model.coefficients_of({"mouthSmileLeft": 0.6, "mouthSmileRight": 0.6, "jawOpen": 0.3})
    rng = np.random.default_rng(3)
    vertices = rng.choice(model.character.regions["mouth"], 40, replace=False)
    targets = camera.project(model.instance(truth)[vertices])
    constraints = [
        PointConstraint(int(vertex), (float(u), float(v)), camera)
        for vertex, (u, v) in zip(vertices, targets, strict=True)
    ]
    found = [solve(PoseProblem(model, constraints, spread=spread)).coefficients for spread in (0.0, 1.0)]
    errors = [np.linalg.norm(model.instance(p) - model.instance(truth), axis=1).mean() for p in found]
    scale = np.linalg.norm(model.instance(truth) - model.character.vertices, axis=1).mean()
    assert errors[0] < 1.2 * errors[1]
    assert max(errors) < 0.45 * scale


def test_bare_constraints_have_no_prior_and_no_bounds(model: FaceModel, camera: Camera) -> None:
    constraint = pulled(model, camera, "8.3", (200.0, -200.0))
    bare = PoseProblem(model, [constraint], bare=True)
    assert len(bare.terms) == 2
    assert bare.limits is None
    assert solve(bare).residuals_px[0] < 1.0, "it goes wherever it is pulled"
    assert solve(PoseProblem(model, [constraint], prior_weight=0.0)).residuals_px[0] > 100.0


def captured(model: FaceModel, count: int) -> list[np.ndarray]:
    """Poses of a take that the prior has not learned from."""
    from faceposer.training.capture import read_capture

    path = Path(os.environ["FACEPOSER_CAPTURES"]) / "alex_rom_4.csv"
    take = read_capture(path).with_shapes(ARKIT_SHAPES)
    own = model.character.shape_names
    poses = []
    for frame in take.weights[np.linspace(0, len(take.weights) - 1, count).astype(int)]:
        weights = dict.fromkeys(own, 0.0)
        for name, value in zip(ARKIT_SHAPES, frame.tolist(), strict=True):
            for shape in (name,) if name in own else (f"{name}Left", f"{name}Right"):
                if shape in own:
                    weights[shape] = value
        poses.append(model.coefficients_of([weights[name] for name in own]))
    return poses


@pytest.mark.skipif("FACEPOSER_CAPTURES" not in os.environ, reason="needs the capture files")
@pytest.mark.parametrize(("spread", "weight"), [(0.5, 1.0), (0.0, 1.0), (1.0, 1.0), (0.5, 0.0), (0.5, 10.0)])
def test_a_point_placed_where_it_is_leaves_a_captured_pose_as_it_is(
    model: FaceModel, camera: Camera, spread: float, weight: float
) -> None:
    places = ("8.3", "8.2", "4.1", "3.1", "5.1", "2.10")
    for i, start in enumerate(captured(model, 60)):
        constraints: list[Constraint] = [
            pulled(model, camera, place, (0.0, 0.0), start) for place in places[: 1 + i % len(places)]
        ]
        before = model.instance(start)
        solution = solve(PoseProblem(model, constraints, start, weight, spread=spread), start)
        assert np.abs(model.instance(solution.coefficients) - before).max() < 1e-6, i
        fresh = solve(PoseProblem(model, constraints, start, weight, spread=spread))
        assert np.abs(model.instance(fresh.coefficients) - before).max() < 1e-6, i
