"""The study of sketching draws with the errors that it states, knows what it drew, and counts honestly."""

import json
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest

from faceposer.evaluation.setting import StudyContext
from faceposer.evaluation.sketching.artist import Artist, TrueStroke
from faceposer.evaluation.sketching.hand_errors import HandErrors, drawn
from faceposer.evaluation.sketching.points import point_errors, true_points
from faceposer.evaluation.sketching.report import METHODS, confusion_of, reliability_of, summary
from faceposer.evaluation.sketching.scribbles import KINDS, scribble
from faceposer.evaluation.sketching.study import (
    COUNTS,
    SketchingStudy,
    Tally,
    expressions,
    row_of,
    trials_of,
    view_camera,
)
from faceposer.model.character_file import load_character
from faceposer.model.face_model import FaceModel
from faceposer.model.feature_curves import FEATURES
from faceposer.model.framing import face_view
from faceposer.sketch.recognition import Candidate
from scripts import study_sketching
from tests.evaluation.performances import weights

EXACT = HandErrors(jitter=0.0, shift=0.0, length=0.0, unevenness=0.0)


@lru_cache(maxsize=1)
def setting() -> StudyContext:
    context = StudyContext.of(load_character("low"), [])
    # The shipped statistics, instead of half a minute of training.
    from faceposer.model.face_model import build_face_model

    context.__dict__["model"] = build_face_model(context.character)
    return context


@lru_cache(maxsize=1)
def frames() -> np.ndarray:
    return setting().rig_weights(weights(60, 0))


def artist(view: str = "front", frame: int = 20) -> Artist:
    return Artist(setting().character, setting().vertices_of(frames()[frame]), view_camera(setting(), view))


def test_errors_of_the_hand_have_their_sizes() -> None:
    line = np.stack([np.linspace(0.0, 400.0, 200), np.zeros(200)], axis=1)
    at = np.linspace(0.0, 4.0, 200)
    rng = np.random.default_rng(0)
    strokes = [drawn(line, at, False, HandErrors(length=0.0, shift=0.0), rng).pixels for _ in range(200)]
    assert np.std(np.concatenate([stroke[:, 1] for stroke in strokes])) == pytest.approx(3.0, rel=0.1)
    shifted = [drawn(line, at, False, HandErrors(jitter=0.0, length=0.0), rng).pixels[:, 1] for _ in range(200)]
    assert max(np.ptp(stroke) for stroke in shifted) < 1e-9
    assert np.sqrt(np.mean([stroke[0] ** 2 for stroke in shifted])) == pytest.approx(6.0 / np.sqrt(2.0), rel=0.1)
    sized = [np.ptp(drawn(line, at, False, HandErrors(jitter=0.0, shift=0.0), rng).pixels[:, 0]) for _ in range(200)]
    assert 0.85 * 400.0 - 2.0 < min(sized) < 0.88 * 400.0
    assert 1.12 * 400.0 < max(sized) < 1.15 * 400.0 + 2.0
    backwards = np.mean([stroke[0, 0] > stroke[-1, 0] for stroke in strokes])
    assert 0.35 < backwards < 0.65


def test_parameters_are_those_of_the_line() -> None:
    line = np.stack([np.linspace(0.0, 400.0, 401), np.zeros(401)], axis=1)
    for seed in range(10):
        result = drawn(line, line[:, 0], False, HandErrors(jitter=0.0, shift=0.0), np.random.default_rng(seed))
        assert np.abs(result.pixels[:, 0].clip(0.0, 400.0) - result.parameters).max() < 2.0
        steps = np.abs(np.diff(result.pixels[:, 0]))
        assert steps.max() > 1.5 * steps.min()


def test_an_artist_draws_one_line_of_a_closed_mouth_and_two_of_an_open_one() -> None:
    names = setting().character.shape_names
    closed, opened = np.zeros(len(names)), np.zeros(len(names))
    opened[names.index("jawOpen")] = 0.7
    camera = view_camera(setting(), "front")
    at_rest = Artist(setting().character, setting().vertices_of(closed), camera).lines
    open_mouth = Artist(setting().character, setting().vertices_of(opened), camera).lines
    assert "mouth line" in at_rest
    assert not {"inner upper lip", "inner lower lip"} & at_rest.keys()
    assert {"inner upper lip", "inner lower lip"} <= open_mouth.keys()
    assert "mouth line" not in open_mouth
    blink = np.zeros(len(names))
    blink[names.index("eyeBlinkLeft")] = 1.0
    blinking = Artist(setting().character, setting().vertices_of(blink), camera).lines
    assert "left lower lid" not in blinking
    assert {"left upper lid", "right lower lid"} <= blinking.keys()


def test_hidden_features_are_not_drawn() -> None:
    character = setting().character
    camera = face_view(character, "left").camera((960, 960))
    lines = Artist(character, character.vertices, camera).lines
    assert "left brow" in lines
    assert "right brow" not in lines
    assert "right cheek line" not in lines


def test_true_points_have_no_error() -> None:
    rng = np.random.default_rng(1)
    for view in ("front", "three-quarter"):
        drawing = artist(view)
        for name in drawing.lines:
            true = drawing.draw(name, HandErrors(), rng)
            points = true_points(true)
            assert {point.feature_point for point in points} <= set(FEATURES[name].points)
            assert np.max(point_errors(true, Candidate(name, 1.0, points)), initial=0.0) < 0.5
            assert np.isinf(point_errors(true, None)).all()
            other = FEATURES[name].mirror
            if other != name:
                assert np.isinf(point_errors(true, Candidate(other, 1.0, points))).all()


def test_exact_strokes_give_the_true_face_and_scribbles_none() -> None:
    study = SketchingStudy(setting(), 60)
    trials = trials_of(setting(), expressions(setting(), frames(), 1, 0), EXACT, 0, (8,))
    tally, given = Tally(), Tally()
    for trial in trials:
        study.run(trial, "ours", tally)
        study.run_given(trial, given)
    key = {"character": "low", "view": "both", "strokes": 8, "recognition": "ours", "training": 60}
    rows = {method: row_of(tally, method, key, given) for method in METHODS}
    assert rows["map"]["feature_accuracy"] > 0.8
    assert rows["map"]["point_accuracy"] > 0.7
    assert rows["true-points"]["error_3d_relative"] < 0.4
    assert rows["map-corrected"]["error_3d_relative"] < 1.5 * rows["true-points"]["error_3d_relative"]
    assert rows["map"]["ci95"][0] <= rows["map"]["error_3d_relative"] <= rows["map"]["ci95"][1]
    shares = study.accepted(view_camera(setting(), "front"), 3, np.random.default_rng(0), "ours")
    assert shares.keys() == KINDS.keys()
    assert np.mean(list(shares.values())) < 0.15


def test_trials_have_their_numbers_of_strokes_in_order() -> None:
    trials = trials_of(setting(), frames()[20:21], HandErrors(), 0)
    assert [(trial.view, trial.count) for trial in trials] == [
        (view, count) for view in ("front", "three-quarter") for count in COUNTS
    ]
    order = list(FEATURES)
    for trial in trials:
        names = [true.feature for true in trial.strokes]
        assert len(names) == min(trial.count, len(names))
        assert names == sorted(names, key=order.index)
        assert not any(a in FEATURES[b].components for a in names for b in names)
    mixed = trials_of(setting(), frames()[20:21], HandErrors(), 0, (8,), any_order=True)
    drawn_in = [[order.index(true.feature) for true in trial.strokes] for trial in mixed]
    assert all(len(set(places)) == len(places) > 4 and places != sorted(places) for places in drawn_in)


@pytest.mark.parametrize("kind", list(KINDS))
def test_scribbles_have_their_extents(kind: str) -> None:
    rng = np.random.default_rng(0)
    for _ in range(5):
        pixels = scribble(kind, np.array([480.0, 480.0]), 100.0, rng)
        extent = float(np.hypot(*np.ptp(pixels, axis=0)))
        least, most = KINDS[kind][1]
        assert 0.5 * least <= extent <= 1.6 * most
        assert np.isfinite(pixels).all()


def test_tables_count_right_and_wrong_strokes() -> None:
    strokes = [("left brow", "left brow", 0.95, 0), ("left brow", "left upper lid", 0.6, 1), ("jaw line", None, 0.4, 0)]
    results = [
        {
            "training": 36,
            "recognition": "ours",
            "rows": [],
            "strokes": strokes,
            "points": [0.2, 1.4, float("inf"), 0.9],
            "scribbles": {"training": 36, "recognition": "ours", "accepted": 0.1, "kinds": {"dot": 0.1}},
        }
    ]
    (confusion,) = confusion_of(results)
    assert confusion["strokes"] == 3
    assert confusion["feature_accuracy"] == pytest.approx(1.0 / 3.0, abs=1e-4)
    assert confusion["feature_accuracy_first_stroke"] == 0.5
    assert confusion["point_accuracy"] == 0.5
    assert confusion["counts"]["left brow"] == {"left brow": 1, "left upper lid": 1}
    assert confusion["counts"]["jaw line"] == {"none": 1}
    (reliability,) = reliability_of(results)
    assert [b["strokes"] for b in reliability["bins"]] == [1, 1, 1]
    document = {
        "rows": [],
        "confusion": [confusion],
        "reliability": [reliability],
        "scribbles_accepted": [results[0]["scribbles"]],
    }
    assert "33.3% of 3 features right" in summary(document)


def test_strokes_know_their_feature(low: FaceModel) -> None:
    true = artist().draw("left brow", EXACT, np.random.default_rng(0))
    assert isinstance(true, TrueStroke)
    assert true.feature == "left brow"
    assert true.span == (0.0, 2.0)
    assert low.character.name == setting().character.name


def test_the_script_names_missing_captures(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("sys.argv", ["study_sketching.py", "--short"])
    monkeypatch.setenv("FACEPOSER_CAPTURES", "")
    with pytest.raises(SystemExit):
        study_sketching.main()
    assert "set FACEPOSER_CAPTURES" in capsys.readouterr().err
    monkeypatch.setenv("FACEPOSER_CAPTURES", str(tmp_path))
    with pytest.raises(SystemExit, match=r"study_sketching: .*alex_rom_3\.csv"):
        study_sketching.main()


def test_rows_are_json() -> None:
    row = row_of(_filled(), "map", {"strokes": 1}, Tally())
    assert json.loads(json.dumps(row))["feature_accuracy"] == 1.0


def _filled() -> Tally:
    return Tally(
        [("left brow", "left brow", 1.0, 0)], [0.1], {"map": [(0.5, 1.0)]}, {"map": [3.0], "recognition": [4.0]}
    )
