"""In-betweens by splines of feature points."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from faceposer.model.face_model import FaceModel
from faceposer.sketch.inbetweens import DIMENSIONS, PointFaces, PointSpline, point_faces
from faceposer.sketch.ppca import PPCAMixture
from faceposer.sketch.training_poses import TrainingPoses

Array = NDArray[np.float64]
KNOTS = np.array([0.0, 7.0, 12.0, 30.0])


@pytest.fixture(scope="module")
def faces(low: FaceModel) -> PointFaces:
    return point_faces(low)


def draws(model: FaceModel, count: int, seed: int = 3) -> Array:
    density = model.rig_density
    rows = np.random.default_rng(seed).permutation(len(density.draws))[:count]
    return np.asarray(density.draws[rows] @ density.projection.T)


def test_feature_points_follow_a_cardinal_spline(low: FaceModel) -> None:
    # With all dimensions, the faces have the feature points that they are given.
    faces = PointFaces.fit(point_faces(low).training, dimensions=200)
    poses = draws(low, 4)
    points = faces.points_of(poses)
    spline = PointSpline(faces, KNOTS, poses)
    np.testing.assert_allclose(faces.points_of(spline.poses_at(KNOTS)), points, atol=1e-6)
    assert np.abs(spline.residuals).max() < 1e-6
    # Cubic of Hermite between the second and the third key, with the velocities of Catmull and Rom.
    first, second = (points[2] - points[0]) / 12.0, (points[3] - points[1]) / 23.0
    middle = (points[1] + points[2]) / 2.0 + 5.0 * (first - second) / 8.0
    np.testing.assert_allclose(faces.points_of(spline.poses_at(np.array([9.5])))[0], middle, atol=1e-6)
    # At rest at the ends, and at every key with a tension of 1.
    for tension, knots in ((0.0, KNOTS[[0, -1]]), (1.0, KNOTS)):
        tense = PointSpline(faces, KNOTS, poses, tension)
        before, after = tense.poses_at(np.clip(knots - 1e-4, 0, 30)), tense.poses_at(np.clip(knots + 1e-4, 0, 30))
        assert np.abs(after - before).max() < 1e-6


def test_few_dimensions_keep_what_expressions_have_in_common(low: FaceModel, faces: PointFaces) -> None:
    poses = draws(low, 40)
    fitted = [PointFaces.fit(faces.training, dimensions) for dimensions in (4, 20)]
    errors = [((one.poses_of(one.points_of(poses)) - poses) ** 2).sum() for one in fitted]
    assert errors[1] < 0.5 * errors[0] < 0.5 * (poses**2).sum()
    assert faces.mapping is not None
    assert faces.mapping.points.n_dimensions == DIMENSIONS


@pytest.mark.parametrize("components", [1, 3])
def test_faces_are_a_continuous_function_of_their_points(low: FaceModel, components: int) -> None:
    faces = PointFaces.fit(point_faces(low).training, components=components)
    spline = PointSpline(faces, KNOTS, draws(low, 4))
    times = np.linspace(0.0, 30.0, 3_001)
    fine = np.abs(np.diff(spline.poses_at(times), axis=0)).max()
    finer = np.abs(np.diff(spline.poses_at(np.linspace(0.0, 30.0, 48_001)), axis=0)).max()
    assert finer < 0.2 * fine, "a jump would remain as large as it is"


@pytest.mark.parametrize("kept", [0, 1, 4])
def test_characters_with_few_feature_points(low: FaceModel, kept: int) -> None:
    whole = TrainingPoses.of(low)
    few = replace(
        whole,
        points=whole.points[:, :kept],
        names=whole.names[:kept],
        neutral=whole.neutral[:kept],
        rows=whole.rows[:kept],
    )
    faces = PointFaces.fit(few)
    poses = draws(low, 4)
    spline = PointSpline(faces, KNOTS, poses)
    np.testing.assert_allclose(spline.poses_at(KNOTS) + spline.residuals, poses, atol=1e-9)
    assert np.isfinite(spline.poses_at(np.linspace(0, 30, 50))).all()
    if not kept:
        np.testing.assert_array_equal(spline.residuals, poses)


def test_feature_points_that_never_move_say_nothing(low: FaceModel) -> None:
    whole = TrainingPoses.of(low)
    still = replace(whole, points=np.zeros_like(whole.points) + whole.neutral, rows=np.zeros_like(whole.rows))
    poses = draws(low, 4)
    np.testing.assert_array_equal(PointSpline(PointFaces.fit(still), KNOTS, poses).residuals, poses)


def test_the_expectation_over_a_mixture_is_that_of_its_joint_density() -> None:
    rng = np.random.default_rng(0)
    data = np.concatenate([rng.normal(size=(60, 4)) @ rng.normal(size=(4, 4)) + shift for shift in (0.0, 3.0)])
    mixture = PPCAMixture.fit(data, 2, 2)
    seen, values = np.array([0, 2]), data[::17, [0, 2]]
    grid = np.linspace(-25.0, 25.0, 401)
    first, second = np.meshgrid(grid, grid, indexing="ij")
    for row, found in zip(values, mixture.expected(seen, values), strict=True):
        samples = np.empty((first.size, 4))
        samples[:, [0, 2]], samples[:, 1], samples[:, 3] = row, first.ravel(), second.ravel()
        shares = np.exp(mixture.log_densities(samples))
        np.testing.assert_allclose(found, shares @ samples[:, [1, 3]] / shares.sum(), atol=1e-3)
    # With one component, completion takes the same values.
    one = PPCAMixture.fit(data, 1, 2)
    np.testing.assert_allclose(one.expected(seen, values), one.completed(seen, values)[:, [1, 3]], atol=1e-9)
