"""The command that compares techniques: its rows, its files, and going on where it was stopped."""

import csv
import json
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from faceposer.evaluation.measures import Score
from faceposer.evaluation.methods.bounded_weights import BoundedWeights
from faceposer.evaluation.methods.gaussian import Ppca
from faceposer.evaluation.methods.registry import METHODS
from faceposer.evaluation.plan import Plan, Task, known_methods
from faceposer.evaluation.rows import rows_of
from faceposer.evaluation.running import TaskResult, TrialRunner
from faceposer.evaluation.takes import Source, frames_a_second, steady
from faceposer.evaluation.trials import Cell
from faceposer.evaluation.tuning import end_warning, search
from faceposer.training.expressions import Recipe
from tests.command_line import run_captured
from tests.evaluation.performances import weights, write_take

QUICK = ("--methods", "ppca,bounded-weights", "--jobs", "1", "--examples", "300", "--character", "low")
SMALL = ("--trials", "3", "--kinds", "point", "--counts", "point=2,8", "--noise", "1.5", "--regions", "none")
KEYS = {
    "method",
    "constraint",
    "count",
    "noise_px",
    "poses",
    "seeds",
    "error_3d",
    "error_3d_relative",
    "ci95",
    "worse_than_neutral",
    "error_2d_px",
    "error_2d_ci95",
    "to_real",
    "log_likelihood",
    "ms",
    "ms_ci95",
    "error_3d_by_region",
    "lowest",
    "behind",
    "behind_ci95",
    "within",
}


@pytest.fixture(scope="module")
def takes(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    folder = tmp_path_factory.mktemp("takes")
    return (write_take(folder / "one.csv", weights(120, 0)), write_take(folder / "two.csv", weights(60, 1)))


def run(capsys: pytest.CaptureFixture[str], *words: object) -> tuple[int, str, str]:
    return run_captured(capsys, "evaluate", *words)


def given(takes: tuple[Path, Path], folder: Path) -> tuple[object, ...]:
    return ("-o", folder, "--capture", takes[0], "--capture-test", takes[1], *QUICK)


def results(folder: Path) -> dict[str, object]:
    return json.loads((folder / "results.json").read_text())


def without_times(rows: list[dict[str, object]]) -> list[dict[str, object]]:
    return [{key: value for key, value in row.items() if not key.startswith("ms")} for row in rows]


def test_a_study_leaves_rows_tables_and_figures(
    takes: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("DISPLAY", raising=False)
    folder = tmp_path / "study"
    words = ("--trials", "3", "--counts", "point=2,4", "distance=4", "stroke=450", "--regions", "mouth")
    words += ("--region-counts", "distance=2", "stroke=300")
    status, out, err = run(capsys, *given(takes, folder), *words)
    assert (status, err.splitlines()[-1]) == (0, "All trials are done.")
    assert "**" in out
    about = results(folder)
    rows = about["rows"]
    assert {(row["constraint"], row["count"], row["noise_px"], row.get("region")) for row in rows} == {
        (kind, count, noise, region)
        for noise in (1.5, 0.0)
        for kind, count, region in (
            ("point", 2, None),
            ("point", 4, None),
            ("distance", 4, None),
            ("stroke", 450, None),
            ("point", 1, "mouth"),
            ("point", 4, "mouth"),
            ("distance", 2, "mouth"),
            ("stroke", 300, "mouth"),
        )
    }
    for row in rows:
        assert set(row) - {"region"} == KEYS
        assert row["poses"] == 3
        low, high = row["ci95"]
        assert low <= row["error_3d_relative"] <= high
        assert set(row["error_3d_by_region"]) <= {"brows", "lids", "midface", "mouth"}
    assert about["command"].startswith(f"faceposer evaluate -o {folder}")
    assert about["machine"]["versions"]["numpy"] == np.__version__
    assert about["settings"]["captures_test"][0]["file"] == "two.csv"
    names = {path.name for path in folder.iterdir()}
    figures = ("errors-1.5px", "errors-exact", "regions-1.5px", "regions-exact", "times", "time-table")
    assert names == {"trials.jsonl", "results.json", "results.csv", "tables.md"} | {
        f"{name}.{suffix}" for name in figures for suffix in ("png", "svg")
    }
    assert (folder / "times.png").read_bytes().startswith(b"\x89PNG")
    assert "<svg" in (folder / "times.svg").read_text()[:1000]
    table = list(csv.DictReader((folder / "results.csv").read_text().splitlines()))
    assert [(line["method"], float(line["error_3d"])) for line in table] == [
        (row["method"], row["error_3d"]) for row in rows
    ]


def test_a_study_goes_on_after_a_torn_line_and_says_the_same(
    takes: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    whole, torn = tmp_path / "whole", tmp_path / "torn"
    assert run(capsys, *given(takes, whole), *SMALL, "--no-figures")[0] == 0
    torn.mkdir()
    lines = (whole / "trials.jsonl").read_bytes().splitlines(keepends=True)
    (torn / "trials.jsonl").write_bytes(b"".join(lines[:2]) + lines[2][:50])
    assert run(capsys, *given(takes, torn), *SMALL, "--no-figures")[0] == 0
    assert without_times(results(torn)["rows"]) == without_times(results(whole)["rows"])
    assert len((torn / "trials.jsonl").read_bytes().splitlines()) == len(lines)

    before = (whole / "trials.jsonl").read_bytes()
    status, _, err = run(capsys, *given(takes, whole), *SMALL, "--no-figures")
    assert (status, err) == (0, "")
    assert (whole / "trials.jsonl").read_bytes() == before


def test_a_study_that_is_stopped_keeps_what_is_done(
    takes: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    words = (*given(takes, tmp_path), *SMALL, "--no-figures")
    real = TrialRunner.run

    def stopped(bench: TrialRunner, task: Task) -> TaskResult:
        if task.cell.count == 8:
            raise KeyboardInterrupt
        return real(bench, task)

    with monkeypatch.context() as patch:
        patch.setattr(TrialRunner, "run", stopped)
        status, _, err = run(capsys, *words)
    assert status == 130
    assert "repeat the command to continue" in err
    kept = (tmp_path / "trials.jsonl").read_bytes()
    assert len(kept.splitlines()) == 3
    assert run(capsys, *words)[0] == 0
    assert (tmp_path / "trials.jsonl").read_bytes().startswith(kept)
    assert {row["count"] for row in results(tmp_path)["rows"]} == {2, 8}


@pytest.mark.slow
def test_two_processes_find_what_one_finds(
    takes: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    one, two = tmp_path / "one", tmp_path / "two"
    assert run(capsys, *given(takes, one), *SMALL, "--no-figures")[0] == 0
    assert run(capsys, *given(takes, two), *SMALL, "--no-figures", "--jobs", "2")[0] == 0
    assert without_times(results(one)["rows"]) == without_times(results(two)["rows"])


def test_other_settings_in_the_same_folder_are_refused_until_it_is_begun_anew(
    takes: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = (*given(takes, tmp_path), *SMALL, "--no-figures")
    assert run(capsys, *words)[0] == 0
    status, _, err = run(capsys, *words, "--examples", "200")
    assert status == 2
    assert "other settings (recipe)" in err
    assert "--restart" in err
    assert run(capsys, *words, "--examples", "200", "--restart")[0] == 0
    # More trials, other counts and methods are no other study.
    assert run(capsys, *words, "--examples", "200", "--trials", "4")[0] == 0
    assert {row["poses"] for row in results(tmp_path)["rows"]} == {4}


def test_a_damaged_line_is_named(takes: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = (*given(takes, tmp_path), *SMALL, "--no-figures")
    assert run(capsys, *words)[0] == 0
    path = tmp_path / "trials.jsonl"
    lines = path.read_text().splitlines(keepends=True)
    path.write_text("".join([lines[0], "{}\n", *lines[2:]]))
    status, _, err = run(capsys, *words)
    assert status == 2
    assert err.startswith(f"Line 2 of '{path}' is damaged")
    path.write_text("nonsense\n")
    assert "is not a trial log" in run(capsys, *words)[2]


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (("--methods", "nothing"), "There is no technique 'nothing'"),
        (("--kinds", "circle"), "'circle' is not a kind of constraint"),
        (("--counts", "4"), "must have the form KIND=N,N"),
        (("--regions", "ear"), "has no region 'ear'"),
        (("--noise", "-1"), "is not a number of pixels"),
        (("--capture-test", "missing.csv"), "'missing.csv' cannot be read"),
        (("--fold",), "leave out --capture-test"),
    ],
)
def test_mistakes_are_told_in_a_sentence(
    takes: tuple[Path, Path],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    words: tuple[str, ...],
    sentence: str,
) -> None:
    status, out, err = run(capsys, *given(takes, tmp_path / "study"), *words)
    assert (status, out) == (2, "")
    assert sentence in err
    assert err.count("\n") == 1


def test_without_takes_the_folder_of_captures_is_asked_for(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("FACEPOSER_CAPTURES", raising=False)
    status, _, err = run(capsys, "-o", tmp_path)
    assert status == 2
    assert "FACEPOSER_CAPTURES" in err


def test_an_end_of_the_same_take_is_tested_on(
    takes: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ("-o", tmp_path, "--capture", takes[0], *QUICK, *SMALL, "--no-figures", "--fold")
    assert run(capsys, *words)[0] == 0
    assert results(tmp_path)["settings"]["fold"] == 1
    setting, frames = Source("low", (takes[0],), (), Recipe(), fold=2).load()
    assert (len(setting.captures[0].weights), len(frames)) == (72, 46)


def test_sparse_frames_of_another_performer_are_kept(
    takes: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rng = np.random.default_rng(0)
    expressions = weights(400, 2)[rng.permutation(400)[:40]]
    sparse = write_take(tmp_path / "other.csv", expressions, frames_a_second=0.5)
    untimed = write_take(tmp_path / "untimed.csv", expressions, frames_a_second=1e6)
    assert frames_a_second(sparse) == 1.0
    assert frames_a_second(takes[0]) == 30.0
    assert len(steady(sparse, 0.3).weights) == len(steady(untimed, 0.3).weights) == 40
    assert len(steady(sparse, 0.3, "no").weights) < 40
    # A tracking error of one frame in a dense take is left out, as ever.
    broken = weights(120, 0)
    broken[60] += 0.5
    assert len(steady(write_take(tmp_path / "broken.csv", broken), 0.3).weights) == 118
    assert run(capsys, *given((takes[0], sparse), tmp_path / "study"), *SMALL, "--no-figures")[0] == 0
    assert {row["poses"] for row in results(tmp_path / "study")["rows"]} == {3}


def test_methods_say_what_they_can_and_need(
    takes: tuple[Path, Path],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    class Slow(Ppca):
        name = "slow"
        kinds = ("point",)
        max_trials = 2

    class Absent(Ppca):
        name = "absent"
        requires = "no_such_package"

    for kind in (Slow, Absent):
        monkeypatch.setitem(METHODS, kind.name, kind)
    words = ("--trials", "3", "--counts", "point=2", "distance=2", "--kinds", "point,distance", "--regions", "none")
    methods = ("--methods", "bounded-weights,slow,absent", "--noise", "0", "--no-figures")
    status, _, err = run(capsys, *given(takes, tmp_path), *words, *methods)
    assert status == 0
    assert "'absent' is left out" in err
    assert "no_such_package" in results(tmp_path)["left_out"]["absent"]
    found = {(row["method"], row["constraint"]): row["poses"] for row in results(tmp_path)["rows"]}
    assert found == {("bounded-weights", "point"): 3, ("bounded-weights", "distance"): 3, ("slow", "point"): 2}


def test_the_usual_methods_are_those_of_the_comparison() -> None:
    assert "mfa-undamped" not in known_methods(None)
    assert known_methods(None)[:3] == ("mfa", "mfa-whole", "mfa-plain")


def test_intervals_are_of_the_ratio_and_of_paired_differences() -> None:
    rng = np.random.default_rng(0)
    neutral = rng.uniform(0.5, 1.5, 200)
    noise = rng.normal(0.0, 0.2, 200)

    def scores(errors: np.ndarray) -> dict[int, Score]:
        return {i: Score(e, n, {}, 0.0, 0.0, 0.0, 1.0) for i, (e, n) in enumerate(zip(errors, neutral, strict=True))}

    cell = Cell("point", 4, 1.5)
    plan = Plan(("mfa", "ppca", "lwr"), (cell,), {"point": 200}, (0,))
    # Trials differ by far more than the second method from the first: pairs tell them apart all the same.
    by_method = {"mfa": 0.5 * neutral + noise, "ppca": 0.52 * neutral + noise, "lwr": 0.5 * neutral + 0.9 * noise}
    rows = rows_of({(name, cell, 0): scores(errors) for name, errors in by_method.items()}, plan)
    ours = next(row for row in rows if row["lowest"])
    other = next(row for row in rows if row["method"] == "ppca")
    assert other["ci95"][0] < ours["error_3d_relative"] < other["ci95"][1]
    assert not other["within"]
    assert other["behind_ci95"][0] > 0.0
    assert sum(row["within"] for row in rows) == 2
    assert rows == rows_of({(name, cell, 0): scores(errors) for name, errors in by_method.items()}, plan)


def test_tuning_finds_the_lowest_and_tries_nothing_twice() -> None:
    tried = []

    def score(parameters: dict[str, float]) -> float:
        tried.append(tuple(sorted(parameters.items())))
        return abs(np.log(parameters["prior_weight"] / 4.0)) + abs(parameters["energy"] - 0.98) + 1.0

    found = search(Ppca, score)
    assert found["parameters"] == {"energy": 0.98, "prior_weight": 4.0, "augmented": True}
    assert found["score"] == 1.0 < found["score_as_is"]
    assert len(tried) == len(set(tried)) == len(found["tried"])
    assert (found["at_end_of_grid"], found["at_natural_end"]) == ([], [])
    assert end_warning("ppca", found) is None


def test_tuning_tells_ends_of_grids_from_ends_of_what_there_is() -> None:
    found = search(Ppca, lambda parameters: 10.0 - parameters["energy"] - parameters["prior_weight"])
    assert found["parameters"]["prior_weight"] == max(Ppca.grid["prior_weight"])
    assert found["parameters"]["energy"] == 1.0
    assert (found["at_end_of_grid"], found["at_natural_end"]) == (["prior_weight"], ["energy"])
    assert end_warning("ppca", found) == (
        "ppca: prior_weight=8 at the end of the grid; better values may be beyond it, so widen the grid."
    )
    # What is better by less than is worth a word is no reason to go to the end.
    found = search(Ppca, lambda parameters: 1.0 - 1e-6 * parameters["prior_weight"])
    assert found["parameters"] == Ppca.parameters


@pytest.mark.parametrize("name", METHODS)
def test_what_a_technique_uses_lies_within_its_grid(name: str) -> None:
    kind = METHODS[name]
    assert set(kind.grid) <= set(kind.parameters)
    assert set(kind.natural_ends) <= set(kind.grid)
    for parameter, values in kind.grid.items():
        used = kind.parameters[parameter]
        assert used in values
        if not isinstance(used, bool | str) and used not in kind.natural_ends.get(parameter, ()):
            assert min(values) < used < max(values)


def test_tuning_writes_what_it_found(
    takes: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(BoundedWeights, "grid", {"ridge": (1.0, BoundedWeights.parameters["ridge"])})
    words = ("-o", tmp_path, "--capture", takes[0], *QUICK, "--methods", "bounded-weights", "--kinds", "point")
    status, out, _ = run(capsys, *words, "--tune", "--trials", "2")
    assert status == 0
    assert "bounded-weights: ridge=" in out
    assert "at the end of the grid" in out
    tuned = json.loads((tmp_path / "tuned.json").read_text())["methods"]["bounded-weights"]
    assert [entry["parameters"]["ridge"] for entry in tuned["tried"]] == [BoundedWeights.parameters["ridge"], 1.0]
    assert tuned["score"] == min(entry["score"] for entry in tuned["tried"])


@pytest.mark.slow
@pytest.mark.gl
def test_faces_are_drawn_side_by_side(
    takes: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = (*given(takes, tmp_path), *SMALL, "--noise", "0", "--methods", "mfa,pca", "--no-figures", "--pictures")
    status, out, err = run(capsys, *words)
    assert status == 0, err
    assert "faces-point.png" in out
    with Image.open(tmp_path / "faces-point.png") as picture:
        assert picture.width > 2.5 * picture.height
        assert np.asarray(picture).std() > 10.0


def test_without_matplotlib_figures_are_refused_before_any_work(
    takes: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    status, _, err = run(capsys, *given(takes, tmp_path / "study"), *SMALL)
    assert status == 2
    assert "faceposer[plots]" in err
    assert not (tmp_path / "study").exists()
