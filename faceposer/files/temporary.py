"""Temporary files and folders, and the removal of those left by programs that were killed."""

import os
import platform
import re
import secrets
import shutil
import sys
import tempfile
import time
import zlib
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

# ".NAME.PROCESS.HOST.faceposer.tmp": the host, since folders may be shared between machines.
_TEMPORARY = re.compile(r"\..*\.(\d+)\.([0-9a-f]{8})\.faceposer\.tmp", re.DOTALL)
# Maximum length of a file name on common systems, in bytes; temporary files have longer names than their files.
_LONGEST_NAME = 255
# Age in seconds from which files of another host are taken for left behind.
_OLD = 7 * 86400.0


def temporary_path(path: Path) -> Path:
    """Return the path of this process's temporary file or folder for ``path``, in the same folder."""
    tail = f".{os.getpid()}.{_host()}.faceposer.tmp"
    room = _LONGEST_NAME - len(tail) - 1
    short, name = path.name, path.name.encode("utf-8", "surrogateescape")
    if len(name) > room:
        # Cut for its temporary file, which differs from those of other long names. A name too long for the system
        # fails at the replacement.
        short = f"{name[: room - 9].decode('utf-8', 'ignore')}-{zlib.crc32(name):08x}"
    return path.with_name(f".{short}{tail}")


def is_temporary(name: str) -> bool:
    """Return True if ``name`` is that of a temporary file or folder of this program."""
    return _TEMPORARY.fullmatch(name) is not None


def remove_left(folder: Path) -> None:
    """Remove the temporary files and folders in ``folder`` whose programs have ended; failures are ignored."""
    if is_temporary(folder.name):
        # Inside a temporary folder, a sequence of thousands of files would scan the folder for each of them.
        return
    with suppress(OSError), os.scandir(folder) as entries:
        for entry in entries:
            match = _TEMPORARY.fullmatch(entry.name)
            if match is None or not _is_left(entry, int(match[1]), match[2]):
                continue
            with suppress(OSError):
                if entry.is_dir(follow_symlinks=False):
                    shutil.rmtree(entry.path, ignore_errors=True)
                else:
                    Path(entry.path).unlink()


def scratch_parent() -> Path:
    """Return the system's folder for temporary files, or the working directory if there is none."""
    try:
        return Path(tempfile.gettempdir())
    except OSError:
        return Path()


@contextmanager
def scratch_folder() -> Iterator[Path]:
    """Yield a new folder in the system's folder for temporary files, deleted at the end of the block.

    Folders left by programs that were killed are deleted as well.

    Raises:
        OSError: If it cannot be created.
    """
    parent = scratch_parent()
    remove_left(parent)
    folder = temporary_path(parent / f"scratch-{secrets.token_hex(6)}")
    folder.mkdir(mode=0o700)
    try:
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def _host() -> str:
    return f"{zlib.crc32(platform.node().encode('utf-8', 'surrogateescape')):08x}"


def _is_left(entry: "os.DirEntry[str]", process: int, host: str) -> bool:
    """Return True if the temporary file ``entry`` of ``process`` on ``host`` is in use no more."""
    if host == _host():
        return not _is_running(process)
    try:
        return time.time() - entry.stat(follow_symlinks=False).st_mtime > _OLD
    except OSError:
        return False


def _is_running(pid: int) -> bool:
    """Return True if a process ``pid`` may exist; always on Windows, where the check could end the process."""
    if sys.platform == "win32" or not 0 < pid < 2**31:
        return True
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except OSError:
        return True
    return True
