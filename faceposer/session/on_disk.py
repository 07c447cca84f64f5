"""Session files on the disk: changes by other programs, and files that are open in another window."""

import hashlib
from contextlib import suppress
from pathlib import Path

from faceposer.files import paths
from faceposer.files.reading import open_file
from faceposer.files.user_folders import state_folder
from faceposer.session.file_lock import FileLock, take_lock

_LARGEST = 64 * 2**20


def content_of(path: Path) -> str | None:
    """Return a digest of the content of the file ``path``, or None if there is no file that could be read."""
    if not paths.is_file(path):
        return None
    try:
        with open_file(path) as file:
            return hashlib.sha256(file.read(_LARGEST)).hexdigest()
    except (OSError, ValueError):
        return None


def content_of_text(text: str) -> str:
    """Return the digest of a file with ``text`` in UTF-8."""
    return hashlib.sha256(text.encode("utf-8")).hexdigest()


def open_files_folder() -> Path:
    """Return the folder of the locks of open session files, which may not exist."""
    return state_folder() / "open"


class OpenFile:
    """The session file that this program has open; a lock in the user's state folder tells other windows.

    The session file and its folder are left alone. The system releases the lock when the program ends for any reason.
    """

    def __init__(self, folder: Path) -> None:
        """Keep locks in ``folder``, created with the first one; locks of programs that were killed are removed."""
        self._folder = folder
        self._lock: FileLock | None = None
        for left in paths.files_in(folder, ".lock"):
            with suppress(OSError):
                if (lock := take_lock(left)) is not None:
                    lock.release(remove=True)

    def hold(self, path: Path | None) -> bool:
        """Hold ``path`` instead of the previous file; return False if another program has it open."""
        name = None if path is None else _name_of(path)
        if self._lock is not None and self._lock.path.name == name:
            return True
        self.release()
        if name is None:
            return True
        # Without a folder for locks, there is no knowing; saving still notices what others have written.
        with suppress(OSError):
            self._folder.mkdir(parents=True, exist_ok=True)
            self._lock = take_lock(self._folder / name)
            return self._lock is not None
        return True

    def release(self) -> None:
        """Hold no file."""
        if self._lock is not None:
            self._lock.release(remove=True)
            self._lock = None


def _name_of(path: Path) -> str:
    whole = str(paths.resolved(path)).encode("utf-8", "surrogateescape")
    return f"{hashlib.sha256(whole).hexdigest()[:32]}.lock"
