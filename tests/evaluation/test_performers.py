"""Performers left out one at a time: what is learned, the files, the rows over all, and what is refused."""

import csv
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from faceposer.cli import main
from faceposer.errors import FacePoserError
from faceposer.evaluation.measures import Score
from faceposer.evaluation.performers import Performer, leave_one_out
from faceposer.evaluation.plan import Plan
from faceposer.evaluation.rows import pooled_rows_of, rows_of
from faceposer.evaluation.takes import Source, steady
from faceposer.evaluation.trials import Cell
from faceposer.training.expressions import Recipe
from tests.evaluation.performances import weights, write_take

SMALL = ("--trials", "4", "--kinds", "point", "--counts", "point=2,8", "--noise", "1.5", "--regions", "none")
QUICK = ("--methods", "ppca,bounded-weights", "--jobs", "1", "--examples", "300", "--character", "low", "--no-figures")


@pytest.fixture(scope="module")
def takes(tmp_path_factory: pytest.TempPathFactory) -> dict[str, tuple[Path, ...]]:
    folder = tmp_path_factory.mktemp("takes")

    def take(name: str, frames: int, seed: int) -> Path:
        return write_take(folder / f"{name}.csv", weights(frames, seed))

    return {
        "anna": (take("one", 120, 0), take("two", 60, 1)),
        "ben": (take("three", 90, 2),),
        "cleo": (take("four", 80, 3),),
    }


def run(capsys: pytest.CaptureFixture[str], *words: object) -> tuple[int, str, str]:
    with pytest.raises(SystemExit) as ended:
        main(["evaluate", *map(str, words)])
    out, err = capsys.readouterr()
    return int(ended.value.code or 0), out, err


def given(takes: dict[str, tuple[Path, ...]]) -> tuple[str, ...]:
    return tuple(
        word for name, files in takes.items() for word in ("--performer", f"{name}={','.join(map(str, files))}")
    )


def test_each_performer_is_tested_with_what_the_others_teach(takes: dict[str, tuple[Path, ...]]) -> None:
    sources = leave_one_out([Performer(name, files) for name, files in takes.items()], "low", Recipe())
    assert list(sources) == ["anna", "ben", "cleo"]
    assert sources["ben"].captures == (*takes["anna"], *takes["cleo"])
    assert sources["ben"].tests == takes["ben"]
    setting, frames = sources["ben"].load()
    assert setting.performers == ("anna", "anna", "cleo")
    assert {name: len(rows) for name, rows in setting.frames_by_performer.items()} == {"anna": 180, "cleo": 80}
    np.testing.assert_array_equal(np.concatenate([*setting.frames_by_performer.values()]), setting.frames)
    assert len(frames) == 90


def test_a_study_of_performers_has_rows_of_each_and_of_all(
    takes: dict[str, tuple[Path, ...]], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    status, out, err = run(capsys, "-o", tmp_path, *given(takes), *QUICK, *SMALL)
    assert status == 0, err
    assert "## cleo, learned from the others" in out
    assert "worse than the neutral face" in out
    about = json.loads((tmp_path / "results.json").read_text())
    rows = about["rows"]
    assert [*dict.fromkeys(row["performer"] for row in rows)] == ["pooled", "anna", "ben", "cleo"]
    learned = about["settings"]["ben"]
    assert learned["performer_left_out"] == "ben"
    assert [(of["file"], of["performer"]) for of in learned["captures"]] == [
        ("one.csv", "anna"),
        ("two.csv", "anna"),
        ("four.csv", "cleo"),
    ]
    for method in ("ppca", "bounded-weights"):
        for count in (2, 8):
            of = {row["performer"]: row for row in rows if (row["method"], row["count"]) == (method, count)}
            parts = [of[name] for name in takes]
            assert of["pooled"]["poses"] == 12 == sum(row["poses"] for row in parts)
            worse = np.mean([row["worse_than_neutral"] for row in parts])
            assert of["pooled"]["worse_than_neutral"] == pytest.approx(worse, abs=1e-3)
            neutral = np.array([row["error_3d"] / row["error_3d_relative"] for row in parts])
            relative = sum(row["error_3d"] for row in parts) / neutral.sum()
            assert of["pooled"]["error_3d_relative"] == pytest.approx(relative, rel=2e-3)
            low, high = of["pooled"]["ci95"]
            assert low < of["pooled"]["error_3d_relative"] < high
    table = list(csv.DictReader((tmp_path / "results.csv").read_text().splitlines()))
    assert [line["performer"] for line in table] == [row["performer"] for row in rows]
    of_ben = json.loads((tmp_path / "ben" / "results.json").read_text())
    assert [{"performer": "ben", **row} for row in of_ben["rows"]] == [row for row in rows if row["performer"] == "ben"]


def test_a_study_of_performers_goes_on_where_it_was_stopped(
    takes: dict[str, tuple[Path, ...]], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ("-o", tmp_path, *given(takes), *QUICK, *SMALL)
    assert run(capsys, *words)[0] == 0
    before = json.loads((tmp_path / "results.json").read_text())["rows"]
    logs = {name: (tmp_path / name / "trials.jsonl").read_bytes() for name in takes}
    (tmp_path / "cleo" / "trials.jsonl").write_bytes(b"".join(logs["cleo"].splitlines(keepends=True)[:2]))
    status, _, err = run(capsys, *words)
    assert status == 0
    assert [line for line in err.splitlines() if "Training" in line] == [
        "cleo left out: Training the techniques, about a minute"
    ]
    after = json.loads((tmp_path / "results.json").read_text())["rows"]
    assert [{k: v for k, v in row.items() if not k.startswith("ms")} for row in after] == [
        {k: v for k, v in row.items() if not k.startswith("ms")} for row in before
    ]
    assert (tmp_path / "anna" / "trials.jsonl").read_bytes() == logs["anna"]
    # Without one of the others, what is learned is something else.
    fewer = {name: takes[name] for name in ("anna", "ben")}
    status, _, err = run(capsys, "-o", tmp_path, *given(fewer), *QUICK, *SMALL)
    assert status == 2
    assert "other settings (captures)" in err


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (("--performer", "anna"), "must have the form NAME=CSV,CSV"),
        (("--performer", "anna="), "must have the form NAME=CSV,CSV"),
        (("--performer", "anna=a.csv"), "there is nobody to learn from"),
        (("--performer", "anna=a.csv", "--performer", "Anna=b.csv"), "two performers called 'anna'"),
        (("--performer", "anna=a.csv", "--performer", "ben=./a.csv"), "a take of anna and of ben"),
        (("--performer", "anna=a.csv", "--performer", "pooled=b.csv"), "cannot be the name of a performer"),
        (("--performer", "anna=a.csv", "--performer", "../ben=b.csv"), "cannot be the name of a performer"),
        (("--performer", "anna=a.csv", "--performer", "ben=b.csv"), "'b.csv' cannot be read"),
        (
            ("--performer", "anna=a.csv", "--performer", "ben=b.csv", "--fold"),
            "--fold cannot be combined with --performer",
        ),
        (
            ("--performer", "anna=a.csv", "--performer", "ben=b.csv", "--tune"),
            "--tune cannot be combined with --performer",
        ),
        (
            ("--performer", "anna=a.csv", "--performer", "ben=b.csv", "--capture", "c.csv"),
            "--capture cannot be combined",
        ),
    ],
)
def test_performers_that_cannot_be_left_out_are_refused_in_a_sentence(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], words: tuple[str, ...], sentence: str
) -> None:
    status, out, err = run(capsys, "-o", tmp_path / "study", *QUICK, *SMALL, *words)
    assert (status, out) == (2, "")
    assert sentence in err
    assert err.count("\n") == 1
    assert not (tmp_path / "study").exists()


def test_a_performer_whose_face_is_still_is_named(
    takes: dict[str, tuple[Path, ...]], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    still = write_take(tmp_path / "still.csv", 0.0 * weights(40, 0))
    words = ("-o", tmp_path / "study", *given({"anna": takes["anna"], "dora": (still,)}), *QUICK, *SMALL)
    status, _, err = run(capsys, *words)
    assert status == 2
    assert "performer 'dora' have too few frames" in err


def test_only_one_performer_may_be_split(takes: dict[str, tuple[Path, ...]]) -> None:
    files = (*takes["ben"], *takes["cleo"])
    source = Source("low", files, (), Recipe(), fold=1, performers=("ben", "cleo"), within="ben")
    setting, frames = source.load()
    assert [len(capture.weights) for capture in setting.captures] == [54, 80]
    assert len(frames) == 34
    assert source.identity(setting.character) != replace(source, within=None).identity(setting.character)


def test_jumps_are_changes_per_second(tmp_path: Path) -> None:
    frames = np.zeros((120, 52))
    # No row is the same as the one before: those at the same time would be taken for repetitions.
    frames[:, 0] = np.linspace(0.0, 0.1, 120)
    frames[60:, 24] = 0.2
    kept = {rate: len(steady(write_take(tmp_path / f"{rate}.csv", frames, rate), 0.3).weights) for rate in (30.0, 60.0)}
    assert kept == {30.0: 120, 60.0: 119}
    # Fewer frames a second tell less, not more.
    frames[60:, 24] = 0.4
    assert len(steady(write_take(tmp_path / "15.csv", frames, 15.0), 0.3).weights) == 119


def test_rows_over_all_draw_each_performer_by_himself() -> None:
    rng = np.random.default_rng(0)
    cell = Cell("point", 4, 1.5)
    plan = Plan(("mfa", "ppca"), (cell,), {"point": 60}, (0,))

    def scores(level: float, size: float) -> dict[int, Score]:
        neutral = size * rng.uniform(0.9, 1.1, 60)
        errors = neutral * (level + 0.02 * rng.standard_normal(60))
        return {i: Score(e, n, {}, 0.0, 0.0, 0.0, 1.0) for i, (e, n) in enumerate(zip(errors, neutral, strict=True))}

    groups = [
        {("mfa", cell, 0): scores(level, size), ("ppca", cell, 0): scores(level + 0.1, size)}
        for level, size in ((0.2, 1.0), (0.8, 1.0))
    ]
    ours, other = pooled_rows_of(groups, plan)
    assert ours["error_3d_relative"] == pytest.approx(0.5, abs=0.02)
    # The two performers differ by far more than the trials of either: who is drawn would decide.
    assert ours["ci95"][1] - ours["ci95"][0] < 0.02
    assert (ours["lowest"], other["within"]) == (True, False)
    assert other["behind"] == pytest.approx(0.1, abs=0.01)
    assert rows_of(groups[0], plan) == pooled_rows_of(groups[:1], plan)


def test_a_performer_needs_a_name_for_a_folder() -> None:
    with pytest.raises(FacePoserError, match="cannot be the name"):
        Performer("-o", (Path("a.csv"),))
