"""Weights within their limits for many frames at once are those that an exact solver finds for each."""

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from faceposer.model.character_file import load_character
from faceposer.model.face_model import FaceModel, build_face_model
from faceposer.solve import weight_fit
from faceposer.solve.weight_fit import fit_weights, fit_weights_of_frames


def excess(model: FaceModel, pose: np.ndarray, weights: np.ndarray) -> float:
    """Return by which share the squared distance of ``weights`` from ``pose`` exceeds the least possible."""
    squared, axes = np.linalg.eigh(model.gram)
    moving = squared > 1e-9 * squared[-1]
    half = np.sqrt(squared[moving])[:, None] * axes[:, moving].T
    wanted = half @ model.weights_of(pose)
    best = 2.0 * lsq_linear(half, wanted, bounds=model.character.shape_limits.T.astype(float), method="bvls").cost
    return float(np.sum((half @ weights - wanted) ** 2) - best) / max(best, 1e-6)


@pytest.mark.parametrize("name", ["low", "creature"])
def test_every_frame_is_the_least_squares_within_the_limits(name: str) -> None:
    model = build_face_model(load_character(name))
    rng = np.random.default_rng(1)
    poses = 3.0 * rng.standard_normal((40, model.n_coefficients)) * np.sqrt(model.subspace.variances)
    weights = fit_weights_of_frames(model, poses)
    lower, upper = model.character.shape_limits.T
    assert ((weights >= lower) & (weights <= upper)).all()
    assert ((weights == lower) | (weights == upper)).any(axis=1).all(), "limits are what this is about"
    assert max(excess(model, pose, row) for pose, row in zip(poses, weights, strict=True)) < 1e-5


def test_it_does_not_depend_on_the_frame_before(model: FaceModel) -> None:
    rng = np.random.default_rng(3)
    poses = 2.0 * rng.standard_normal((6, model.n_coefficients)) * np.sqrt(model.subspace.variances)
    together = fit_weights_of_frames(model, poses)
    for pose, row in zip(poses, together, strict=True):
        alone = fit_weights(model, pose)
        np.testing.assert_allclose(row, [*alone.values()], atol=1e-5)


def test_the_exact_method_takes_over_where_sets_do_not_settle(
    model: FaceModel, monkeypatch: pytest.MonkeyPatch
) -> None:
    pose = model.coefficients_of({"jawOpen": 1.4, "mouthSmileLeft": -0.5, "eyeBlinkLeft": 0.5})
    quick = fit_weights_of_frames(model, pose[None])
    monkeypatch.setattr(weight_fit, "_MOST_STEPS", 0)
    np.testing.assert_allclose(fit_weights_of_frames(model, pose[None]), quick, atol=1e-4)


def test_shapes_that_move_nothing_and_shapes_without_room_are_left_alone(model: FaceModel) -> None:
    from dataclasses import replace

    character = model.character
    shapes, limits = character.shapes.copy(), character.shape_limits.copy()
    jaw, tongue = character.shape_names.index("jawOpen"), character.shape_names.index("tongueOut")
    shapes[tongue] = 0.0
    limits[jaw] = 0.25
    other = build_face_model(replace(character, shapes=shapes, shape_limits=limits))
    weights = fit_weights(other, other.coefficients_of({"jawOpen": 1.0, "mouthSmileLeft": 0.5}))
    assert weights["jawOpen"] == pytest.approx(0.25)
    assert weights["tongueOut"] == 0.0
