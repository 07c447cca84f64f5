"""Keeps what is not saved yet in a journal on the disk, and finds the journals of programs that were killed.

Each running program has a journal of its own (docs/autosave.md) and holds a lock beside it. The system releases the
lock when the program ends in whatever way. A journal whose lock is free is an orphan: only a program that did not end
by itself leaves one behind.
"""

import json
import math
import os
import secrets
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated, Any

from msgspec import Meta

from faceposer.errors import FacePoserError
from faceposer.files.atomic import write_text
from faceposer.files.json_documents import JsonDocument, JsonError, UnreadableError, check_header, convert, read_json
from faceposer.files.user_folders import state_folder
from faceposer.geometry.camera import Camera
from faceposer.session.document import Document
from faceposer.session.file_lock import FileLock, take_lock
from faceposer.session.opening import session_of
from faceposer.session.session import Session
from faceposer.session.solver_worker import Worker

FORMAT = "faceposer.autosave"
VERSION = 1
# Seconds from a committed step to its place on the disk: several steps in a row are one write.
DEBOUNCE = 0.25
# Seconds after which a journal that could not be written is tried again.
_RETRY = 10.0
_MAX_BYTES = 64 * 2**20


def autosave_dir() -> Path:
    """Return the folder of the journals; it need not exist."""
    return state_folder() / "autosave"


def _now() -> datetime:
    return datetime.now(UTC)


class Journal:
    """This program's journal: there while something is not saved, gone otherwise."""

    def __init__(
        self, folder: Path, clock: Callable[[], float] = time.monotonic, now: Callable[[], datetime] = _now
    ) -> None:
        """Keep a journal in ``folder``; it, the lock and the journal are made when there is something to keep.

        Args:
            folder: Where the journals of all programs lie.
            clock: Seconds, from any beginning.
            now: Date and time, with the time zone.
        """
        self._folder = folder
        self._clock = clock
        self._now = now
        self._lock: FileLock | None = None
        self._held: tuple[Document, Path | None] | None = None
        self._due = math.inf
        self._not_before = -math.inf

    @property
    def path(self) -> Path | None:
        """The journal's file, or None as long as there was nothing to keep."""
        return None if self._lock is None else self._lock.path.with_suffix(".json")

    @property
    def patience(self) -> float:
        """For how many seconds there is nothing to write."""
        return max(self._due - self._clock(), 0.0)

    def follow(self, session: Session, camera: Camera | None = None) -> None:
        """Write what ``session`` has committed and not saved once it is due; if there is nothing such, keep nothing.

        Raises:
            FacePoserError: If the journal cannot be written or removed; later calls try again.
        """
        unsaved = session.unsaved
        changed = self._held is not None if unsaved is None else self._held != (unsaved, session.path)
        if not changed:
            self._due = math.inf
            return
        now = self._clock()
        due = now if unsaved is None else min(self._due, now + DEBOUNCE)
        self._due = max(due, self._not_before)
        if now >= self._due:
            self._not_before = now + _RETRY
            self.flush(session, camera)

    def flush(self, session: Session, camera: Camera | None = None) -> None:
        """Bring the disk up to date at once; ``camera`` is the view to remember, if any.

        Raises:
            FacePoserError: If the journal cannot be written or removed.
        """
        unsaved = session.unsaved
        if unsaved is None:
            self._remove()
        else:
            data = _to_json(session, unsaved, camera, self._now())
            # Waiting for the disk would be felt, and the data of a killed program reaches it anyway.
            write_text(self._own_path(), json.dumps(data) + "\n", "journal", durable=False)
            self._held = (unsaved, session.path)
        self._due, self._not_before = math.inf, -math.inf

    def close(self, keep: bool) -> None:
        """End; with ``keep`` leave the journal to be found by the next program, else remove all that was written."""
        removed = not keep
        if removed:
            try:
                self._remove()
            except FacePoserError:
                removed = False
        if self._lock is not None:
            self._lock.release(remove=removed or self._held is None)
            self._lock = None

    def _remove(self) -> None:
        path = self.path
        try:
            if path is not None:
                path.unlink(missing_ok=True)
        except OSError as error:
            raise FacePoserError(f"The journal '{path}' cannot be removed: {error.strerror}.") from error
        self._held = None

    def _own_path(self) -> Path:
        """Return the path of the journal, whose lock is held from now on."""
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
            while self._lock is None:
                self._lock = take_lock(self._folder / f"{os.getpid()}-{secrets.token_hex(6)}.lock")
        except OSError as error:
            raise FacePoserError(f"No journal can be kept in '{self._folder}': {error.strerror}.") from error
        return self._lock.path.with_suffix(".json")


def _to_json(session: Session, document: Document, camera: Camera | None, now: datetime) -> dict[str, Any]:
    if camera is not None:
        document = replace(document, camera=camera)
    if not document.solved and session.mode == "live":
        # The pose lags behind the constraints; who reads the journal solves for them.
        document = replace(document, coefficients=None)
    path = None if session.path is None else session.path.absolute()
    character = Path(document.character)
    if character.suffix.lower() == ".npz" and not (path is not None and (path.parent / character).is_file()):
        # Named as seen from where the program was started.
        document = replace(document, character=str(character.expanduser().absolute()))
    return {
        "format": FORMAT,
        "version": VERSION,
        "path": None if path is None else str(path),
        "saved_at": now.isoformat(),
        "session": document.stamped(session.model).to_json(),
    }


@dataclass(frozen=True, eq=False)
class Orphan:
    """What a program that was killed had not saved. Its lock is held, so that no other program offers it too.

    Attributes:
        journal: The file that holds it.
        document: The work.
        path: The session file that it belongs to; None if it was never saved.
        saved_at: When it was written, in universal time.
        lock: The journal's lock.
    """

    journal: Path
    document: Document
    path: Path | None
    saved_at: datetime
    lock: FileLock

    @property
    def name(self) -> str:
        """The file's name, or that of the character."""
        return self.path.name if self.path is not None else Path(self.document.character).stem

    @property
    def outdated(self) -> bool:
        """Whether the session file was written after the journal."""
        try:
            return self.path is not None and self.path.stat().st_mtime > self.saved_at.timestamp()
        except OSError:
            return False

    def open(self, worker: Worker | None = None) -> Session:
        """Return a session with the work, which counts as not saved; ``worker`` solves for it.

        Raises:
            FacePoserError: If its character cannot be opened or no longer fits.
        """
        session = session_of(self.document, self.path, worker)
        session.mark_unsaved()
        return session

    def remove(self) -> None:
        """Delete the journal.

        Raises:
            FacePoserError: If that is not possible.
        """
        try:
            self.journal.unlink(missing_ok=True)
        except OSError as error:
            self.lock.release()
            raise FacePoserError(f"The journal '{self.journal}' cannot be removed: {error.strerror}.") from error
        self.lock.release(remove=True)

    def release(self) -> None:
        """Leave the journal for later."""
        self.lock.release()


@dataclass(frozen=True)
class Found:
    """What earlier programs left behind.

    Attributes:
        orphans: Newest first.
        damaged: Journals that nobody can read, by the names that they have now.
    """

    orphans: tuple[Orphan, ...]
    damaged: tuple[Path, ...]


def find_orphans(folder: Path) -> Found:
    """Return the journals in ``folder`` of programs that do not run any more, and hold their locks.

    What cannot be read is renamed, so that nobody stumbles over it again; what a killed program left beside its journal
    is removed. A folder that cannot be read holds nothing.
    """
    orphans: list[Orphan] = []
    damaged: list[Path] = []
    for name in sorted({path.stem for pattern in ("*.json", "*.lock") for path in folder.glob(pattern)}):
        journal = folder / f"{name}.json"
        with suppress(OSError):
            lock = take_lock(journal.with_suffix(".lock"))
            if lock is None:
                continue
            orphan = _claim(journal, lock, damaged)
            if orphan is not None:
                orphans.append(orphan)
    orphans.sort(key=lambda orphan: orphan.saved_at, reverse=True)
    return Found(tuple(orphans), tuple(damaged))


def _claim(journal: Path, lock: FileLock, damaged: list[Path]) -> Orphan | None:
    """Return what ``journal`` holds; without anything to offer, give the lock back and add to ``damaged``."""
    orphan = None
    left = False
    try:
        for temporary in journal.parent.glob(f".{journal.name}.*.tmp"):
            temporary.unlink(missing_ok=True)
        orphan = _read(journal, lock)
        left = journal.exists()
    except (OSError, UnreadableError):
        left = True
    except FacePoserError:
        try:
            damaged.append(journal.replace(_free_name(journal)))
        except OSError:
            left = True
    finally:
        if orphan is None:
            lock.release(remove=not left)
    return orphan


def _free_name(journal: Path) -> Path:
    path = journal.with_suffix(".damaged")
    while path.exists():
        path = journal.with_name(f"{journal.stem}-{secrets.token_hex(3)}.damaged")
    return path


class _JournalFile(JsonDocument, kw_only=True):
    path: str | None
    saved_at: Annotated[datetime, Meta(tz=True, description="a date and time with its zone")]
    session: Any

    def __post_init__(self) -> None:
        path = None if self.path is None else Path(self.path)
        if path is not None and ("\0" in str(path) or not path.is_absolute() or not path.name):
            raise JsonError("must be null or the whole path of a file", "path")
        if not 1980 <= self.saved_at.year < 9999:
            raise JsonError("must be the time of a write", "saved_at")


def _read(journal: Path, lock: FileLock) -> Orphan | None:
    """Return what ``journal`` holds, or None if there is none or a newer program wrote it.

    Raises:
        UnreadableError: If the system does not let it be read.
        FacePoserError: If it is damaged.
    """
    if not journal.exists():
        return None
    return read_json(journal, "journal", lambda data: _parsed(data, journal, lock), _MAX_BYTES)


def _parsed(data: Any, journal: Path, lock: FileLock) -> Orphan | None:
    version = data.get("version") if isinstance(data, dict) else None
    if isinstance(version, int) and version > VERSION and data.get("format") == FORMAT:
        return None
    check_header(data, FORMAT, VERSION)
    form = convert(data, _JournalFile)
    try:
        document = Document.from_json(form.session)
    except (ArithmeticError, LookupError, TypeError, ValueError) as error:
        raise FacePoserError("its session is damaged.") from error
    path = None if form.path is None else Path(form.path)
    return Orphan(journal, document, path, form.saved_at.astimezone(UTC), lock)
