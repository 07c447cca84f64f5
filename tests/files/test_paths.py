"""Questions about paths: none of them fails, whatever the path."""

from pathlib import Path

import pytest

from faceposer.files import paths


def _unanswerable(tmp_path: Path) -> list[Path]:
    (tmp_path / "circle").symlink_to("circle")
    (tmp_path / "file").write_text("x")
    return [
        tmp_path / ("n" * 300),
        tmp_path / "n" / ("n" * 5000),
        tmp_path / "circle",
        tmp_path / "circle" / "below",
        tmp_path / "file" / "below",
        tmp_path / "zero\0byte",
        tmp_path / "lone\ud800surrogate",
    ]


def test_questions_without_an_answer_are_answered_no(tmp_path: Path) -> None:
    for path in _unanswerable(tmp_path):
        assert not paths.exists(path)
        assert not paths.is_file(path)
        assert not paths.is_dir(path)
        assert not paths.same_file(path, tmp_path)
        assert paths.modified_at(path) is None


def test_files_and_folders_are_told_apart(tmp_path: Path) -> None:
    file = tmp_path / "file"
    file.write_text("x")
    link = tmp_path / "link"
    link.symlink_to(file)
    assert paths.is_file(file)
    assert paths.is_file(link)
    assert not paths.is_dir(file)
    assert paths.is_dir(tmp_path)
    assert not paths.is_file(tmp_path)
    assert paths.same_file(file, link)
    assert paths.modified_at(link) == file.stat().st_mtime_ns


def test_expand_user(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HOME", "/home/somebody")
    assert paths.expand_user("~/face.json") == Path("/home/somebody/face.json")
    assert paths.expand_user("~no such user/face.json") == Path("~no such user/face.json")
    assert paths.expand_user(Path("face.json")) == Path("face.json")


def test_why_nothing_can_be_found_out(tmp_path: Path) -> None:
    reasons = [paths.problem(path) for path in _unanswerable(tmp_path)]
    assert reasons[:4] == ["File name too long"] * 2 + ["Too many levels of symbolic links"] * 2
    assert all(reasons[4:6])
    assert paths.problem(tmp_path) == paths.problem(tmp_path / "missing") == ""


def test_paths_are_resolved_as_far_as_they_go(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for path in _unanswerable(tmp_path):
        assert paths.resolved(path).is_absolute()
        assert not paths.can_enter(path)
        assert paths.files_in(path) == []
    assert paths.can_enter(tmp_path)
    (tmp_path / "a.json").touch()
    (tmp_path / "b.lock").touch()
    assert paths.files_in(tmp_path, ".json") == [tmp_path / "a.json"]
    gone = tmp_path / "gone"
    gone.mkdir()
    monkeypatch.chdir(gone)
    gone.rmdir()
    assert paths.absolute("a.json") == Path("a.json")
    assert paths.resolved("a.json") == Path("a.json")
    monkeypatch.chdir(tmp_path)
    assert paths.absolute("a.json") == tmp_path / "a.json"
