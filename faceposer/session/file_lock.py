"""Locks on files that the system releases when the program ends for any reason."""

import os
import sys
from contextlib import suppress
from pathlib import Path


class FileLock:
    """An exclusive lock on a file, held by this program."""

    def __init__(self, path: Path, descriptor: int) -> None:
        """Wrap the open and locked ``descriptor`` of ``path``; see ``take_lock``."""
        self.path = path
        self._descriptor: int | None = descriptor

    def release(self, remove: bool = False) -> None:
        """Release the lock, and delete the file with ``remove``; further calls have no effect."""
        if self._descriptor is None:
            return
        descriptor, self._descriptor = self._descriptor, None
        # Delete before the release, so that nobody locks a file about to be deleted; Windows does not allow this.
        if remove and sys.platform != "win32":
            _delete(self.path)
        os.close(descriptor)
        if remove and sys.platform == "win32":
            _delete(self.path)


def take_lock(path: Path) -> FileLock | None:
    """Return a lock on the file ``path``, created if missing, or None if another program holds the lock.

    Raises:
        OSError: If the file cannot be created, or if its file system does not support locks.
    """
    while True:
        descriptor = os.open(path, os.O_RDWR | os.O_CREAT, 0o600)
        try:
            held = _lock(descriptor)
            # The last holder may have deleted the file between opening and locking: retry with a new one.
            current = held and _is_at(descriptor, path)
        except BaseException:
            os.close(descriptor)
            raise
        if current:
            return FileLock(path, descriptor)
        os.close(descriptor)
        if not held:
            return None


def _lock(descriptor: int) -> bool:
    """Lock an open file without waiting; return True on success."""
    if sys.platform == "win32":
        import msvcrt

        try:
            msvcrt.locking(descriptor, msvcrt.LK_NBLCK, 1)
        except PermissionError:
            return False
        return True
    import fcntl

    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True


def _is_at(descriptor: int, path: Path) -> bool:
    try:
        return os.path.samestat(os.fstat(descriptor), path.stat())
    except FileNotFoundError:
        return False


def _delete(path: Path) -> None:
    with suppress(OSError):
        path.unlink()
