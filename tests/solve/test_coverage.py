"""How much of the face constraints speak of."""

import itertools
from dataclasses import replace

import numpy as np
import pytest

from faceposer.geometry.camera import Camera
from faceposer.model.face_model import FaceModel
from faceposer.model.framing import face_view
from faceposer.solve.constraints.point import PointConstraint
from faceposer.solve.constraints.registry import Constraint
from faceposer.solve.map_solver import solve
from faceposer.solve.problem import PoseProblem

MOUTH = ("8.3", "8.4", "8.1", "8.2")
OVER_THE_FACE = ("8.3", "4.2", "2.10", "5.1", "3.2")


@pytest.fixture(scope="module")
def camera(model: FaceModel) -> Camera:
    return face_view(model.character, "front", 1.0).camera((960, 960))


def pulls(model: FaceModel, camera: Camera, *places: str, by: tuple[float, float] = (0.0, 0.0)) -> list[Constraint]:
    points = [model.character.feature_points[place] for place in places]
    at = camera.project(model.character.vertices[points].astype(np.float64)) + np.array(by)
    return [PointConstraint(int(i), (float(u), float(v)), camera) for i, (u, v) in zip(points, at, strict=True)]


def trusted(model: FaceModel, constraints: list[Constraint], spread: float = 0.5) -> float:
    return PoseProblem(model, constraints, spread=spread).trust


def test_one_part_is_local_and_points_over_the_face_are_whole(model: FaceModel, camera: Camera) -> None:
    for places in (("8.3",), ("8.3", "8.4"), ("4.1", "4.2"), ("3.1", "3.2"), ("4.1", "4.2", "4.3", "4.4")):
        assert trusted(model, pulls(model, camera, *places)) < 0.02, places
    # The chin takes much of the face along, and is one thing to pull.
    assert trusted(model, pulls(model, camera, "2.10")) == 0.0
    assert trusted(model, pulls(model, camera, *OVER_THE_FACE)) > 0.9


def test_four_points_around_a_mouth_smile_with_the_cheeks_and_leave_the_brows(model: FaceModel, camera: Camera) -> None:
    smile = [
        *pulls(model, camera, "8.3", by=(8.0, -12.0)),
        *pulls(model, camera, "8.4", by=(-8.0, -12.0)),
        *pulls(model, camera, "8.1", "8.2"),
    ]
    pose = solve(PoseProblem(model, smile)).coefficients
    weights = dict(zip(model.character.shape_names, model.weights_of(pose), strict=True))
    assert weights["mouthSmileLeft"] > 0.2
    assert weights["cheekSquintLeft"] > 0.1
    moved = np.linalg.norm(model.instance(pose) - model.character.vertices, axis=1)
    assert max(moved[model.character.regions[f"brow_{side}"]].max() for side in ("left", "right")) < 0.02


def test_it_does_not_depend_on_where_the_pulls_go(model: FaceModel, camera: Camera) -> None:
    near, far = (trusted(model, pulls(model, camera, *MOUTH, by=(0.0, length))) for length in (0.0, 30.0))
    assert near == far


def test_no_spread_stays_local(model: FaceModel, camera: Camera) -> None:
    values = [trusted(model, pulls(model, camera, *OVER_THE_FACE), spread) for spread in (0.0, 0.25, 0.5, 1.0)]
    assert values[0] == 0.0
    assert values == sorted(values)
    assert values[-1] == 1.0


def test_a_constraint_comes_in_by_its_weight_without_jumps(model: FaceModel, camera: Camera) -> None:
    constraints = pulls(model, camera, "8.3", "4.2", by=(2.0, 6.0))
    extra = pulls(model, camera, "2.10", by=(0.0, 8.0))[0]
    faces, values = [], []
    for weight in [0.0, *np.geomspace(1e-4, 1.0, 41)]:
        asked = [*constraints, replace(extra, weight=float(weight))]
        problem = PoseProblem(model, asked)
        values.append(problem.trust)
        faces.append(model.instance(solve(problem).coefficients))
    assert values[-1] > values[0] + 0.1
    assert values == sorted(values)
    steps = [float(np.abs(b - a).max()) for a, b in itertools.pairwise(faces)]
    way = float(np.abs(faces[-1] - faces[0]).max())
    assert max(steps) < 0.25 * way, "41 steps, evenly spaced in the logarithm of the weight"


def test_a_drag_moves_the_face_without_jumps(model: FaceModel, camera: Camera) -> None:
    still = pulls(model, camera, "8.3", "4.2", "2.10", by=(1.0, 5.0))
    faces = [
        model.instance(solve(PoseProblem(model, [*still, *pulls(model, camera, "5.1", by=(0.0, -way))])).coefficients)
        for way in np.arange(0.0, 20.0, 0.5)
    ]
    steps = [float(np.linalg.norm(b - a, axis=1).max()) for a, b in itertools.pairwise(faces)]
    assert max(steps) < 0.1, "at most 1 mm of the face for half a pixel"
