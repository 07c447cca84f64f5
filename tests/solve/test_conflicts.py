"""Constraints that cannot be met are told what holds them back (Lau et al. 2009, Figure 9)."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from faceposer.geometry.camera import Camera, OrbitView
from faceposer.model.face_model import FaceModel
from faceposer.solve.conflicts import Conflict, find_conflicts
from faceposer.solve.constraints.point import PointConstraint
from faceposer.solve.constraints.registry import Constraint
from faceposer.solve.map_solver import solve
from faceposer.solve.problem import PoseProblem


@pytest.fixture(scope="module")
def camera(model: FaceModel) -> Camera:
    vertices = model.character.vertices
    return OrbitView.preset(vertices.min(axis=0), vertices.max(axis=0)).camera((800, 800))


def pin(model: FaceModel, camera: Camera, vertex: int, dx: float, dy: float) -> PointConstraint:
    """Return a pin that pulls ``vertex`` by (dx, dy) pixels."""
    u, v = (camera.project(model.character.vertices[[vertex]])[0] + (dx, dy)).tolist()
    return PointConstraint(vertex, (u, v), camera)


def beside(model: FaceModel, name: str) -> tuple[int, int]:
    """Return the vertex of the feature ``name`` and its nearest neighbour."""
    vertices = model.character.vertices
    vertex = model.character.feature_points[name]
    nearest = np.argsort(np.linalg.norm(vertices - vertices[vertex], axis=1))
    return vertex, int(nearest[1])


def conflicts(model: FaceModel, constraints: Sequence[Constraint], prior_weight: float = 1.0) -> list[Conflict]:
    problem = PoseProblem(model, constraints, prior_weight=prior_weight)
    return find_conflicts(problem, solve(problem).coefficients)


def test_two_pins_that_fight_are_each_others_opponents(model: FaceModel, camera: Camera) -> None:
    corner, neighbour = beside(model, "8.3")
    nose = model.character.feature_points["9.3"]
    up_left = pin(model, camera, corner, -14, -14)
    down_right = pin(model, camera, neighbour, 14, 14)
    found = conflicts(model, [pin(model, camera, nose, 0, 0), up_left, down_right])
    opponents = {conflict.index: conflict.opponent for conflict in found}
    assert opponents.get(1) == 2
    assert opponents.get(2) == 1
    assert 0 not in opponents, "who is met does not fight"


def test_an_absurd_pin_is_held_back_by_what_faces_do(model: FaceModel, camera: Camera) -> None:
    corner = model.character.feature_points["8.3"]
    nose = model.character.feature_points["9.3"]
    assert conflicts(model, [pin(model, camera, corner, 150, -150)]) == [Conflict(0, None, mobility=1.0)]
    found = conflicts(model, [pin(model, camera, corner, 150, -150), pin(model, camera, nose, 0, 0)])
    assert Conflict(0, None, mobility=1.0) in found


def test_what_is_met_gives_nothing(model: FaceModel, camera: Camera) -> None:
    corner, neighbour = beside(model, "8.3")
    together = [pin(model, camera, vertex, 8, -8) for vertex in (corner, neighbour)]
    assert conflicts(model, together) == []
    assert conflicts(model, []) == []


def test_who_rests_or_weighs_nothing_neither_fights_nor_is_fought(model: FaceModel, camera: Camera) -> None:
    corner, neighbour = beside(model, "8.3")
    one, other = pin(model, camera, corner, -8, -8), pin(model, camera, neighbour, 8, 8)
    for resting in (replace(other, enabled=False), replace(other, weight=0.0)):
        assert all(c.index == 0 and c.opponent is None for c in conflicts(model, [one, resting]))
