"""Studies on characters whose parts, regions and feature points are not those of the program's own heads."""

import json
import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from faceposer.cli import main
from faceposer.evaluation.measures import Evaluator
from faceposer.evaluation.methods import method as method_module
from faceposer.evaluation.methods.method import ModelMethod, prepared
from faceposer.evaluation.methods.registry import METHODS
from faceposer.evaluation.setting import StudyContext
from faceposer.evaluation.trials import Cell, TrialMaker, skin_vertices
from faceposer.model.character import ARKIT_SHAPES, Character
from faceposer.model.character_file import load_character, save_character
from faceposer.training.capture import Capture
from faceposer.training.expressions import Recipe
from tests.evaluation.performances import weights, write_take

RIGS = os.environ.get("FACEPOSER_RIGS")
METHODS_OF_ALL_KINDS = "mfa,mfa-whole,mfa-undamped,ppca,pca,lwr,opt-blend,interp-all,bounded-weights"
KINDS_AND_COUNTS = ("--counts", "point=1,8", "distance=4", "stroke=300", "--region-counts", "point=1", "stroke=300")


def foreign(**changes: object) -> Character:
    """Return the low head with parts of other names, the skin last."""
    low = load_character("low")
    parts = tuple(replace(part, name=f"Mesh {i} of {part.material}") for i, part in enumerate(low.parts))
    textures = {name: image for name, image in low.textures.items() if name in {part.material for part in parts}}
    return replace(low, name="foreign", parts=parts, textures=textures, **changes)  # type: ignore[arg-type]


def setting_of(character: Character) -> StudyContext:
    return StudyContext.of(character, [Capture(ARKIT_SHAPES, weights(120, 0))], Recipe(n_examples=300))


def study(capsys: pytest.CaptureFixture[str], folder: Path, character: Path, *words: str) -> tuple[int, str, str]:
    takes = [write_take(folder / f"{i}.csv", weights(90, i)) for i in (0, 1)]
    given = ("-o", folder / "study", "--character", character, "--capture", takes[0], "--capture-test", takes[1])
    given += ("--examples", "300", "--noise", "1.5", "--trials", "2", "--jobs", "1", "--no-figures", *words)
    with pytest.raises(SystemExit) as ended:
        main(["evaluate", *map(str, given)])
    out, err = capsys.readouterr()
    return int(ended.value.code or 0), out, err


def test_parts_of_a_face_may_have_any_names() -> None:
    low, other = setting_of(load_character("low")), setting_of(foreign())
    np.testing.assert_array_equal(skin_vertices(other.character), np.arange(*low.character.part("skin").vertices))
    frames = low.rig_weights(weights(40, 1))
    for cell in (Cell("point", 4, 1.5), Cell("distance", 4, 1.5), Cell("stroke", 300, 1.5)):
        ours, theirs = (list(TrialMaker(setting).trials(cell, frames, 2, 0)) for setting in (low, other))
        assert [trial.constraints for trial in ours] == [trial.constraints for trial in theirs]
    face = low.vertices_of(frames[5])
    assert Evaluator(low, frames).naturalness(face) == Evaluator(other, frames).naturalness(face)


def test_without_a_part_of_skin_all_of_it_is_skin() -> None:
    low = load_character("low")
    character = replace(low, parts=tuple(replace(part, material="tongue") for part in low.parts))
    assert len(skin_vertices(character)) == len(low.vertices)


def test_as_rigid_as_possible_holds_loose_pieces_of_skin() -> None:
    pytest.importorskip("igl", reason="igl is not installed: faceposer[bench]")
    low = load_character("low")
    # The lower teeth are of skin, too, and no vertex of them is still.
    parts = tuple(replace(part, material="skin") if part.name == "teeth_lower" else part for part in low.parts)
    setting = setting_of(replace(low, parts=parts))
    trial = next(TrialMaker(setting).trials(Cell("point", 4, 0.0), setting.rig_weights(weights(40, 1)), 1, 0))
    method = prepared(METHODS["arap"], setting)
    vertices = np.asarray(method.vertices(method.solve(trial.constraints)))
    assert np.isfinite(vertices).all()
    assert np.abs(vertices - low.vertices).max() > 0.05
    teeth = slice(*low.part("teeth_lower").vertices)
    np.testing.assert_allclose(vertices[teeth], low.vertices[teeth], atol=1e-6)


def test_what_a_character_has_no_place_for_is_left_out_with_a_sentence(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    points = {name: vertex for name, vertex in load_character("low").feature_points.items() if name.startswith("8.")}
    regions = load_character("low").regions
    few = {"lids_left": regions["lids_left"][:3], "mouth": regions["mouth"], "lip_upper": regions["lip_upper"]}
    path = tmp_path / "foreign.npz"
    save_character(path, foreign(feature_points=points, feature_titles={}, regions=few))
    words = ("--methods", "bounded-weights", "--counts", "point=2,500", "distance=4", "stroke=300")
    status, _, err = study(capsys, tmp_path, path, *words, "--region-counts", "point=4", "distance=2", "stroke=300")
    assert status == 0, err
    sentences = [line for line in err.splitlines() if line.startswith("'foreign' has too few ")]
    assert len(sentences) == 3
    assert any("too few vertices for 500 points: " in line for line in sentences)
    assert any("4 points within the lids" in line for line in sentences)
    assert any("2 distances within the lids" in line for line in sentences)
    rows = json.loads((tmp_path / "study" / "results.json").read_text())["rows"]
    found = {(row["constraint"], row["count"], row.get("region")) for row in rows}
    assert found == {
        ("point", 2, None),
        ("point", 4, "mouth"),
        ("distance", 4, None),
        ("distance", 2, "mouth"),
        ("stroke", 300, None),
        ("stroke", 300, "mouth"),
    }


def test_strokes_alone_on_a_face_without_lines_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "foreign.npz"
    save_character(path, foreign(feature_points={}, feature_titles={}))
    for words in (("--kinds", "stroke"), ("--kinds", "stroke", "--tune")):
        status, out, err = study(capsys, tmp_path, path, "--methods", "bounded-weights", *words)
        assert (status, out) == (2, "")
        assert "'foreign' has no feature points for a stroke" in err
        assert err.count("\n") == 1


@pytest.mark.slow
@pytest.mark.skipif(not RIGS, reason="FACEPOSER_RIGS names no folder of rigs")
@pytest.mark.parametrize("name", ["facecap", "facecap_multi"])
def test_an_imported_rig_is_studied(name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from faceposer.training.request import TrainingRequest, train

    character = train(TrainingRequest("rig", Path(RIGS or "") / f"{name}.glb", name, name))
    assert "skin" not in {part.name for part in character.parts}
    path = tmp_path / f"{name}.npz"
    save_character(path, character)
    status, _, err = study(capsys, tmp_path, path, "--methods", METHODS_OF_ALL_KINDS, *KINDS_AND_COUNTS)
    assert status == 0, err
    rows = json.loads((tmp_path / "study" / "results.json").read_text())["rows"]
    assert {row["method"] for row in rows} == set(METHODS_OF_ALL_KINDS.split(","))
    # The made-up performance never blinks.
    assert {row.get("region") for row in rows} == {None, "brows", "midface", "mouth"}
    assert "No frame of the takes to test on moves enough for: 1 point within the lids" in err
    of_bounded = [row for row in rows if row["method"] == "bounded-weights" and "region" not in row]
    assert {row["constraint"] for row in of_bounded} == {"point", "distance", "stroke"}
    assert all(row["error_3d_relative"] < 1.0 for row in of_bounded if row["count"] > 1)


@pytest.mark.parametrize("name", ["woman", "low"])
def test_the_other_heads_are_studied(name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    status, _, err = study(capsys, tmp_path, Path(name), "--methods", "bounded-weights", *KINDS_AND_COUNTS)
    assert status == 0, err
    assert "has no place" not in err


def test_vertices_of_coefficients_are_made_in_one_place(monkeypatch: pytest.MonkeyPatch) -> None:
    setting = setting_of(load_character("low"))
    monkeypatch.setattr(method_module, "posed", lambda model, coefficients: model.instance(coefficients) + 1.0)
    for name, kind in METHODS.items():
        if issubclass(kind, ModelMethod) and kind.requires is None and name not in ("mfa-plain",):
            method = prepared(kind, setting)
            assert isinstance(method, ModelMethod)
            found = method.vertices(method.model.neutral())
            np.testing.assert_allclose(found, setting.character.vertices + 1.0, atol=1e-5)
