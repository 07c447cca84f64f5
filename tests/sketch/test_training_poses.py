"""Training poses of every character."""

from dataclasses import replace

import numpy as np
import pytest

from faceposer.geometry.picking import SurfacePoints
from faceposer.model.face_model import FaceModel, build_face_model
from faceposer.model.feature_curves import FEATURES
from faceposer.sketch.training_poses import TrainingPoses


@pytest.mark.parametrize("character", ["low", "creature"])
@pytest.mark.parametrize("count", [36, 300])
def test_poses(character: str, count: int, request: pytest.FixtureRequest) -> None:
    model: FaceModel = request.getfixturevalue(character)
    library = [0.5 * model.coefficients_of(row) for row in np.eye(len(model.character.shape_names))[:5]]
    poses = TrainingPoses.of(model, count, library)
    assert len(poses) == count
    assert not poses.coefficients[0].any()
    assert np.array_equal(poses.coefficients[1:6], library)
    assert np.array_equal(poses.coefficients, TrainingPoses.of(model, count, library).coefficients)
    assert not np.array_equal(poses.coefficients, TrainingPoses.of(model, count, library, seed=1).coefficients)
    ids = SurfacePoints.at_vertices([model.character.feature_points[name] for name in poses.names])
    for i in (0, 3, count - 1):
        assert poses.points[i] == pytest.approx(model.positions_at(ids, poses.coefficients[i]), abs=1e-4)
        assert poses.positions(poses.coefficients[i]) == pytest.approx(poses.points[i])


def test_shapes_are_within_their_natural_range(low: FaceModel) -> None:
    poses = TrainingPoses.of(low, 60)
    weights = poses.coefficients @ low.subspace.directions.T
    assert weights.min() > -0.05
    assert weights.max() < 1.05
    # Half of the poses besides the neutral face are single shapes, those first that move the feature points most.
    single = (np.sort(weights, axis=1)[:, -2] < 0.05) & (weights.max(axis=1) > 0.9)
    assert single.sum() >= 25


def test_a_long_library_is_cut(low: FaceModel) -> None:
    library = np.random.default_rng(0).normal(size=(50, low.n_coefficients))
    poses = TrainingPoses.of(low, 36, list(library))
    assert np.array_equal(poses.coefficients[1:], library[:35])


def test_pupils_do_not_take_part(low: FaceModel) -> None:
    poses = TrainingPoses.of(low, 36)
    assert {"3.5", "3.6"}.isdisjoint(poses.names)
    assert len(poses.drawable) == 46
    assert len(poses.features) == 19


def test_characters_without_some_feature_points(low: FaceModel) -> None:
    kept = {name: vertex for name, vertex in low.character.feature_points.items() if name[:2] in ("4.", "2.")}
    del kept["4.6"]
    poses = TrainingPoses.of(build_face_model(replace(low.character, feature_points=kept, feature_titles={})), 36)
    assert "left brow" in poses.features
    assert "right brow" not in poses.features
    assert "outer upper lip" not in poses.features
    assert set(poses.drawable) == {point for name in poses.features for point in FEATURES[name].points}
