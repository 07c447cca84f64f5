"""Opening of files for reading: regular files only, of limited size.

A pipe or a device may never end, and a socket cannot be read: every reader of the program opens its files here. All
errors are of type ``OSError`` with a ``strerror`` for messages, also for paths that no file can have.
"""

import errno
import io
import os
import stat
from pathlib import Path
from typing import BinaryIO, TextIO

#: Maximum size of a file that is read as a whole, unless a reader has a lower limit.
MAX_BYTES = 1 << 30

_KINDS = (
    (stat.S_ISDIR, errno.EISDIR, "it is a folder"),
    (stat.S_ISFIFO, errno.EINVAL, "it is a pipe, not a file"),
    (stat.S_ISSOCK, errno.EINVAL, "it is a socket, not a file"),
    (stat.S_ISCHR, errno.EINVAL, "it is a device, not a file"),
    (stat.S_ISBLK, errno.EINVAL, "it is a device, not a file"),
)


class RefusedError(OSError):
    """The path is not that of a regular file of allowed size, which will not change by itself."""


def open_file(path: Path | str, max_bytes: int | None = None) -> BinaryIO:
    """Open the regular file ``path``, or a link to one, for reading of bytes.

    Args:
        path: Path of the file.
        max_bytes: Maximum size; None for any.

    Raises:
        OSError: If it is not a regular file, is larger, or cannot be opened.
    """
    try:
        _check(os.stat(path), max_bytes)  # noqa: PTH116  # raises the same errors for text and for paths
        # Another program may replace the file after the check; a pipe opened without waiting is then refused below.
        descriptor = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0))
    except ValueError as error:  # a zero byte, or a lone surrogate
        raise RefusedError(errno.EINVAL, "it is not a valid file name") from error
    try:
        _check(os.fstat(descriptor), max_bytes)
        # Unlike ``os.fdopen``, this gives the file its name.
        return open(path, "rb", opener=lambda *_: descriptor)
    except BaseException:
        os.close(descriptor)
        raise


def open_text(
    path: Path | str,
    encoding: str = "utf-8",
    errors: str = "strict",
    newline: str | None = None,
    max_bytes: int | None = None,
) -> TextIO:
    """Open the regular file ``path`` for reading of text; other arguments as in ``open`` and ``open_file``.

    Raises:
        OSError: If it is not a regular file, is larger than ``max_bytes``, or cannot be opened.
    """
    return io.TextIOWrapper(open_file(path, max_bytes), encoding, errors, newline)


def read_bytes(path: Path | str, max_bytes: int = MAX_BYTES) -> bytes:
    """Return the content of the regular file ``path``.

    Raises:
        OSError: If it is not a regular file, is larger than ``max_bytes``, or cannot be read.
    """
    with open_file(path, max_bytes) as file:
        # Some systems have files that do not tell their size.
        content = file.read(max_bytes + 1)
    if len(content) > max_bytes:
        raise _too_large(max_bytes)
    return content


def _check(status: os.stat_result, max_bytes: int | None) -> None:
    for is_kind, number, reason in _KINDS:
        if is_kind(status.st_mode):
            raise RefusedError(number, reason)
    if not stat.S_ISREG(status.st_mode):
        raise RefusedError(errno.EINVAL, "it is not a regular file")
    if max_bytes is not None and status.st_size > max_bytes:
        raise _too_large(max_bytes)


def _too_large(max_bytes: int) -> RefusedError:
    size = f"{max_bytes >> 30} GB" if max_bytes >= 1 << 30 else f"{max_bytes / 2**20:.3g} MB"
    return RefusedError(errno.EFBIG, f"it is larger than {size}")
