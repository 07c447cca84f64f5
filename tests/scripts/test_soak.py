"""The short form of the long run passes, and the long run notices what it looks for."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from scripts.torture.soak import Soak, main, summary

ROOT = Path(__file__).resolve().parents[2]


@pytest.mark.gl
@pytest.mark.slow
def test_the_short_form_passes_and_goes_on_where_it_was_stopped(tmp_path: Path) -> None:
    command = [sys.executable, str(ROOT / "scripts" / "torture" / "soak.py"), "--short", "--out", str(tmp_path)]
    result = subprocess.run(command, capture_output=True, text=True, check=False, cwd=ROOT)
    assert result.returncode == 0, result.stdout + result.stderr
    assert result.stderr == ""
    log = tmp_path / "figures.jsonl"
    rows = [json.loads(line) for line in log.read_text(encoding="utf-8").splitlines()]
    assert [row["block"] for row in rows] == list(range(10))
    assert len(rows[-1]["kinds"]) >= 4

    log.write_text("".join(json.dumps(row) + "\n" for row in rows[:9]), encoding="utf-8")
    result = subprocess.run([*command, "--resume"], capture_output=True, text=True, check=False, cwd=ROOT)
    assert result.returncode == 0, result.stdout + result.stderr
    again = [json.loads(line) for line in log.read_text(encoding="utf-8").splitlines()]
    assert [(row["block"], row["events"]) for row in again] == [(row["block"], row["events"]) for row in rows]


@pytest.mark.gl
def test_what_fails_is_told(capfd: pytest.CaptureFixture[str]) -> None:
    soaked = Soak("low", 0, 50)
    try:
        soaked.app.session.accept_pose()
        soaked.app._report(ValueError("a made-up failure"))
        soaked.user.act()
        soaked._check_event(0, 0)
        wrong = np.full(soaked.app.session.model.n_coefficients, np.nan)
        soaked.app.session._document = soaked.app.session.document.posed(wrong)
        soaked._check_event(0, 1)
        soaked.errors.write("a made-up line")
        soaked.app.session._document = soaked.app.session.document.posed(np.zeros_like(wrong))
        soaked._check_block(0)
    finally:
        soaked.app.close()
    told = "\n".join(soaked.problems)
    assert "a made-up failure" in told
    assert "the pose is not finite" in told
    assert "a made-up line" in told
    assert "a made-up failure" in capfd.readouterr().err


def test_growth_is_measured_from_the_first_blocks_on() -> None:
    rows = [{"events": 10 * (i + 1), "used_mb": 100.0 + 10.0 * (i > 2)} for i in range(10)]
    assert summary(rows, [], 0.1)["growth_used"] == 0.1
    assert summary(rows, [], 0.5)["growth_used"] == 0.0


def test_impossible_options_are_refused(capsys: pytest.CaptureFixture[str]) -> None:
    for options in (["--resume"], ["--events", "10"], ["--every", "0"]):
        with pytest.raises(SystemExit):
            main(options)
    assert "at least" in capsys.readouterr().err
