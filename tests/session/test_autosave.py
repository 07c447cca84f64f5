"""What is not saved is on the disk, and found again once the program that wrote it is gone."""

import json
import os
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pytest

from faceposer.errors import FacePoserError
from faceposer.geometry.camera import OrbitView
from faceposer.model.character_file import load_character, save_character
from faceposer.model.face_model import FaceModel
from faceposer.resources import asset_path
from faceposer.session import autosave
from faceposer.session.autosave import DEBOUNCE, Journal, find_orphans
from faceposer.session.document import Document, read_document
from faceposer.session.file_lock import take_lock
from faceposer.session.opening import open_session
from faceposer.session.session import Session
from faceposer.solve.constraints.point import PointConstraint

CAMERA = OrbitView((0.0, 1.0, 2.0), 0.3, 0.2).camera((640, 480))
NOON = datetime(2024, 5, 17, 12, 0, tzinfo=UTC)


class Clock:
    """A time that passes when told to."""

    def __init__(self) -> None:
        self.seconds = 100.0

    def __call__(self) -> float:
        return self.seconds

    def now(self) -> datetime:
        return NOON + timedelta(seconds=self.seconds)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return tmp_path / "state" / "autosave"


@pytest.fixture
def clock() -> Clock:
    return Clock()


@pytest.fixture
def journal(folder: Path, clock: Clock) -> Journal:
    return Journal(folder, clock, clock.now)


@pytest.fixture
def session(model: FaceModel) -> Session:
    return Session(model, Document("man"))


def pin(session: Session, vertex: int = 77) -> None:
    # The target is where the view shows the point, so that nothing pulls.
    u, v = CAMERA.project(session.model.character.vertices[[vertex]])[0].tolist()
    session.add_constraint(PointConstraint(vertex, (u, v), CAMERA), "Place a point")
    session.wait()


def files(folder: Path) -> list[str]:
    return sorted(path.suffix for path in folder.iterdir()) if folder.is_dir() else []


def written(journal: Journal) -> dict:
    assert journal.path is not None
    return json.loads(journal.path.read_text())


def wait(journal: Journal, session: Session, clock: Clock, seconds: float = DEBOUNCE) -> None:
    journal.update(session)
    clock.seconds += seconds
    journal.update(session)


def test_nothing_is_written_while_everything_is_saved(journal: Journal, session: Session, folder: Path) -> None:
    journal.flush(session)
    journal.update(session)
    journal.close(keep=True)
    assert not folder.exists()
    assert find_orphans(folder).orphans == ()


def test_a_step_is_on_the_disk_after_a_moment(
    journal: Journal, session: Session, folder: Path, clock: Clock, tmp_path: Path
) -> None:
    pin(session)
    journal.update(session, CAMERA)
    assert files(folder) == []
    assert journal.patience == pytest.approx(DEBOUNCE)
    assert DEBOUNCE <= 0.3
    clock.seconds += 0.5 * DEBOUNCE
    pin(session, 78)
    journal.update(session, CAMERA)
    assert journal.patience == pytest.approx(0.5 * DEBOUNCE), "a second step does not put it off"
    clock.seconds += 0.5 * DEBOUNCE
    journal.update(session, CAMERA)
    assert files(folder) == [".json", ".lock"], "no temporary file is left"
    data = written(journal)
    assert set(data) == {"format", "version", "path", "saved_at", "session"}
    assert data["format"] == "faceposer.autosave"
    assert data["version"] == 1
    assert data["path"] is None
    assert datetime.fromisoformat(data["saved_at"]) == clock.now()
    inner = tmp_path / "inner.json"
    inner.write_text(json.dumps(data["session"]))
    document = read_document(inner)
    assert len(document.constraints) == 2
    assert document.camera == CAMERA
    assert journal.patience == np.inf


def test_what_did_not_change_is_not_written_again(
    journal: Journal, session: Session, clock: Clock, monkeypatch: pytest.MonkeyPatch
) -> None:
    writes = []
    original = autosave.write_json
    monkeypatch.setattr(
        autosave, "write_json", lambda *words, **more: (writes.append(words[0]), original(*words, **more))[1]
    )
    pin(session)
    for _ in range(20):
        wait(journal, session, clock)
    assert len(writes) == 1
    with session.edit("Look around"):
        pass
    wait(journal, session, clock)
    assert len(writes) == 1


def test_the_last_finished_step_is_written_while_another_is_under_way(
    journal: Journal, session: Session, clock: Clock
) -> None:
    pin(session)
    with session.edit("Place a point"):
        session.replace(replace(session.document, prior_weight=3.0))
        wait(journal, session, clock)
        assert len(written(journal)["session"]["constraints"]) == 1
        assert written(journal)["session"]["prior_weight"] == 1.0
    wait(journal, session, clock)
    assert written(journal)["session"]["prior_weight"] == 3.0


def test_a_step_under_way_alone_leaves_nothing(journal: Journal, session: Session, folder: Path, clock: Clock) -> None:
    with session.edit("Change the prior weight"):
        session.replace(replace(session.document, prior_weight=3.0))
        wait(journal, session, clock)
        assert files(folder) == []


def test_saving_and_undoing_remove_it(
    journal: Journal, session: Session, folder: Path, clock: Clock, tmp_path: Path
) -> None:
    pin(session)
    wait(journal, session, clock)
    assert ".json" in files(folder)
    session.save(tmp_path / "a.json")
    journal.update(session)
    assert files(folder) == [".lock"], "at once"
    pin(session, 78)
    wait(journal, session, clock)
    assert written(journal)["path"] == str(tmp_path / "a.json")
    session.undo()
    journal.update(session)
    assert files(folder) == [".lock"]
    journal.close(keep=False)
    assert files(folder) == []


def test_a_clean_end_removes_it_and_another_end_keeps_it(
    journal: Journal, session: Session, folder: Path, clock: Clock
) -> None:
    pin(session)
    wait(journal, session, clock)
    assert find_orphans(folder).orphans == (), "its program is running"
    journal.close(keep=False)
    assert files(folder) == []
    again = Journal(folder, clock, clock.now)
    again.flush(session)
    again.close(keep=True)
    (orphan,) = find_orphans(folder).orphans
    assert orphan.name == "man"
    assert orphan.path is None
    assert orphan.saved_at == clock.now()
    assert find_orphans(folder).orphans == (), "only one program offers it"
    orphan.release()
    (orphan,) = find_orphans(folder).orphans
    orphan.remove()
    assert files(folder) == []


def orphaned(folder: Path, session: Session, now: Callable[[], datetime] = lambda: NOON) -> Path:
    journal = Journal(folder, now=now)
    journal.flush(session, CAMERA)
    path = journal.path
    assert path is not None
    journal.close(keep=True)
    return path


def test_recovered_work_is_not_saved_and_knows_its_file(session: Session, folder: Path, tmp_path: Path) -> None:
    path = tmp_path / "smile.json"
    pin(session)
    session.save(path)
    pin(session, 78)
    orphaned(folder, session)
    (orphan,) = find_orphans(folder).orphans
    again = orphan.open()
    assert again.dirty
    assert again.path == path
    assert again.document.same_input(session.document)
    np.testing.assert_array_equal(again.coefficients, session.coefficients)
    assert again.unsaved is again.document
    assert orphan.outdated, "the file is younger than the journal's time, which is of 2024"
    os.utime(path, (NOON.timestamp() - 10.0, NOON.timestamp() - 10.0))
    assert not orphan.outdated
    path.unlink()
    assert not orphan.outdated
    again.save(path)
    assert not again.dirty
    assert again.unsaved is None
    orphan.release()


def test_the_newest_comes_first(session: Session, folder: Path) -> None:
    pin(session)
    for minutes in (3, 9, 1):
        orphaned(folder, session, lambda minutes=minutes: NOON + timedelta(minutes=minutes))
    found = find_orphans(folder).orphans
    assert [(orphan.saved_at - NOON).seconds // 60 for orphan in found] == [9, 3, 1]
    for orphan in found:
        orphan.release()


def test_characters_are_found_from_wherever_they_were_named(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    work, elsewhere = tmp_path / "work", tmp_path / "elsewhere"
    work.mkdir()
    elsewhere.mkdir()
    save_character(work / "hero.npz", load_character("man"))
    monkeypatch.chdir(work)
    named = open_session("hero.npz")
    pin(named)
    orphaned(folder, named)
    (work / "pose.json").write_text(
        json.dumps({"format": "faceposer.session", "version": 1, "subject": "hero.npz", "constraints": []})
    )
    monkeypatch.chdir(tmp_path)
    beside = open_session("work/pose.json")
    pin(beside)
    orphaned(folder, beside, lambda: NOON + timedelta(minutes=1))
    monkeypatch.chdir(elsewhere)
    second, first = find_orphans(folder).orphans
    assert first.document.character == str(work / "hero.npz")
    assert second.document.character == str(work / "hero.npz")
    assert second.path == work / "pose.json"
    for orphan in (first, second):
        assert len(orphan.open().document.constraints) == 1
    (work / "hero.npz").unlink()
    monkeypatch.setattr("faceposer.session.opening.load_model", load_character)
    for orphan in (first, second):
        with pytest.raises(FacePoserError, match=r"hero\.npz"):
            orphan.open()
        orphan.release()


def test_a_pose_that_lags_behind_is_solved_anew(session: Session, folder: Path) -> None:
    pin(session)
    with session.edit("Pull"):
        moved = replace(session.document.constraints[0], target=(300.0, 200.0))
        session.replace(session.document.with_constraint(0, moved))
    assert not session.document.solved
    journal = orphaned(folder, session)
    assert "coefficients" not in json.loads(journal.read_text())["session"]
    (orphan,) = find_orphans(folder).orphans
    again = orphan.open()
    again.wait()
    session.wait()
    assert again.residuals_px[0] == pytest.approx(session.residuals_px[0], abs=1.0)
    orphan.release()


def changed(change: dict) -> Callable[[dict], bytes]:
    return lambda data: json.dumps(data | change).encode()


@pytest.mark.parametrize(
    "damage",
    [
        lambda data: b"",
        lambda data: json.dumps(data).encode()[:-20],
        lambda data: b"\xff\xfe\x00",
        lambda data: b"[" * 100_000,
        lambda data: b"1" * 5000,
        lambda data: b"[]",
        lambda data: json.dumps({key: data[key] for key in data if key != "path"}).encode(),
        changed({"format": "faceposer.session"}),
        changed({"version": 0}),
        changed({"version": True}),
        changed({"version": "1"}),
        changed({"mood": "good"}),
        changed({"path": 5}),
        changed({"path": ""}),
        changed({"path": "smile.json"}),
        changed({"path": "/a\0b.json"}),
        changed({"saved_at": None}),
        changed({"saved_at": "yesterday"}),
        changed({"saved_at": "2024-05-17T12:00:00"}),
        changed({"saved_at": "0001-01-01T00:00:00+14:00"}),
        changed({"session": None}),
        changed({"session": {"format": "faceposer.session", "version": 1}}),
    ],
)
def test_damaged_journals_are_put_aside(session: Session, folder: Path, damage: Callable[[dict], bytes]) -> None:
    pin(session)
    journal = orphaned(folder, session)
    content = damage(json.loads(journal.read_text()))
    journal.write_bytes(content)
    good = orphaned(folder, session, lambda: NOON + timedelta(minutes=1))
    found = find_orphans(folder)
    assert [orphan.journal for orphan in found.orphans] == [good]
    assert found.damaged == (journal.with_suffix(".damaged"),)
    assert found.damaged[0].read_bytes() == content
    assert not journal.exists()
    found.orphans[0].release()
    assert find_orphans(folder).damaged == ()


def test_numbers_too_large_for_numbers_are_damage_too(session: Session, folder: Path) -> None:
    pin(session)
    journal = orphaned(folder, session)
    data = json.loads(journal.read_text())
    data["session"]["prior_weight"] = 10**400
    journal.write_text(json.dumps(data))
    found = find_orphans(folder)
    assert found.orphans == ()
    assert len(found.damaged) == 1


def test_what_is_no_file_or_too_large_is_not_read(
    session: Session, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pin(session)
    journal = orphaned(folder, session)
    (folder / "a.json").mkdir()
    monkeypatch.setattr(autosave, "_MAX_BYTES", 100)
    found = find_orphans(folder)
    assert found.orphans == ()
    assert set(found.damaged) == {journal.with_suffix(".damaged"), folder / "a.damaged"}
    if sys.platform != "win32":
        os.mkfifo(folder / "b.json")
        assert find_orphans(folder).damaged == (folder / "b.damaged",)


def test_damaged_journals_do_not_overwrite_each_other(folder: Path) -> None:
    folder.mkdir(parents=True)
    for content in ("first", "second"):
        (folder / "a.json").write_text(content)
        find_orphans(folder)
    assert sorted(path.read_text() for path in folder.glob("*.damaged")) == ["first", "second"]


def test_journals_of_a_newer_program_are_left_to_it(session: Session, folder: Path) -> None:
    pin(session)
    journal = orphaned(folder, session)
    journal.write_text(json.dumps(json.loads(journal.read_text()) | {"version": 2, "more": 1}))
    assert find_orphans(folder) == autosave.FoundJournals((), ())
    assert journal.is_file()


def test_what_a_killed_program_leaves_beside_its_journal_goes(session: Session, folder: Path) -> None:
    pin(session)
    journal = orphaned(folder, session)
    half = folder / f".{journal.name}.123.tmp"
    half.write_text("{")
    (folder / "9-9.lock").touch()
    (orphan,) = find_orphans(folder).orphans
    assert sorted(path.name for path in folder.iterdir()) == [journal.name, journal.with_suffix(".lock").name]
    orphan.release()


def test_a_folder_that_is_none_holds_nothing(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    assert find_orphans(tmp_path / "file") == autosave.FoundJournals((), ())
    assert find_orphans(tmp_path / "nowhere") == autosave.FoundJournals((), ())


def test_a_journal_that_cannot_be_written_is_told_and_tried_again(
    session: Session, tmp_path: Path, clock: Clock
) -> None:
    place = tmp_path / "file"
    place.touch()
    journal = Journal(place / "autosave", clock, clock.now)
    pin(session)
    with pytest.raises(FacePoserError, match="No journal can be written"):
        wait(journal, session, clock)
    journal.update(session)
    assert journal.patience > 1.0
    place.unlink()
    pin(session, 78)
    wait(journal, session, clock, 20.0)
    assert len(written(journal)["session"]["constraints"]) == 2
    journal.close(keep=False)


def test_a_lock_is_held_by_one_and_ends_with_its_holder(tmp_path: Path) -> None:
    path = tmp_path / "a.lock"
    lock = take_lock(path)
    assert lock is not None
    assert take_lock(path) is None
    lock.release()
    lock.release(remove=True)
    assert path.exists()
    code = (
        "import sys; from pathlib import Path; from faceposer.session.file_lock import take_lock\n"
        f"lock = take_lock(Path({str(path)!r})); print(lock is not None, flush=True); sys.stdin.read()"
    )
    other = subprocess.Popen([sys.executable, "-c", code], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    try:
        assert other.stdout is not None
        assert other.stdout.readline() == "True\n"
        assert take_lock(path) is None
    finally:
        other.kill()
        other.communicate()
    lock = take_lock(path)
    assert lock is not None
    lock.release(remove=True)
    assert not path.exists()


def test_shipped_characters_are_named_by_their_name(session: Session, folder: Path) -> None:
    pin(session)
    data = json.loads(orphaned(folder, session).read_text())
    assert data["session"]["subject"] == "man"
    assert asset_path("characters/man.npz").is_file()
