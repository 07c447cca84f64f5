"""Terminals that cannot show a character, and output that cannot be written, end no command with a traceback."""

import io
import sys
from pathlib import Path

import pytest

from faceposer.cli.console import tell
from faceposer.session.document import Document, write_document
from tests.command_line import run


def terminal(encoding: str) -> io.TextIOWrapper:
    return io.TextIOWrapper(io.BytesIO(), encoding, "strict")


@pytest.mark.parametrize("encoding", ["ascii", "cp1252", "latin-1", "cp437", "shift-jis", "utf-8"])
def test_characters_that_a_terminal_does_not_have_are_escaped(
    encoding: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out, err = terminal(encoding), terminal(encoding)
    monkeypatch.setattr(sys, "stdout", out)
    monkeypatch.setattr(sys, "stderr", err)
    for name in ("Ωĝ漢😀ü", "caf\udce9", "a\nb\x1b[31m"):
        write_document(tmp_path / f"{name}.json", Document("low"))
        assert run("export", tmp_path / f"{name}.json", "-o", tmp_path / f"{name}.csv") == 0
        assert run("export", tmp_path / f"{name}.json", "-o", tmp_path / name) == 2
    for stream, written in ((out, "written"), (err, "must end in")):
        stream.flush()
        text = stream.buffer.getvalue().decode(encoding)  # type: ignore[attr-defined]
        assert text.count(written) == 3
        assert "caf\\udce9" in text


class Full(io.StringIO):
    """A stream to a full disk."""

    def flush(self) -> None:
        raise OSError(28, "No space left on device")


def test_a_full_disk_for_what_is_printed_is_one_sentence(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "stdout", Full())
    assert run("export", "low", "-o", tmp_path / "a.csv") == 2
    assert capsys.readouterr().err == "The output cannot be written to the terminal or file: No space left on device.\n"
    assert (tmp_path / "a.csv").is_file()


def test_nobody_may_be_there_to_tell(monkeypatch: pytest.MonkeyPatch) -> None:
    for nobody in (Full(), None):
        monkeypatch.setattr(sys, "stderr", nobody)
        tell("message")
