"""The command line and the programs in ``scripts``, called as functions: a process of their own takes a second more."""

import contextlib
import importlib
import io
import subprocess

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


def run_script(name: str, *words: object, **environment: str | None) -> subprocess.CompletedProcess[str]:
    """Run ``scripts/NAME.py`` with ``words`` and return what its process would have.

    Args:
        name: Name of the script, without its suffix.
        words: Its arguments.
        environment: Variables to set, or to remove if None.
    """
    main, status = importlib.import_module(f"scripts.{name}").main, 0
    out, err = io.StringIO(), io.StringIO()
    with pytest.MonkeyPatch.context() as patch, contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        patch.setattr("sys.argv", [f"{name}.py", *map(str, words)])
        for variable, value in environment.items():
            if value is None:
                patch.delenv(variable, raising=False)
            else:
                patch.setenv(variable, value)
        try:
            main()
        except SystemExit as ended:
            status = ended.code if isinstance(ended.code, int) else int(ended.code is not None)
            if isinstance(ended.code, str):
                err.write(f"{ended.code}\n")
    return subprocess.CompletedProcess([name, *map(str, words)], status, out.getvalue(), err.getvalue())
