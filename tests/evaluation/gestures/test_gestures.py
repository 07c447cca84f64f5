"""Gestures are data, a hand makes them by the program's own tools, and rows judge what they leave."""

import json
import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from faceposer.errors import FacePoserError
from faceposer.evaluation.gestures.characters import load_study_character
from faceposer.evaluation.gestures.expressions import EXPRESSIONS
from faceposer.evaluation.gestures.gesture import HEAD_HEIGHT, Gesture, Limit, Paint, Pull, least, most
from faceposer.evaluation.gestures.hand import Hand, Performed, PriorSettings, has_places, place_vertex
from faceposer.evaluation.gestures.measures import FaceChange, known_unit, region_ids, sided, skin_outside
from faceposer.evaluation.gestures.pictures import studio
from faceposer.evaluation.gestures.report import blind_order, run, write_json, write_page
from faceposer.evaluation.gestures.rows import missed, perform, row_of, study
from faceposer.evaluation.gestures.table import BY_NAME, GESTURES
from faceposer.evaluation.gestures.tables import BEGIN, END, spliced, summary
from faceposer.model.character import ARKIT_SHAPES
from faceposer.model.face_model import FaceModel
from faceposer.solve.map_solver import solve
from faceposer.solve.problem import PoseProblem

ROOT = Path(__file__).resolve().parents[3]
NOTHING = Gesture("nothing", "Nothing", (), ("mouth",))


def posed(model: FaceModel, weights: dict[str, float]) -> FaceChange:
    """Return the change to a pose with these weights, as if a gesture had left it."""
    return FaceChange(Performed(NOTHING, model, model.coefficients_of(weights), (), (), (), "regions"))


# The table


def test_table_speaks_of_what_can_be_measured(model: FaceModel) -> None:
    everything = (*GESTURES, *EXPRESSIONS)
    assert len(BY_NAME) == len(everything)
    assert len(GESTURES) >= 24
    assert len(EXPRESSIONS) == 7
    assert all(len(gesture.actions) <= 3 for gesture in EXPRESSIONS)
    assert {action.view for gesture in GESTURES for action in gesture.actions} >= {"front", "right", "three-quarter"}
    for gesture in everything:
        assert has_places(model.character, gesture), gesture.name
        assert all(known_unit(limit.unit) for limit in gesture.limits), gesture.name
        assert all(len(region_ids(model.character, region)) for region in gesture.concerned), gesture.name
        assert gesture.limits or gesture.spill_mm is not None
    assert {gesture.name for gesture in blind_order()} == {gesture.name for gesture in EXPRESSIONS}


def test_units_and_limits() -> None:
    assert sided("eyeBlink") == ("eyeBlinkLeft", "eyeBlinkRight")
    assert sided("jawOpen") == ("jawOpen",)
    assert sided("corner_up") == ("corner_left_up", "corner_right_up")
    assert sided("lids_close") == ("lids_left_close", "lids_right_close")
    assert not known_unit("corner_sideways")
    assert not known_unit("chin_out")
    assert not known_unit("teeth_up")
    assert least("corner_up", 2.0).holds(2.0)
    assert least("corner_up", 2.0).missed_by(1.5) == 0.5
    assert most("jawOpen", 0.1).missed_by(0.3) == pytest.approx(0.2)
    assert most("jawOpen", 0.1).missed_by(0.0) == 0.0
    with pytest.raises(ValueError, match="one of"):
        Limit("jawOpen")
    with pytest.raises(ValueError, match="one of"):
        Limit("jawOpen", 0.1, 0.2)


# What a hand does


def test_a_pull_is_a_drag_of_the_point_tool(model: FaceModel) -> None:
    hand = Hand(model)
    performed = hand.perform(BY_NAME["corners_up_out"])
    left, right = performed.drawn
    position = model.character.vertices[[model.character.feature_points["8.3"]]]
    np.testing.assert_allclose(left.source, left.camera.project(position))
    millimetre = 0.1 * model.character.height / HEAD_HEIGHT
    moved = left.camera.project(position + millimetre * np.array([4.2, 4.2, 0.0]))
    np.testing.assert_allclose(left.target, moved, atol=1e-6)
    assert right.pulled_px == pytest.approx(left.pulled_px, rel=0.02)
    assert right.target[0, 0] < right.source[0, 0]
    assert max(performed.residuals_px) < left.pulled_px
    # The pose is what the constraints ask for, however the hand came there.
    again = solve(PoseProblem(model, hand.session.document.constraints)).coefficients
    np.testing.assert_allclose(model.instance(performed.pose), model.instance(again), atol=0.02)
    assert hand.session.undo_label == "Place a point"


def test_a_stroke_narrows_the_mouth(model: FaceModel) -> None:
    gesture = replace(NOTHING, actions=(Paint(("8.4", "2.7", "2.2", "2.6", "8.3"), narrower=0.6),))
    performed = perform(model, gesture)
    assert performed.residuals_px[0] < performed.drawn[0].pulled_px
    assert min(FaceChange(performed).values("corner_in").values()) > 1.0


def test_lids_close_onto_each_other(low: FaceModel) -> None:
    performed = perform(low, BY_NAME["lids_close"])
    vertices = low.character.vertices[[low.character.feature_points[key] for key in ("3.1", "3.3")]]
    begin, end = performed.drawn[0].camera.project(vertices)
    np.testing.assert_allclose(performed.drawn[0].source[0], begin)
    np.testing.assert_allclose(performed.drawn[0].target[0], end, atol=1e-6)


def test_settings_reach_the_solve(low: FaceModel) -> None:
    loose = perform(low, BY_NAME["brow_up_left"], PriorSettings(weight=0.1))
    firm = perform(low, BY_NAME["brow_up_left"], PriorSettings(weight=10.0))
    assert loose.residuals_px[0] < firm.residuals_px[0]
    assert perform(low, BY_NAME["brow_up_left"], PriorSettings("whole")).prior == "whole"


def test_places_that_are_not_there(low: FaceModel) -> None:
    with pytest.raises(FacePoserError, match="neither a feature point nor a region 'antenna'"):
        place_vertex(low.character, "antenna")
    assert not has_places(low.character, replace(NOTHING, actions=(Pull("8.3", onto="antenna"),)))
    # The middle of the chin has no other side.
    with pytest.raises(FacePoserError, match="mirror image"):
        perform(low, replace(NOTHING, actions=(Pull("2.10", 0.0, -4.0, both=True),)))


# What is measured


def test_measures_of_poses(model: FaceModel) -> None:
    still = posed(model, {})
    for limit in (limit for gesture in BY_NAME.values() for limit in gesture.limits):
        assert still.values(limit.unit)
        assert all(abs(value) < 1e-3 for value in still.values(limit.unit).values()), limit.unit
    jaw = posed(model, {"jawOpen": 0.5})
    assert jaw.values("mouth_opens")["mouth_opens"] > 5.0
    assert jaw.values("chin_down")["chin_down"] > 5.0
    assert jaw.values("chin_moved")["chin_moved"] >= jaw.values("chin_down")["chin_down"]
    assert jaw.values("mouth_mean")["mouth_mean"] > 1.0
    wink = posed(model, {"eyeBlinkLeft": 1.0}).values("lids_close")
    assert wink["lids_left_close"] > 0.8
    assert abs(wink["lids_right_close"]) < 0.1
    wide = posed(model, {"eyeWideLeft": 1.0}).values("lids_open")
    assert wide["lids_left_open"] > 0.1
    smile = posed(model, {"mouthSmileLeft": 0.5})
    assert smile.weights["mouthSmileLeft"] == pytest.approx(0.5, abs=0.1)
    corner = smile.values("corner_up") | smile.values("corner_out")
    assert corner["corner_left_up"] > 1.0 > abs(corner["corner_right_up"])
    assert corner["corner_left_out"] > 0.0


def test_a_millimetre_is_that_of_the_head(model: FaceModel) -> None:
    change = posed(model, {"jawOpen": 0.5})
    chin = model.character.feature_points["2.10"]
    moved = model.instance(change.performed.pose)[chin] - model.character.vertices[chin]
    share = float(-moved[1]) / model.character.height
    assert change.values("chin_down")["chin_down"] == pytest.approx(10.0 * HEAD_HEIGHT * share, rel=1e-4)


def test_gaze_turns_together_or_apart(model: FaceModel) -> None:
    together = posed(model, {"eyeLookInLeft": 0.5, "eyeLookOutRight": 0.5}).gaze_deg()
    apart = posed(model, {"eyeLookOutLeft": 0.3, "eyeLookOutRight": 0.3}).gaze_deg()
    assert together is not None
    assert apart is not None
    assert together < 1.0
    assert apart > 5.0


def test_spill_is_what_moves_elsewhere(model: FaceModel) -> None:
    outside = skin_outside(model.character, ("mouth", "cheek", "nose", "jaw", "neck"))
    assert not np.isin(model.character.regions["mouth"], outside).any()
    # But for the margin above the nose.
    assert np.isin(model.character.regions["forehead"], outside).mean() > 0.8
    assert len(skin_outside(model.character, tuple(model.character.regions))) == 0
    brows = posed(model, {"browOuterUpLeft": 1.0})
    assert brows.spill_mm(("mouth",)) > 4.0
    assert brows.spill_mm(("brow", "forehead", "lids", "scalp", "nose", "cheek")) < 1.2


def test_the_other_side(model: FaceModel) -> None:
    performed = perform(model, BY_NAME["corner_up_left"])
    left = replace(performed, pose=model.coefficients_of({"mouthSmileLeft": 0.5}))
    both = replace(performed, pose=model.coefficients_of({"mouthSmileLeft": 0.5, "mouthSmileRight": 0.5}))
    lone, even = FaceChange(left).other_side(), FaceChange(both).other_side()
    assert lone is not None
    assert lone < 0.3
    assert even == pytest.approx(1.0, abs=0.1)
    assert FaceChange(perform(model, BY_NAME["upper_lip_up"])).other_side() is None


# Rows


@pytest.mark.slow
def test_a_row_of_the_man(model: FaceModel) -> None:
    ((performed, row),) = study("man", model, [BY_NAME["corners_up_out"]], PriorSettings())
    assert row["character"] == "man"
    assert row["gesture"] == "corners_up_out"
    assert 0.0 <= row["residual_px"] < row["pulled_px"]
    assert row["must_move"].keys() >= {"corner_left_up", "mouthSmileRight", "cheekSquintLeft"}
    smile = row["must_move"]["mouthSmileLeft"]
    assert smile["weight"] == pytest.approx(FaceChange(performed).weights["mouthSmileLeft"], rel=1e-3)
    assert smile["at_least"] == 0.3
    assert row["must_not_move"]["jawOpen"]["at_most"] == 0.1
    assert row["must_not_move"]["mouth_opens"]["mm"] > -5.0
    assert set(row["gaze_deg"]) == {"regions", "whole", "plain"}
    assert row["limits"]["gaze"]["value"] == max(row["gaze_deg"].values())
    assert row["limits"]["residual"]["value"] == pytest.approx(row["residual_px"] / row["pulled_px"], rel=1e-2)
    assert 0.0 <= row["penetration_mm"] <= row["limits"]["penetration"]["at_most"]
    assert row["spill_mm"] >= 0.0
    assert row["solve_ms"] > 0.0
    json.dumps(row)


def test_limits_are_judged_both_ways(model: FaceModel) -> None:
    easy = Gesture(
        "easy",
        "Easy",
        (Pull("8.3", 4.2, 4.2),),
        tuple(model.character.regions),
        (least("corner_left_up", 1.0), most("corner_left_up", 9.0), most("noseSneerLeft", 1.0)),
        other_side=1.5,
        spill_mm=0.5,
        residual=0.9,
    )
    performed = perform(model, easy)
    row = row_of(performed, "man", {"regions": 0.2, "whole": None})
    assert row["holds"]
    assert missed(row) == []
    violated = {
        "must": replace(easy, limits=(least("corner_left_up", 50.0), least("corner_up", 60.0))),
        "must not": replace(easy, limits=(most("corner_left_up", 1.0),)),
        "weight": replace(easy, limits=(least("jawForward", 0.9),)),
        "other side": replace(easy, other_side=0.01),
        "spill": replace(easy, concerned=("ear",)),
        "residual": replace(easy, residual=-0.1),
    }
    for what, gesture in violated.items():
        row = row_of(replace(performed, gesture=gesture), "man", {"regions": 0.2})
        assert not row["holds"], what
        assert len(missed(row)) >= 1
    row = row_of(performed, "man", {"regions": 0.2, "plain": 4.0})
    assert not row["holds"]
    assert missed(row) == ["gaze (plain prior) 4 (≤ 1)"]
    both = row_of(replace(performed, gesture=violated["must"]), "man", {"regions": 0.2})
    assert len(both["must_move"]) == 2
    assert len(missed(both)) == 1
    assert "1 of 2 hold" in summary([row_of(performed, "man", {}), row | {"gesture": "other"}])


def test_a_character_of_modes_is_judged_by_geometry() -> None:
    goblin = load_study_character("creature")
    rows = {r["gesture"]: r for _, r in study("creature", goblin, [BY_NAME["brows_inner_down"]], PriorSettings())}
    row = rows["brows_inner_down"]
    assert row["weights"] == {}
    assert not set(row["must_move"]) & set(ARKIT_SHAPES)
    assert row["must_move"].keys() == {"brow_inner_left_down", "brow_inner_right_down"}
    assert "lids_left_close" in row["must_not_move"]


def test_rigs_need_their_folder(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("FACEPOSER_RIGS", raising=False)
    with pytest.raises(FacePoserError, match="FACEPOSER_RIGS"):
        load_study_character("facecap")


@pytest.mark.skipif("FACEPOSER_RIGS" not in os.environ, reason="FACEPOSER_RIGS names no folder of rigs")
def test_an_imported_rig() -> None:
    rig = load_study_character("facecap_multi")
    gestures = [BY_NAME["corners_up_out"], BY_NAME["neck_left"]]
    ((_, row),) = study("facecap_multi", rig, gestures, PriorSettings())
    assert row["gesture"] == "corners_up_out"
    assert row["must_move"]["corner_left_up"]["mm"] > 1.0


# What is written


@pytest.mark.slow
@pytest.mark.gl
def test_what_a_study_writes(tmp_path: Path) -> None:
    gestures = [BY_NAME["corners_up"], BY_NAME["pucker_stroke"], *EXPRESSIONS]
    told: list[str] = []
    rows = run(["low"], gestures, PriorSettings(), tmp_path / "pictures", tmp_path / "sheets", told.append)
    assert [row["gesture"] for row in rows] == [gesture.name for gesture in gestures]
    assert len(told) == 1
    assert {path.name for path in (tmp_path / "sheets").iterdir()} == {"gestures-low.jpg", "gestures-expressions.jpg"}
    pictures = {path.stem for path in (tmp_path / "pictures" / "low").iterdir()}
    assert pictures == {gesture.name for gesture in gestures}
    write_json(tmp_path / "rows.json", rows, PriorSettings())
    read = json.loads((tmp_path / "rows.json").read_text(encoding="utf-8"))
    assert read["settings"] == {"prior": "regions", "weight": 1.0, "spread": 0.5}
    assert read["rows"] == rows
    page = tmp_path / "page.md"
    page.write_text(f"Before.\n\n{BEGIN}\nstale\n{END}\n\nAfter.\n", encoding="utf-8")
    write_page(page, rows, PriorSettings())
    text = page.read_text(encoding="utf-8")
    assert text.startswith("Before.")
    assert text.endswith("After.\n")
    assert "stale" not in text
    assert "Both mouth corners up (`corners_up`)" in text
    assert "| Happiness |" in text
    with pytest.raises(FacePoserError, match="has no marks"):
        spliced("Without.", "Tables.")


def test_the_page_has_the_marks() -> None:
    page = (ROOT / "docs" / "gestures.md").read_text(encoding="utf-8")
    assert page.count(BEGIN) == page.count(END) == 1


@pytest.mark.gl
def test_pictures_show_the_pulls(low: FaceModel) -> None:
    gesture = BY_NAME["jaw_down"]
    performed = perform(low, gesture)
    with studio(low.character, 128) as room:
        before, plain, marked = room.before(gesture), room.after(performed, arrows=False), room.after(performed)
    assert before.size == (128, 128)
    opened = np.abs(np.asarray(before, dtype=int) - np.asarray(plain)).sum(axis=2)
    assert (opened > 30).sum() > 50
    drawn = np.abs(np.asarray(marked, dtype=int) - np.asarray(plain)).sum(axis=2) > 30
    rows, columns = np.nonzero(drawn)
    assert 0 < len(rows) < 400
    # The arrow hangs in the middle of the face, below its mouth.
    assert abs(columns.mean() - 64) < 8
    assert rows.min() > 64
