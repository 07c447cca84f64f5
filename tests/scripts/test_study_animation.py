"""What measures animation says what it says it does; it is run whole by hand."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from faceposer.geometry.camera import OrbitView
from faceposer.model.character import ARKIT_SHAPES
from faceposer.model.face_model import FaceModel
from faceposer.model.performance import Performance
from faceposer.model.shape_names import weight_map
from faceposer.training.expressions import Recipe
from scripts import study_animation
from scripts.study_animation import Case, Study, jump_free_runs, with_gaps, with_jumps
from tests.command_line import run_script
from tests.evaluation.performances import weights, write_take

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture
def study(model: FaceModel) -> Study:
    vertices = model.character.vertices
    camera = OrbitView.preset(vertices.min(axis=0), vertices.max(axis=0)).camera((800, 800))
    setting: Any = SimpleNamespace(
        model=model, camera=camera, recipe=Recipe(), rig_weights=lambda frames: rig(model, frames)
    )
    return Study(setting)


def rig(model: FaceModel, frames: np.ndarray) -> np.ndarray:
    return frames @ weight_map(model.character.shape_names, ARKIT_SHAPES).T


def test_measures_of_the_truth_and_of_a_face_that_stays(study: Study) -> None:
    model = study.model
    true = rig(model, weights(30, 0))
    same = study.measures(Performance.from_weights(model, true, 30.0), true)
    assert same["error"] < 0.05 * same["of neutral"]
    assert same["jerk"] == pytest.approx(same["jerk of truth"], rel=0.1)
    still = study.measures(Performance(np.zeros((30, model.n_coefficients)), 30.0), true)
    assert still["error"] == pytest.approx(still["of neutral"])
    assert still["jerk"] == still["worst"] == 0.0


def test_a_case_is_followed_as_it_says(study: Study) -> None:
    runs = [rig(study.model, weights(20, seed)) for seed in range(2)]
    problem = study_animation.following._FrameProblems.problem
    near, neutral = (Case("", {}, from_neutral=flag).run(study, runs) for flag in (False, True))
    rough = Case("", {"smoothness": 0.0}).run(study, runs)
    assert study_animation.following._FrameProblems.problem is problem
    assert near["error"] != neutral["error"]
    assert near["jerk"] < rough["jerk"]
    assert near["error"] < near["of neutral"]


def test_gaps_and_jumps_are_where_they_are_said_to_be(study: Study) -> None:
    tracks = study.tracked(rig(study.model, weights(200, 0)), 0.0)
    gaps = ~with_gaps(tracks).seen
    assert gaps[100:130].all()
    assert 0.1 < gaps[:100].mean() < 0.25
    moved = np.abs(with_jumps(tracks).positions - tracks.positions).max(axis=2) > 0
    assert 0.005 < moved.mean() < 0.04


def test_runs_have_no_jump_of_the_tracker(study: Study, tmp_path: Path) -> None:
    frames = weights(100, 0)
    frames[35, ARKIT_SHAPES.index("noseSneerLeft")] = 0.9
    path = write_take(tmp_path / "take.csv", frames)
    assert [first for first, _ in jump_free_runs(study.setting, path, 20)] == [0, 36, 56, 76]
    assert [first for first, _ in jump_free_runs(study.setting, path, 20, (0.5, 1.0))] == [50, 70]


def test_without_captures_it_says_what_to_set() -> None:
    result = run_script("study_animation", FACEPOSER_CAPTURES=None)
    assert result.returncode == 1
    assert "FACEPOSER_CAPTURES" in result.stderr
