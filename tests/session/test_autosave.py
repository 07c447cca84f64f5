"""What is not saved is on the disk soon after each step and found again after a kill; a clean end leaves nothing."""

import json
import subprocess
import sys
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import pytest

from faceposer.errors import FacePoserError
from faceposer.geometry.camera import OrbitView
from faceposer.model.face_model import FaceModel
from faceposer.session.autosave import DEBOUNCE, Journal, find_orphans
from faceposer.session.document import Document
from faceposer.session.file_lock import take_lock
from faceposer.session.session import Session
from faceposer.solve.constraints.point import PointConstraint

CAMERA = OrbitView((0.0, 1.0, 2.0)).camera((640, 480))


class Clock:
    def __init__(self) -> None:
        self.seconds = 100.0

    def __call__(self) -> float:
        return self.seconds


@pytest.fixture
def session(model: FaceModel) -> Session:
    return Session(model, Document("man"))


def add_point(session: Session, vertex: int) -> None:
    session.add_constraint(PointConstraint(vertex, (100.0, 100.0), CAMERA), "Add")
    session.poll()


def journal_in(folder: Path, clock: Clock, hour: int = 12) -> Journal:
    return Journal(folder, clock, lambda: datetime(2026, 1, 1, hour, tzinfo=UTC))


def kept(folder: Path) -> list[Path]:
    return sorted(folder.glob("*.json"))


def test_a_step_is_on_the_disk_after_the_debounce(session: Session, tmp_path: Path) -> None:
    clock = Clock()
    journal = journal_in(tmp_path, clock)
    journal.follow(session)
    assert kept(tmp_path) == []
    add_point(session, 10)
    journal.follow(session)
    assert kept(tmp_path) == []
    assert 0.0 < journal.patience <= DEBOUNCE
    clock.seconds += DEBOUNCE
    journal.follow(session, CAMERA)
    (path,) = kept(tmp_path)
    data = json.loads(path.read_text())
    assert data["format"] == "faceposer.autosave"
    assert data["path"] is None
    assert len(data["session"]["constraints"]) == 1
    assert "camera" in data["session"]


def test_while_a_gesture_goes_on_the_steps_before_it_are_kept(session: Session, tmp_path: Path) -> None:
    clock = Clock()
    journal = journal_in(tmp_path, clock)
    add_point(session, 10)
    with session.edit("A long drag"):
        constraints = (*session.document.constraints, PointConstraint(20, (5.0, 5.0), CAMERA))
        session.replace(replace(session.document, constraints=constraints))
        for _ in range(3):
            journal.follow(session)
            clock.seconds += DEBOUNCE
        (path,) = kept(tmp_path)
        assert len(json.loads(path.read_text())["session"]["constraints"]) == 1


def test_saving_and_undoing_all_remove_the_journal(session: Session, tmp_path: Path) -> None:
    clock = Clock()
    folder = tmp_path / "journals"
    journal = journal_in(folder, clock)
    add_point(session, 10)
    journal.flush(session)
    session.save(tmp_path / "saved.json")
    journal.follow(session)
    assert kept(folder) == []
    add_point(session, 20)
    journal.flush(session)
    assert len(kept(folder)) == 1
    session.undo()
    journal.follow(session)
    assert kept(folder) == []
    journal.close(keep=False)
    assert list(folder.iterdir()) == []


def test_a_running_program_s_journal_is_nobody_s_orphan(session: Session, tmp_path: Path) -> None:
    journal = journal_in(tmp_path, Clock())
    add_point(session, 10)
    journal.flush(session)
    assert find_orphans(tmp_path).orphans == ()
    journal.close(keep=True)
    (orphan,) = find_orphans(tmp_path).orphans
    assert find_orphans(tmp_path).orphans == (), "who has found it holds it"
    again = orphan.open()
    assert again.dirty
    assert again.document.same_input(session.document)
    orphan.remove()
    assert list(tmp_path.iterdir()) == []


def test_the_newest_orphan_comes_first_and_knows_its_file(session: Session, tmp_path: Path) -> None:
    session.save(tmp_path / "smile.json")
    add_point(session, 10)
    folder = tmp_path / "journals"
    for hour in (9, 15, 12):
        journal = journal_in(folder, Clock(), hour)
        journal.flush(session)
        journal.close(keep=True)
    orphans = find_orphans(folder).orphans
    assert [orphan.saved_at.hour for orphan in orphans] == [15, 12, 9]
    assert orphans[0].name == "smile.json"
    assert orphans[0].open().path == tmp_path / "smile.json"
    assert orphans[0].outdated, "the file on the disk is of today"
    for orphan in orphans:
        orphan.release()
    assert len(find_orphans(folder).orphans) == 3


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"{",
        b"[]",
        b"\xff\xfe",
        b'{"format": "faceposer.autosave", "version": 1}',
        b'{"format": "faceposer.autosave", "version": 1, "path": "x", "saved_at": "2026-01-01", "session": {}}',
        b"[" * 100_000,
    ],
)
def test_damaged_journals_are_put_aside_and_not_lost(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "1-a.json").write_bytes(content)
    found = find_orphans(tmp_path)
    assert found.orphans == ()
    assert [path.read_bytes() for path in found.damaged] == [content]
    assert find_orphans(tmp_path).damaged == ()


def test_a_folder_that_cannot_be_written_is_told_once_in_a_while(session: Session, tmp_path: Path) -> None:
    clock = Clock()
    (tmp_path / "file").write_text("")
    journal = journal_in(tmp_path / "file" / "folder", clock)
    add_point(session, 10)
    journal.follow(session)
    clock.seconds += DEBOUNCE
    with pytest.raises(FacePoserError, match="No journal can be kept"):
        journal.follow(session)
    journal.follow(session)
    journal.close(keep=False)


def test_a_killed_program_releases_its_lock(tmp_path: Path) -> None:
    path = tmp_path / "held.lock"
    script = (
        "import sys, time; from pathlib import Path; from faceposer.session.file_lock import take_lock; "
        "lock = take_lock(Path(sys.argv[1])); print('held', flush=True); time.sleep(60)"
    )
    program = subprocess.Popen([sys.executable, "-c", script, str(path)], stdout=subprocess.PIPE, text=True)
    try:
        assert program.stdout is not None
        assert program.stdout.readline() == "held\n"
        assert take_lock(path) is None
    finally:
        program.kill()
        program.wait()
        program.stdout.close()
    lock = take_lock(path)
    assert lock is not None
    lock.release(remove=True)
    assert not path.exists()
