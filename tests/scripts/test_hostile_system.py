"""Commands and the window on systems that refuse, in the short form of their trials."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


@pytest.mark.gl
@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="the conditions are those of Linux")
def test_nothing_breaks_on_a_hostile_system(tmp_path: Path) -> None:
    figures = tmp_path / "figures.json"
    script = [sys.executable, "scripts/torture/hostile_system.py", "--short", "--json", str(figures)]
    # In a process of its own: the script forks, which a process with threads should not.
    ended = subprocess.run(script, cwd=ROOT, capture_output=True, text=True, check=False)
    assert figures.exists(), ended.stderr[-2000:]
    found = json.loads(figures.read_text())
    assert found["wrong"] == []
    assert found["cases"] > 40


@pytest.mark.gl
@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="the conditions are those of Linux")
def test_killed_commands_and_windows_leave_nothing_broken(tmp_path: Path) -> None:
    figures = tmp_path / "figures.json"
    script = [sys.executable, "scripts/torture/kill.py", "--commands", "4", "--windows", "1", "--json", str(figures)]
    ended = subprocess.run(script, cwd=ROOT, capture_output=True, text=True, check=False)
    assert figures.exists(), ended.stderr[-2000:]
    found = json.loads(figures.read_text())
    assert found["wrong"] == []
    assert found["most_gestures_lost"] <= 1
