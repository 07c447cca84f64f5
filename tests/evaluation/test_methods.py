from dataclasses import replace

import numpy as np
import pytest

from faceposer.evaluation.measures import Evaluator, residual_px
from faceposer.evaluation.methods.method import prepared
from faceposer.evaluation.methods.registry import METHODS
from faceposer.evaluation.setting import StudyContext
from faceposer.evaluation.trials import Cell, TrialMaker
from faceposer.model.character import ARKIT_SHAPES
from faceposer.model.character_file import load_character
from faceposer.training.capture import Capture
from faceposer.training.expressions import Recipe

# What needs no mixture of its own is quick to prepare.
QUICK = ("ppca", "pca", "lwr", "interp-all", "opt-blend", "bounded-weights")


def performance(frames: int, seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    weights = np.zeros((frames, len(ARKIT_SHAPES)))
    for names in (("mouthSmileLeft", "mouthSmileRight"), ("jawOpen",), ("browInnerUp",), ("mouthPucker",)):
        strength = rng.uniform(0.0, 0.8, frames)
        for name in names:
            weights[:, ARKIT_SHAPES.index(name)] = strength
    return weights


@pytest.fixture(scope="module")
def setting():
    # Random frames jump all the time.
    recipe = replace(Recipe(), jump=9.0, n_examples=400, n_components=2, n_factors=3)
    capture = Capture(ARKIT_SHAPES, performance(60, 0))
    return StudyContext.of(load_character("low"), [capture], recipe)


@pytest.fixture(scope="module")
def unseen(setting):
    return setting.rig_weights(performance(20, 1))


@pytest.mark.parametrize(("kind", "count"), [("point", 4), ("distance", 4), ("stroke", 450)])
def test_constraints_without_noise_are_met_by_the_frame_that_they_come_from(setting, unseen, kind, count):
    trials = list(TrialMaker(setting).trials(Cell(kind, count, 0.0), unseen, 3, 0))
    assert len(trials) == 3
    for trial in trials:
        vertices = setting.vertices_of(trial.weights)
        assert all(residual_px(setting, constraint, vertices) < 1.0 for constraint in trial.constraints)
        neutral = setting.character.vertices
        assert np.mean([residual_px(setting, constraint, neutral) for constraint in trial.constraints]) > 0.5


def test_noise_moves_targets_and_the_seed_repeats_them(setting, unseen):
    maker = TrialMaker(setting)
    exact, noisy, again = (
        next(maker.trials(Cell("point", 4, noise), unseen, 1, 3)).constraints for noise in (0.0, 1.5, 1.5)
    )
    assert noisy == again
    assert [c.anchor for c in exact] == [c.anchor for c in noisy]
    assert all(a.target != b.target for a, b in zip(exact, noisy, strict=True))


@pytest.mark.parametrize("name", QUICK)
def test_each_method_comes_nearer_than_the_neutral_face(setting, unseen, name):
    method, judge = prepared(METHODS[name], setting), Evaluator(setting, unseen)
    trials = list(TrialMaker(setting).trials(Cell("point", 16, 0.0), unseen, 5, 0))
    scores = [judge.score(trial, method.vertices(method.solve(trial.constraints)), 0.0) for trial in trials]
    assert sum(score.error for score in scores) < 0.7 * sum(score.neutral_error for score in scores)


def test_a_real_frame_is_natural_and_a_broken_face_is_not(setting, unseen):
    judge = Evaluator(setting, unseen)
    real = setting.vertices_of(unseen[0])
    nearest, likelihood = judge.naturalness(real)
    assert nearest < 1e-3
    broken = real + np.random.default_rng(0).normal(0.0, 0.5, real.shape)
    far, unlikely = judge.naturalness(broken)
    assert far > 0.1
    assert unlikely < likelihood
