"""Session files that others change or have open."""

import json
import shutil
import subprocess
import sys
import textwrap
from pathlib import Path

import pytest

from faceposer.resources import asset_path
from faceposer.session.autosave import Journal, find_orphans
from faceposer.session.document import Document, write_document
from faceposer.session.on_disk import OpenFile, content_of, content_of_text
from faceposer.session.opening import open_session


@pytest.fixture
def path(tmp_path: Path) -> Path:
    path = tmp_path / "s.json"
    write_document(path, Document("low"))
    return path


def test_only_changes_by_others_count(path: Path) -> None:
    session = open_session(str(path))
    assert not session.changed_on_disk()
    path.touch()
    assert not session.changed_on_disk(), "the content is the same"
    session.set_prior_weight(2.0)
    session.save(path)
    assert not session.changed_on_disk()
    path.write_text(path.read_text().replace('"low"', '"man"'))
    assert session.changed_on_disk()
    session.save(path)
    assert not session.changed_on_disk()
    path.unlink()
    assert not session.changed_on_disk(), "nothing is overwritten"
    path.mkdir()
    assert not session.changed_on_disk(), "nor can it be"
    path.rmdir()
    other = open_session(str(path)) if path.exists() else open_session("low")
    assert not other.changed_on_disk(), "a new session has no file"


def test_recovered_work_asks_before_it_replaces_what_was_saved_since(path: Path, tmp_path: Path) -> None:
    session = open_session(str(path))
    session.set_prior_weight(3.0)
    journal = Journal(tmp_path / "journals")
    journal.flush(session)
    journal.close(keep=True)
    path.write_text(path.read_text().replace('"low"', '"man"'))
    (orphan,) = find_orphans(tmp_path / "journals").orphans
    assert orphan.outdated
    assert orphan.open().changed_on_disk()
    orphan.remove()


def test_a_digest_is_that_of_the_content(path: Path, tmp_path: Path) -> None:
    assert content_of(path) == content_of_text(path.read_text())
    (tmp_path / "circle").symlink_to("circle")
    for nothing in (tmp_path, tmp_path / "gone", tmp_path / "circle", Path("n" * 300), Path("zero\0")):
        assert content_of(nothing) is None


def test_a_second_window_is_told_while_the_first_lives(path: Path, tmp_path: Path) -> None:
    folder, link = tmp_path / "locks", tmp_path / "link.json"
    link.symlink_to(path)
    first, second = OpenFile(folder), OpenFile(folder)
    assert first.hold(path)
    assert first.hold(path)
    assert not second.hold(link)
    assert second.hold(tmp_path / "other.json")
    assert second.hold(None)
    first.release()
    assert second.hold(link)
    second.release()
    assert list(folder.iterdir()) == []


def test_locks_of_killed_windows_go_with_the_next(path: Path, tmp_path: Path) -> None:
    program = f"""
        import os
        from pathlib import Path
        from faceposer.session.on_disk import OpenFile
        assert OpenFile(Path({str(tmp_path / "locks")!r})).hold(Path({str(path)!r}))
        os._exit(9)
    """
    assert subprocess.run([sys.executable, "-c", textwrap.dedent(program)], check=False).returncode == 9
    assert len(list((tmp_path / "locks").iterdir())) == 1
    OpenFile(tmp_path / "locks")
    assert list((tmp_path / "locks").iterdir()) == []


def test_without_a_folder_for_locks_every_file_is_ours(path: Path, tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    assert OpenFile(tmp_path / "file" / "locks").hold(path)
    assert OpenFile(tmp_path / "file").hold(path)


def test_a_session_behind_a_link_is_saved_where_it_is(path: Path, tmp_path: Path) -> None:
    folder, links = tmp_path / "real", tmp_path / "links"
    folder.mkdir()
    links.mkdir()
    shutil.copy(asset_path("characters/low.npz"), folder / "own.npz")
    session = open_session(str(folder / "own.npz"))
    session.save(folder / "s.json")
    assert json.loads((folder / "s.json").read_text())["subject"] == "own.npz"
    link = links / "s.json"
    link.symlink_to(folder / "s.json")
    session = open_session(str(link))
    session.set_prior_weight(2.0)
    session.save(link)
    assert not session.changed_on_disk()
    assert link.is_symlink()
    written = json.loads((folder / "s.json").read_text())
    assert (written["subject"], written["prior_weight"]) == ("own.npz", 2.0)
    assert [entry.name for entry in links.iterdir()] == ["s.json"]
    assert open_session(str(folder / "s.json")).document.prior_weight == 2.0
