"""Derivatives of points: the same for one and for many, and cached within limits."""

import numpy as np
import pytest

from faceposer.geometry.picking import SurfacePoints
from faceposer.model.face_model import FaceModel, build_face_model


@pytest.mark.parametrize("count", [0, 1, 1024, 3000])
def test_rows_of_many_points_are_those_of_each(low: FaceModel, count: int) -> None:
    rng = np.random.default_rng(count)
    weights = rng.random((count, 3)) + 0.1
    on_faces = SurfacePoints(rng.integers(0, len(low.triangles), count), weights / weights.sum(axis=1, keepdims=True))
    at_vertices = SurfacePoints.at_vertices(rng.integers(0, len(low.character.vertices), count))
    basis = low.basis.reshape(low.n_coefficients, -1, 3).astype(np.float64)
    for points in (on_faces, at_vertices, on_faces.joined(at_vertices)):
        rows, neutral = low.rows_of(points)
        expected = np.einsum("nk,rnkd->ndr", points.barycentric, basis[:, points.corners(low.triangles)])
        np.testing.assert_allclose(rows, expected, atol=1e-12)
        np.testing.assert_array_equal(neutral, points.positions(low.character.vertices, low.triangles))


def test_painting_for_hours_takes_no_more_memory(low: FaceModel) -> None:
    model = build_face_model(low.character)
    painted = np.arange(len(model.character.vertices))
    for end in range(200, len(painted), 5):
        points = SurfacePoints.at_vertices(painted[:end])
        model.jacobian_gram_at(points)
        model.positions_at(points, model.neutral())
    assert model.jacobian_at(points)[0].nbytes < model._gathered.bytes <= 64 << 20
    assert model._grams.bytes <= 8 << 20
    assert model.jacobian_at(points)[0] is model.jacobian_at(SurfacePoints.at_vertices(painted[:end]))[0]
