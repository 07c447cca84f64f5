"""What measures speed and compares strokes runs, and says what it says it does; no test looks at a time."""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from faceposer.evaluation.feature_lines import of_length, width_of
from faceposer.geometry.strokes import stroke_pixels
from scripts.benchmarking.rivals import ratio_rows
from tests.command_line import run_script

ROOT = Path(__file__).resolve().parents[2]
LINE = np.array([(100.3, 50.1), (160.2, 71.7), (220.8, 53.4)])


def run(script: str, *arguments: str, captures: bool = False) -> subprocess.CompletedProcess[str]:
    environment = {name: value for name, value in os.environ.items() if captures or name != "FACEPOSER_CAPTURES"}
    command = [sys.executable, str(ROOT / "scripts" / script), *arguments]
    return subprocess.run(command, capture_output=True, text=True, check=False, env=environment, cwd=ROOT)


@pytest.mark.slow
def test_the_benchmark_has_all_its_rows(tmp_path: Path) -> None:
    path = tmp_path / "benchmark.json"
    result = run("benchmark.py", "--moves", "3", "--no-start", "--json", str(path))
    assert result.returncode == 0, result.stderr
    data = json.loads(path.read_text())
    names = {row["name"] for row in data["rows"]}
    assert [(ratio["above"], ratio["below"]) for ratio in data["ratios"]] == [("reconstruct", "basis-copy")]
    kinds = ("distances-4", "stroke-450", "stroke-900", "curve-5", "fixed-100", "fixed-1000")
    assert {f"solve/{kind}/mfa" for kind in kinds} <= names
    for kind, counts in (("points", (1, 4, 16, 64)), ("stroke", (225, 450, 900, 1800)), ("fixed", (100, 1000, 5000))):
        assert {f"scaling/{kind}-{count}" for count in counts} <= names
    assert "pick/stroke-900/numpy" in names


def test_ratios_of_times_are_held_against_what_is_asked_for() -> None:
    times = {"mfa": 2.0, "pca": 1.0, "lwr": 2.0, "opt-blend": 9.0, "arap": 100.0}
    rows = [{"name": f"rivals/points-4/{name}", "median_ms": ms} for name, ms in times.items()]
    rows += [{"name": "reconstruct", "median_ms": 3.0}, {"name": "basis-copy", "median_ms": 2.0}]
    found = {(r["above"].split("/")[-1], r["below"].split("/")[-1]): (r["ratio"], r["met"]) for r in ratio_rows(rows)}
    assert found == {
        ("mfa", "pca"): (2.0, False),
        ("arap", "mfa"): (50.0, True),
        ("opt-blend", "mfa"): (4.5, False),
        ("lwr", "mfa"): (1.0, True),
        ("reconstruct", "basis-copy"): (1.5, True),
    }


@pytest.mark.slow
@pytest.mark.skipif("FACEPOSER_CAPTURES" not in os.environ, reason="needs the capture files")
def test_strokes_are_compared(tmp_path: Path) -> None:
    path = tmp_path / "strokes.json"
    result = run_script("compare_strokes", "--poses", 1, "--examples", 300, "--json", path)
    assert result.returncode == 0, result.stderr
    rows = json.loads(path.read_text())["rows"]
    assert {row["method"] for row in rows} == {"image", "distance", "forward", "forward+centre", "both"}
    assert {row["situation"] for row in rows} == {"same", "longer", "shorter", "noisy", "far"}
    assert {row["poses"] for row in rows} == {1}


@pytest.mark.slow
@pytest.mark.skipif("FACEPOSER_CAPTURES" not in os.environ, reason="needs the capture files")
def test_priors_are_compared(tmp_path: Path) -> None:
    cells = ("--kinds", "point", "--counts", "point=4", "--region-counts", "point=1", "--noise", "0", "--trials", "1")
    methods = ("--methods", "mfa,mfa-undamped,mfa-plain,ppca,pca", "--examples", "300", "--jobs", "1")
    result = run("evaluate.py", "--output", str(tmp_path), *cells, *methods, "--no-figures", captures=True)
    assert result.returncode == 0, result.stderr
    rows = json.loads((tmp_path / "results.json").read_text())["rows"]
    assert {row["method"] for row in rows} == {"mfa", "mfa-undamped", "mfa-plain", "ppca", "pca"}
    assert {row.get("region") for row in rows} == {None, "brows", "lids", "midface", "mouth"}


def test_without_captures_comparing_says_what_to_set() -> None:
    result = run_script("compare_strokes", FACEPOSER_CAPTURES=None)
    assert result.returncode == 1
    assert "FACEPOSER_CAPTURES" in result.stderr


@pytest.mark.parametrize("pixels", [450, 900])
def test_a_brush_gets_the_width_that_covers_so_many_pixels(pixels: int) -> None:
    assert len(stroke_pixels(LINE, width_of(LINE, pixels))) == pytest.approx(pixels, rel=0.05)


@pytest.mark.parametrize("factor", [0.75, 1.25])
def test_lines_are_made_longer_and_shorter(factor: float) -> None:
    def length(line: np.ndarray) -> float:
        return float(np.hypot(*np.diff(line, axis=0).T).sum())

    line = of_length(LINE, factor)
    assert length(line) == pytest.approx(factor * length(LINE), rel=0.02)
    np.testing.assert_allclose(line.mean(axis=0)[0], 160.5, atol=1.0)
