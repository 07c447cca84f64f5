"""The quick study of priors: what it tests on, what it keeps, and that take 4 is only looked at when asked for."""

import json
import subprocess
from pathlib import Path

import numpy as np
import pytest

from faceposer.training.expressions import Recipe
from scripts.study_performers import CELLS, line, sources
from tests.command_line import run_script
from tests.evaluation.performances import weights, write_take

TAKES = {"alex_rom_3": 120, "alex_rom_4": 60, "jmtechart_myslate_3": 80, "llv_dao": 70}
VARIANTS = """
VARIANTS = {
    "strong": lambda setting: (setting.model, 50.0, {}),
    "whole": lambda setting: (setting.model, 1.0, {"prior": "whole"}),
}
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("captures")
    for seed, (name, frames) in enumerate(TAKES.items()):
        write_take(folder / f"{name}.csv", weights(frames, seed))
    return folder


def run(captures: Path, *arguments: object) -> subprocess.CompletedProcess[str]:
    small = ("--character", "low", "--trials", "2", "--examples", "300")
    return run_script("study_performers", *small, *arguments, FACEPOSER_CAPTURES=str(captures))


@pytest.mark.slow
def test_variants_of_a_file_are_compared_and_what_is_learned_is_kept(folder: Path, tmp_path: Path) -> None:
    variants = tmp_path / "variants.py"
    variants.write_text(VARIANTS)
    words = ("-o", tmp_path / "kept", "--variants", variants, "--only", "default", "strong", "whole", "bounded-weights")
    words = (*words, "--data", "alex", "jmtechart", "llv_dao")
    result = run(folder, *words)
    assert result.returncode == 0, result.stderr
    assert result.stderr.count("learned in") == 3
    assert "ake 4" not in result.stdout
    rows = json.loads((tmp_path / "kept" / "performers.json").read_text())["rows"]
    assert {(row["variant"], row["data"]) for row in rows} == {
        (variant, data)
        for variant in ("default", "strong", "whole", "bounded-weights")
        for data in ("alex", "jmtechart", "llv_dao")
    }
    shipped, strong = (
        [row["error_3d"] for row in rows if (row["variant"], row["constraint"]) == (name, "point")]
        for name in ("default", "strong")
    )
    assert shipped != strong
    pooled = [text for text in result.stdout.splitlines() if " performers " in text]
    assert [text.split()[0] for text in pooled] == ["default", "strong", "whole", "bounded-weights"]
    again = run(folder, *words)
    assert "learned" not in again.stderr
    assert json.loads((tmp_path / "kept" / "performers.json").read_text())["rows"][0]["error_3d"] == rows[0]["error_3d"]


@pytest.mark.slow
def test_take_4_is_looked_at_when_asked_for(folder: Path, tmp_path: Path) -> None:
    words = ("-o", tmp_path, "--only", "bounded-weights", "--data", "take4")
    assert "unknown data set 'take4'" in run(folder, *words).stderr
    result = run(folder, *words, "--look")
    assert result.returncode == 0, result.stderr
    assert "Take 4 (alex_rom_4.csv) is used as test data." in result.stdout


def test_data_sets_learn_from_no_frame_that_they_test_on(folder: Path) -> None:
    recipe = Recipe(n_examples=300)
    for others in (False, True):
        found = sources(folder, "low", recipe, others, look=True)
        assert list(found) == ["fold1", "fold2", "alex", "jmtechart", "llv_dao", "take4"]
        for name in ("alex", "jmtechart", "llv_dao", "take4"):
            assert not set(found[name].captures) & set(found[name].tests)
        assert len(found["take4"].captures) == (3 if others else 1)
        setting, frames = found["fold1"].load()
        assert setting.performers == (("alex", "jmtechart", "llv_dao") if others else ("alex",))
        assert len(setting.frames_by_performer["alex"]) + len(frames) <= TAKES["alex_rom_3"]
        assert all("alex_rom_4" not in path.name for path in found["alex"].captures + found["alex"].tests)


def test_a_line_says_what_is_surely_better_and_how_many_are_worse_than_neutral() -> None:
    rng = np.random.default_rng(0)
    neutral, ms = np.ones(60), np.full(60, 2.0)
    base, better, same = (
        {cell: np.column_stack([level + 0.1 * rng.standard_normal(60), neutral, ms]) for cell in CELLS}
        for level in (0.9, 0.5, 0.9)
    )
    assert line("base", "fold1", base, base).count("*") == 0
    assert line("better", "fold1", better, base).count("*") == len(CELLS)
    assert line("base", "fold1", base, better).count("!") == len(CELLS)
    assert line("same", "fold1", same, base).count("*") + line("same", "fold1", same, base).count("!") <= 3
    assert "(0.00)" in line("better", "fold1", better, base)
    assert line("better", "fold1", better, base).endswith("2.0 2.0 2.0 ms")
