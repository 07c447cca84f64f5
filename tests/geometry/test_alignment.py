"""Known motions are found again, mirrored points do not mirror the result, and lines are refused."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from faceposer.geometry.alignment import determines_rotation, rigid_alignment


def random_motions(n: int, seed: int = 0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    return Rotation.random(n, random_state=rng).as_matrix(), rng.normal(size=(n, 3)), rng.uniform(0.5, 3.0, n)


def moved(points: np.ndarray, rotation: np.ndarray, shift: np.ndarray, scale: np.ndarray) -> np.ndarray:
    return scale[:, None, None] * np.einsum("fij,mj->fmi", rotation, points) + shift[:, None, :]


@pytest.mark.parametrize("scaled", [False, True])
def test_known_motions_are_found_again(scaled: bool) -> None:
    points = np.random.default_rng(1).normal(size=(7, 3)) * [1.0, 3.0, 0.2] + 50.0
    rotation, shift, scale = random_motions(5)
    scale = scale if scaled else np.ones(5)
    targets = moved(points, rotation, shift, scale)
    motion = rigid_alignment(points, targets, scale=scaled)
    np.testing.assert_allclose(motion.rotation, rotation, atol=1e-9)
    np.testing.assert_allclose(motion.translation, shift, atol=1e-6)
    np.testing.assert_allclose(motion.scale, scale, atol=1e-9)
    np.testing.assert_allclose(motion.apply(points), targets, atol=1e-9)
    np.testing.assert_allclose(motion.inverse().apply(targets), np.broadcast_to(points, targets.shape), atol=1e-9)
    np.testing.assert_allclose(
        motion.apply_to_directions(points[1:] - points[:1]), targets[:, 1:] - targets[:, :1], atol=1e-9
    )
    one = rigid_alignment(points, targets[3], scale=scaled)
    np.testing.assert_allclose(one.rotation, rotation[3], atol=1e-9)
    assert one.scale.shape == ()


def test_a_mirror_image_is_turned_but_never_mirrored() -> None:
    points = np.random.default_rng(2).normal(size=(10, 3))
    motion = rigid_alignment(points, points * [-1.0, 1.0, 1.0], scale=True)
    assert np.linalg.det(motion.rotation) == pytest.approx(1.0)
    assert motion.scale > 0.0
    # Points in a plane do fit their mirror image: turned over.
    flat = points * [1.0, 1.0, 0.0]
    turned = rigid_alignment(flat, flat * [-1.0, 1.0, 1.0])
    assert np.linalg.det(turned.rotation) == pytest.approx(1.0)
    np.testing.assert_allclose(turned.apply(flat), flat * [-1.0, 1.0, 1.0], atol=1e-12)


def test_the_result_is_the_best_of_its_kind() -> None:
    rng = np.random.default_rng(3)
    source, target, weights = rng.normal(size=(9, 3)), rng.normal(size=(9, 3)), rng.random(9)

    def cost(rotation: np.ndarray, shift: np.ndarray, scale: float) -> float:
        return float(weights @ np.sum((scale * source @ rotation.T + shift - target) ** 2, axis=1))

    motion = rigid_alignment(source, target, weights, scale=True)
    best = cost(motion.rotation, motion.translation, float(motion.scale))
    for _ in range(50):
        nudge = Rotation.from_rotvec(rng.normal(scale=0.02, size=3)).as_matrix()
        assert cost(nudge @ motion.rotation, motion.translation, float(motion.scale)) >= best
        assert cost(motion.rotation, motion.translation + rng.normal(scale=0.02, size=3), float(motion.scale)) >= best
        assert cost(motion.rotation, motion.translation, float(motion.scale) + rng.normal(scale=0.02)) >= best


def test_points_without_weight_and_missing_ones_do_not_count() -> None:
    points = np.random.default_rng(4).normal(size=(6, 3))
    rotation, shift, _ = random_motions(2)
    targets = moved(points, rotation, shift, np.ones(2))
    targets[0, 0] += 100.0
    targets[1, 1] = np.nan
    weights = np.ones((2, 6))
    weights[0, 0] = 0.0
    motion = rigid_alignment(points, targets, weights)
    np.testing.assert_allclose(motion.rotation, rotation, atol=1e-9)
    source = points.copy()
    source[5, 2] = np.nan
    np.testing.assert_allclose(rigid_alignment(source, targets, weights).rotation, rotation, atol=1e-9)


def test_what_tells_no_rotation_is_refused() -> None:
    points = np.random.default_rng(5).normal(size=(4, 3))
    line = np.outer(np.arange(4.0), [1.0, 2.0, 3.0]) + 7.0
    assert determines_rotation(points)
    assert not determines_rotation(line)
    assert determines_rotation(np.stack([points, line])).tolist() == [True, False]
    gone = points.copy()
    gone[:2] = np.nan
    for source, target, weights in (
        (line, points, None),
        (points, line, None),
        (points[:2], points[:2], None),
        (gone, points, None),
        (points, points, [1.0, 1.0, 0.0, 0.0]),
        (points, np.stack([points, line]), None),
        (points, points, [-1.0, 1.0, 1.0, 1.0]),
        (points, points[:3], None),
        (points[:, :2], points[:, :2], None),
    ):
        with pytest.raises(ValueError):  # noqa: PT011
            rigid_alignment(source, target, weights)
