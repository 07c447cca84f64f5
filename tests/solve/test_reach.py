"""How far a point can go: nothing on bone, the whole of a small pull, no more than the reach of a large one."""

import numpy as np
import pytest

from faceposer.geometry.camera import Camera, OrbitView
from faceposer.geometry.picking import SurfacePoints
from faceposer.model.face_model import FaceModel
from faceposer.solve.constraints.point import PointConstraint
from faceposer.solve.map_solver import solve
from faceposer.solve.problem import PoseProblem
from faceposer.solve.reach import HARDLY_MOVES, Reach, limits_around, reach_of

# Ears, hairline, nose bridge and crown; corners of the mouth, lips, brows, lids, cheek and chin.
BONE = ("10.1", "10.4", "10.5", "11.1", "11.3", "11.4", "9.12")
FLESH = ("8.3", "8.4", "8.1", "8.2", "4.1", "4.3", "3.13", "5.1", "2.10")


@pytest.fixture(scope="module")
def camera(model: FaceModel) -> Camera:
    return OrbitView.preset(model.character.vertices.min(axis=0), model.character.vertices.max(axis=0)).camera(
        (800, 800)
    )


def points(model: FaceModel, *names: str) -> SurfacePoints:
    return SurfacePoints.at_vertices([model.character.feature_points[name] for name in names])


def circle(count: int) -> np.ndarray:
    angles = np.linspace(0.0, 2.0 * np.pi, count, endpoint=False)
    return np.stack([np.cos(angles), np.sin(angles)], axis=1)


def one(reach: Reach, count: int) -> Reach:
    """The reach of its only point, as often as there are directions to ask."""
    return Reach(
        *(np.repeat(array, count, axis=0) for array in (reach.steps, reach.relaxing, reach.mobility, reach.scale))
    )


def test_bone_has_no_reach_and_flesh_has(model: FaceModel, camera: Camera) -> None:
    still, moving = (reach_of(model, model.neutral(), points(model, *names), camera) for names in (BONE, FLESH))
    assert still.mobility.max() < HARDLY_MOVES
    assert moving.mobility.min() > 0.9
    for direction in circle(12):
        assert still.pixels(np.tile(direction, (len(BONE), 1))).max() < 1.0
    farthest = np.max([moving.pixels(np.tile(d, (len(FLESH), 1))) for d in circle(24)], axis=0)
    assert farthest.min() > 8.0


def test_mobility_goes_over_from_bone_to_flesh_without_a_step(model: FaceModel, camera: Camera) -> None:
    front = np.argsort(np.abs(model.character.vertices[:, 0]))[:400]
    column = front[model.character.vertices[front, 2] > 7.0]
    order = column[np.argsort(model.character.vertices[column, 1])]
    mobility = reach_of(model, model.neutral(), SurfacePoints.at_vertices(order), camera).mobility
    assert mobility.min() == 0.0
    assert mobility.max() == 1.0
    assert ((mobility > 0.05) & (mobility < 0.95)).any()


def test_pulls_are_shortened_evenly_and_never_beyond_the_reach(model: FaceModel, camera: Camera) -> None:
    reach = reach_of(model, model.neutral(), points(model, "8.3"), camera)
    lengths = np.concatenate([np.linspace(0.0, 200.0, 800), [1e4, 1e6]])
    for direction in circle(9):
        limit = float(reach.pixels(direction[None])[0])
        pulls = lengths[:, None] * direction
        limited = np.hypot(*one(reach, len(pulls)).limited(pulls).T)
        steps = np.diff(limited)
        assert steps.min() > -1e-9, "a longer pull never moves less"
        assert steps[:-2].max() <= np.diff(lengths)[0] * (1.0 + 1e-9), "no pull is lengthened and nothing jumps"
        assert limited.max() <= limit * (1.0 + 1e-9)
        assert limited[-1] == pytest.approx(limit)
        within = (lengths > 0) & (lengths < 0.6 * limit)
        np.testing.assert_allclose(limited[within], lengths[within], rtol=0.01)


def test_the_outline_has_the_reach_for_its_support(model: FaceModel, camera: Camera) -> None:
    reach = reach_of(model, model.neutral(), points(model, "8.3", "9.12"), camera)
    outline = reach.outline(0, 360)
    assert outline.shape == (360, 2)
    for direction in circle(7):
        farthest = float((outline @ direction).max())
        exact = float(np.linalg.norm(np.maximum(reach.steps[0] @ direction, 0.0)))
        assert farthest == pytest.approx(exact, rel=1e-3, abs=0.05)
    assert np.hypot(*reach.outline(1).T).max() < 1.0


def test_the_face_goes_where_the_outline_says(model: FaceModel, camera: Camera) -> None:
    place = points(model, "8.3")
    here = camera.project(model.positions_at(place, model.neutral()))[0]
    reach = reach_of(model, model.neutral(), place, camera)
    vertex = model.character.feature_points["8.3"]
    for direction in circle(6):
        u, v = (here + 300.0 * direction).tolist()
        solution = solve(PoseProblem(model, [PointConstraint(vertex, (u, v), camera)]))
        moved = camera.project(model.positions_at(place, solution.coefficients))[0] - here
        limit = float(reach.pixels(direction[None])[0])
        assert 0.4 * limit - 3.0 < moved @ direction < limit + 4.0


def test_from_a_smile_a_corner_reaches_as_far_down_as_from_rest(model: FaceModel, camera: Camera) -> None:
    sides = ("Left", "Right")
    smile = model.coefficients_of({f"{shape}{side}": 0.7 for shape in ("mouthSmile", "cheekSquint") for side in sides})
    place, down = points(model, "8.3"), np.array([[0.0, 1.0]])
    lowest = []
    for start in (model.neutral(), smile):
        reach = reach_of(model, start, place, camera)
        height = camera.project(model.positions_at(place, start))[0, 1]
        lowest.append(height + float(reach.pixels(down)[0]))
        assert float((reach.outline(0, 360) @ down[0]).max()) <= float(reach.pixels(down)[0]) + 4.0
    assert lowest[1] == pytest.approx(lowest[0], abs=4.0)


@pytest.mark.parametrize("place", BONE)
def test_a_pull_on_bone_moves_nothing(model: FaceModel, camera: Camera, place: str) -> None:
    vertex = model.character.feature_points[place]
    here = camera.project(model.character.vertices[[vertex]].astype(float))[0]
    for pull in ((0.0, -40.0), (40.0, 0.0), (-150.0, 150.0)):
        u, v = (here + pull).tolist()
        solution = solve(PoseProblem(model, [PointConstraint(vertex, (u, v), camera)]))
        moved = np.linalg.norm(model.instance(solution.coefficients) - model.character.vertices, axis=1)
        assert moved.max() < 0.1, "a millimetre"


def test_the_lower_lip_rises_no_farther_than_a_closed_jaw_lets_it(model: FaceModel, camera: Camera) -> None:
    up = np.array([[0.0, -1.0]])
    closed = reach_of(model, model.neutral(), points(model, "8.2"), camera).pixels(up)
    opened = reach_of(model, model.coefficients_of({"jawOpen": 0.7}), points(model, "8.2"), camera).pixels(up)
    assert closed[0] < 0.6 * opened[0]


def test_limits_are_widened_to_the_start() -> None:
    limits = limits_around(np.array([[0.0, 1.0], [0.0, 1.0], [0.0, 0.0]]), np.array([1.3, -0.2, 5.0]))
    np.testing.assert_array_equal(limits, [[0.0, 1.3], [-0.2, 1.0], [-np.inf, np.inf]])
