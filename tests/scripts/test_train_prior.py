"""The shipped prior is what the capture and the recipe give."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.command_line import run_script

ROOT = Path(__file__).resolve().parents[2]
SCRIPT = ROOT / "scripts" / "train_prior.py"


@pytest.mark.slow
@pytest.mark.skipif("FACEPOSER_CAPTURES" not in os.environ, reason="needs the capture files")
def test_learning_again_gives_the_committed_statistics() -> None:
    result = subprocess.run([sys.executable, SCRIPT, "--check"], capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stdout + result.stderr


def test_without_captures_it_says_what_to_set() -> None:
    result = run_script("train_prior", FACEPOSER_CAPTURES=None)
    assert result.returncode == 1
    assert "FACEPOSER_CAPTURES" in result.stderr
