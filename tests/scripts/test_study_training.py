"""The study of training makes its data, measures every way, and the program's own is as near to the exact as can be."""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from scripts.studying.memory import PeakMemory

ROOT = Path(__file__).resolve().parents[2]


@pytest.mark.slow
@pytest.mark.skipif("FACEPOSER_CAPTURES" not in os.environ, reason="needs the capture files")
def test_study_in_small(tmp_path: Path) -> None:
    path = tmp_path / "training.json"
    command = [sys.executable, str(ROOT / "scripts" / "study_training.py"), "--frames", "60", "--vertices", "17259"]
    command += ["--components", "6", "--folder", str(tmp_path), "--json", str(path)]
    command += ["--only", "exact", "streaming"]
    result = subprocess.run(command, capture_output=True, text=True, check=False, cwd=ROOT)
    assert result.returncode == 0, result.stderr
    rows = {row["name"]: row for row in json.loads(path.read_text())["rows"]}
    assert list(rows) == ["exact", "streaming"]
    assert rows["exact"]["degrees_6"] < 0.1
    assert rows["streaming"]["settled"]
    assert rows["streaming"]["kept"] > rows["exact"]["kept"] - 1e-4


def test_memory_that_is_taken_is_seen() -> None:
    with PeakMemory() as before:
        pass
    with PeakMemory() as memory:
        block = np.ones(30_000_000)
        while memory.bytes < before.bytes + 100_000_000:
            block += 1.0
    assert memory.largest >= 200_000_000
