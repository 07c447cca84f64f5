"""The command line, called as a function."""

import pytest

from faceposer.cli import main


def run(*words: object) -> int:
    """Run ``faceposer`` with ``words`` and return its exit status."""
    with pytest.raises(SystemExit) as ended:
        main([str(word) for word in words])
    return int(ended.value.code or 0)


def run_captured(capsys: pytest.CaptureFixture[str], *words: object) -> tuple[int, str, str]:
    """Run ``faceposer`` with ``words``; return its exit status, its output and its errors."""
    status = run(*words)
    out, err = capsys.readouterr()
    return status, out, err
