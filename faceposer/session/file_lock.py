"""Locks that a running program holds on files: the system releases them when it ends, however it ends."""

import os
import sys
from contextlib import suppress
from pathlib import Path


class FileLock:
    """A file that this program holds; nobody else can hold it at the same time."""

    def __init__(self, path: Path, descriptor: int) -> None:
        """Hold ``path``, open and locked as ``descriptor``; ``take_lock`` makes these."""
        self.path = path
        self._descriptor: int | None = descriptor

    def release(self, remove: bool = False) -> None:
        """Let others have the lock, or with ``remove`` delete its file; nothing happens the second time."""
        if self._descriptor is None:
            return
        descriptor, self._descriptor = self._descriptor, None
        # Deleted while it is held, so that nobody gets a lock on a file that is about to go; Windows cannot do that.
        if remove and sys.platform != "win32":
            _delete(self.path)
        os.close(descriptor)
        if remove and sys.platform == "win32":
            _delete(self.path)


def take_lock(path: Path) -> FileLock | None:
    """Return a lock on the file ``path``, which is made if it does not exist, or None if another program holds it.

    Raises:
        OSError: If the file cannot be made, or files in this place cannot be locked.
    """
    while True:
        descriptor = os.open(path, os.O_RDWR | os.O_CREAT, 0o600)
        try:
            held = _lock(descriptor)
            # Between opening and locking its last holder may have deleted it: then it is another file's turn.
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
    """Lock an open file and return whether that was possible at once."""
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
