"""Autosave: a journal of the unsaved work, and the recovery of journals after a crash.

Each running program writes its own journal (docs/autosave.md) and holds a lock next to it. The system releases the lock
when the program ends for any reason. A journal with a free lock is an orphan: only a program that did not end normally
leaves one.
"""

import errno
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
from faceposer.files import paths
from faceposer.files.json_documents import JsonDocument, JsonError, UnreadableError, check_header, convert, read_json
from faceposer.files.user_folders import state_folder
from faceposer.files.writing import write_json
from faceposer.geometry.camera import Camera
from faceposer.session.document import Document
from faceposer.session.file_lock import FileLock, take_lock
from faceposer.session.on_disk import content_of
from faceposer.session.opening import session_for
from faceposer.session.session import Session
from faceposer.session.solver_worker import Worker

FORMAT = "faceposer.autosave"
VERSION = 1
# Seconds from a committed step to the write: consecutive steps are written together.
DEBOUNCE = 0.25
# Seconds before a failed write is retried.
_RETRY = 10.0
_MAX_BYTES = 64 * 2**20


def autosave_dir() -> Path:
    """Return the folder of the journals, which may not exist."""
    return state_folder() / "autosave"


def unusable(folder: Path) -> str:
    """Return why no journal can be written in ``folder``, which is created if missing, or "" if one can."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except (OSError, ValueError) as error:
        return getattr(error, "strerror", None) or str(error)
    writable = paths.can_enter(folder) and os.access(folder, os.W_OK)
    return "" if writable else os.strerror(errno.EACCES)


def _now() -> datetime:
    return datetime.now(UTC)


class Journal:
    """The journal of a session in this program: a file that exists while there is unsaved work.

    Attributes:
        folder: Folder of the journals of all programs.
    """

    def __init__(
        self, folder: Path, clock: Callable[[], float] = time.monotonic, now: Callable[[], datetime] = _now
    ) -> None:
        """Set up a journal in ``folder``; the folder, the lock and the journal are created with the first write.

        Args:
            folder: Folder of the journals of all programs.
            clock: Monotonic time in seconds.
            now: Date and time with time zone.
        """
        self.folder = folder
        self._clock = clock
        self._now = now
        self._lock: FileLock | None = None
        self._written: tuple[Document, Path | None] | None = None
        self._due = math.inf
        self._not_before = -math.inf

    @property
    def path(self) -> Path | None:
        """The file of the journal, or None before the first write."""
        return None if self._lock is None else self._lock.path.with_suffix(".json")

    @property
    def patience(self) -> float:
        """Seconds until the next write is due."""
        return max(self._due - self._clock(), 0.0)

    def update(self, session: Session, camera: Camera | None = None) -> None:
        """Write the committed but unsaved work of ``session`` when due; remove the journal if there is none.

        Raises:
            FacePoserError: If the journal cannot be written or removed; later calls retry.
        """
        unsaved = session.unsaved
        changed = self._written is not None if unsaved is None else self._written != (unsaved, session.path)
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
        """Write or remove the journal at once; ``camera`` is the current view, if any.

        Raises:
            FacePoserError: If the journal cannot be written or removed.
        """
        unsaved = session.unsaved
        if unsaved is None:
            self._remove()
        else:
            data = _to_json(session, unsaved, camera, self._now())
            # No fsync: it would stall the window, and the data outlives a killed program without it.
            write_json(self._own_path(), data, "journal", indent=None, durable=False)
            self._written = (unsaved, session.path)
        self._due, self._not_before = math.inf, -math.inf

    def close(self, keep: bool) -> None:
        """Close the journal; with ``keep``, leave the file for the next program, else remove all files."""
        removed = not keep
        if removed:
            try:
                self._remove()
            except FacePoserError:
                removed = False
        if self._lock is not None:
            self._lock.release(remove=removed or self._written is None)
            self._lock = None

    def _remove(self) -> None:
        path = self.path
        try:
            if path is not None:
                path.unlink(missing_ok=True)
        except OSError as error:
            raise FacePoserError(f"The journal '{path}' cannot be removed: {error.strerror}.") from error
        self._written = None

    def _own_path(self) -> Path:
        """Return the path of the journal, taking its lock on the first call."""
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            while self._lock is None:
                self._lock = take_lock(self.folder / f"{os.getpid()}-{secrets.token_hex(6)}.lock")
        except OSError as error:
            raise FacePoserError(f"No journal can be written in '{self.folder}': {error.strerror}.") from error
        return self._lock.path.with_suffix(".json")


def _to_json(session: Session, document: Document, camera: Camera | None, now: datetime) -> dict[str, Any]:
    if camera is not None:
        document = replace(document, camera=camera)
    if not document.solved and session.mode == "live":
        # The pose is older than the constraints: it is solved when the journal is opened.
        document = replace(document, coefficients=None)
    path = None if session.path is None else paths.absolute(session.path)
    character = Path(document.character)
    beside = path is not None and paths.is_file(paths.folder_of(path) / character)
    if character.suffix.lower() == ".npz" and not beside:
        # The path is relative to the current folder.
        document = replace(document, character=str(paths.absolute(paths.expand_user(character))))
    return {
        "format": FORMAT,
        "version": VERSION,
        "path": None if path is None else str(path),
        "saved_at": now.isoformat(),
        "session": document.with_version_data(session.model).to_json(),
    }


@dataclass(frozen=True, eq=False)
class Orphan:
    """The unsaved work of a crashed program. Its lock is held, so that no other program recovers it as well.

    Attributes:
        journal: Path of the journal.
        document: The unsaved document.
        path: Its session file; None if it was never saved.
        saved_at: Time of the last write, in UTC.
        lock: Lock of the journal.
    """

    journal: Path
    document: Document
    path: Path | None
    saved_at: datetime
    lock: FileLock

    @property
    def name(self) -> str:
        """Name of the session file, or of the character if there is none."""
        return self.path.name if self.path is not None else Path(self.document.character).stem

    @property
    def outdated(self) -> bool:
        """True if the session file is newer than the journal."""
        try:
            return self.path is not None and self.path.stat().st_mtime > self.saved_at.timestamp()
        except OSError:
            return False

    def open(self, worker: Worker | None = None) -> Session:
        """Return a session with the recovered document, marked as unsaved; ``worker`` is its solver.

        Raises:
            FacePoserError: If the character cannot be opened or does not fit.
        """
        # The user has been told of a newer file; saving then asks once more.
        content = None if self.path is None or self.outdated else content_of(self.path)
        session = session_for(self.document, self.path, worker, content)
        session.mark_unsaved()
        return session

    def remove(self) -> None:
        """Delete the journal.

        Raises:
            FacePoserError: If the journal cannot be deleted.
        """
        try:
            self.journal.unlink(missing_ok=True)
        except OSError as error:
            self.lock.release()
            raise FacePoserError(f"The journal '{self.journal}' cannot be removed: {error.strerror}.") from error
        self.lock.release(remove=True)

    def release(self) -> None:
        """Release the lock and keep the journal for later."""
        self.lock.release()


@dataclass(frozen=True)
class FoundJournals:
    """Journals of earlier programs.

    Attributes:
        orphans: Journals with recoverable work, newest first.
        damaged: Unreadable journals, under their new names.
    """

    orphans: tuple[Orphan, ...]
    damaged: tuple[Path, ...]


def find_orphans(folder: Path) -> FoundJournals:
    """Return the journals in ``folder`` left by programs that no longer run, and take their locks.

    Unreadable journals are renamed, so that they are reported once; temporary files of a crashed program are removed.
    A folder that cannot be read yields no journals.
    """
    orphans: list[Orphan] = []
    damaged: list[Path] = []
    for name in sorted({path.stem for path in paths.files_in(folder, ".json", ".lock") if path.name[0] != "."}):
        journal = folder / f"{name}.json"
        with suppress(OSError):
            lock = take_lock(journal.with_suffix(".lock"))
            if lock is None:
                continue
            orphan = _claim(journal, lock, damaged)
            if orphan is not None:
                orphans.append(orphan)
    orphans.sort(key=lambda orphan: orphan.saved_at, reverse=True)
    return FoundJournals(tuple(orphans), tuple(damaged))


def _claim(journal: Path, lock: FileLock, damaged: list[Path]) -> Orphan | None:
    """Return the work in ``journal``; without any, release the lock, and rename and record a damaged journal."""
    orphan = None
    left = False
    try:
        for temporary in paths.files_in(journal.parent, ".tmp"):
            if temporary.name.startswith(f".{journal.name}."):
                temporary.unlink(missing_ok=True)
        orphan = _read(journal, lock)
        left = paths.exists(journal)
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
    while paths.exists(path):
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
    """Return the work in ``journal``, or None if the file is missing or written by a newer version of the program.

    Raises:
        UnreadableError: If the file cannot be read.
        FacePoserError: If it is damaged.
    """
    if not paths.exists(journal):
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
