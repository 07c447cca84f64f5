"""The study of gestures as a command."""

import json
import subprocess
from pathlib import Path

from tests.command_line import run_script


def study(*words: str) -> subprocess.CompletedProcess[str]:
    return run_script("study_gestures", *words, FACEPOSER_RIGS=None)


def test_rows_and_summary(tmp_path: Path) -> None:
    rows = tmp_path / "new" / "rows.json"
    words = ("--characters", "low", "--gestures", "ear_out", "corners_down", "--prior-weight", "2", "--json", str(rows))
    done = study(*words)
    assert done.returncode == 0, done.stderr
    read = json.loads(rows.read_text(encoding="utf-8"))
    assert read["settings"] == {"prior": "regions", "weight": 2.0, "spread": 0.5}
    assert [row["gesture"] for row in read["rows"]] == ["ear_out", "corners_down"]
    lines = done.stdout.splitlines()
    assert lines[0].split() == ["low"]
    assert lines[1].startswith("ear_out")
    assert lines[-1].strip().endswith("of 2 hold")
    assert not (tmp_path / "pictures").exists()


def test_what_it_refuses() -> None:
    nowhere = study("--characters", "facecap", "--gestures", "ear_out")
    assert nowhere.returncode == 1
    assert "FACEPOSER_RIGS" in nowhere.stderr.splitlines()[-1]
    assert study("--docs").returncode == 2
    assert study("--gestures", "sneeze").returncode == 2
