"""Commands in forked children, under a system that refuses what they need; a child starts in milliseconds."""

import ctypes
import io
import os
import resource
import signal
import sys
import threading
import time
import traceback
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

# Linux capabilities by which root reads and writes what the permissions forbid.
_OVERRIDES = (1 << 1) | (1 << 2)
_CAPABILITIES_3 = 0x20080522


@dataclass(frozen=True)
class Condition:
    """What the system refuses to a child.

    Attributes:
        encoding: Encoding of its standard output and error.
        environment: Changed variables; None removes one.
        largest_file: Maximum size in bytes of a file that it writes, or None.
        folder: Working directory, or None for that of the parent.
        output: File for its standard output, such as "/dev/full", or "" to capture it.
        prepare: Called in the child at the end of its preparation.
    """

    encoding: str = "utf-8"
    environment: dict[str, str | None] = field(default_factory=dict)
    largest_file: int | None = None
    folder: Path | None = None
    output: str = ""
    prepare: Callable[[], None] | None = None


@dataclass(frozen=True)
class Ended:
    """How a child ended.

    Attributes:
        status: Exit status, negative for the signal that killed it.
        out: Its standard output.
        err: Its standard error.
        seconds: Its duration.
    """

    status: int
    out: str
    err: str
    seconds: float


def start(work: Callable[[], None], condition: Condition | None = None, ends: tuple[int, int] | None = None) -> int:
    """Start ``work`` in a child and return its process id.

    Args:
        work: Called in the child.
        condition: What the system refuses to it.
        ends: Descriptors for its standard output and error; None to discard both.
    """
    sys.stdout.flush()
    sys.stderr.flush()
    child = os.fork()
    if child:
        return child
    status = 70
    try:
        _prepare(condition or Condition(), ends)
        work()
        status = 0
    except SystemExit as end:
        status = int(end.code or 0)
    except BaseException:
        traceback.print_exc()
    finally:
        try:
            sys.stdout.flush()
            sys.stderr.flush()
        finally:
            os._exit(status)


def run(work: Callable[[], None], condition: Condition | None = None, patience: float = 120.0) -> Ended:
    """Run ``work`` in a child and return how it ended; it is killed after ``patience`` seconds."""
    begun = time.monotonic()
    pipes = os.pipe(), os.pipe()
    child = start(work, condition, (pipes[0][1], pipes[1][1]))
    texts: list[bytes] = [b"", b""]

    def read(i: int) -> None:
        os.close(pipes[i][1])
        with os.fdopen(pipes[i][0], "rb") as stream:
            texts[i] = stream.read()

    readers = [threading.Thread(target=read, args=(i,)) for i in range(2)]
    for reader in readers:
        reader.start()
    status = wait(child, patience)
    for reader in readers:
        reader.join()
    out, err = (text.decode("utf-8", "backslashreplace") for text in texts)
    return Ended(status, out, err, time.monotonic() - begun)


def wait(child: int, patience: float) -> int:
    """Wait for ``child``, killed after ``patience`` seconds; return its status, negative for a signal."""
    end = time.monotonic() + patience
    while True:
        done, status = os.waitpid(child, os.WNOHANG)
        if done:
            return os.waitstatus_to_exitcode(status)
        if time.monotonic() > end:
            os.kill(child, signal.SIGKILL)
            end = float("inf")
        time.sleep(0.005)


def _prepare(condition: Condition, ends: tuple[int, int] | None) -> None:
    null = os.open(os.devnull, os.O_WRONLY)
    out, err = (null, null) if ends is None else ends
    os.dup2(os.open(condition.output, os.O_WRONLY) if condition.output else out, 1)
    os.dup2(err, 2)
    # Like the interpreter at its start.
    sys.stdout = io.TextIOWrapper(io.FileIO(1, "w", closefd=False), condition.encoding, "strict", write_through=True)
    sys.stderr = io.TextIOWrapper(
        io.FileIO(2, "w", closefd=False), condition.encoding, "backslashreplace", write_through=True
    )
    for name, value in condition.environment.items():
        if value is None:
            os.environ.pop(name, None)
        else:
            os.environ[name] = value
    if condition.folder is not None:
        os.chdir(condition.folder)
    if condition.prepare is not None:
        condition.prepare()
    _obey_permissions()
    if condition.largest_file is not None:
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (condition.largest_file, condition.largest_file))


def _obey_permissions() -> None:
    """Give up root's right to read and write what the permissions forbid."""
    if os.geteuid() != 0:
        return
    libc = ctypes.CDLL(None, use_errno=True)
    header = (ctypes.c_uint32 * 2)(_CAPABILITIES_3, 0)
    sets = (ctypes.c_uint32 * 6)()
    if libc.capget(header, sets) != 0:
        raise OSError(ctypes.get_errno(), "capget")
    for i in (0, 1, 2):
        sets[i] &= ~_OVERRIDES
    if libc.capset(header, sets) != 0:
        raise OSError(ctypes.get_errno(), "capset")
