"""Peak memory of a process and its descendants."""

import os
import threading
from pathlib import Path
from types import TracebackType
from typing import Self

_PAGE = os.sysconf("SC_PAGE_SIZE")
_EVERY_S = 0.05


class PeakMemory:
    """Sample the resident memory of a process and its descendants while the block runs (Linux).

    Shared pages, such as libraries, count for each process, so the result is an upper bound.

    Attributes:
        bytes: Peak of all processes together.
        largest: Peak of a single process.
    """

    def __init__(self, pid: int | None = None) -> None:
        self.bytes = self.largest = 0
        self._pid = pid or os.getpid()
        self._done = threading.Event()
        self._thread = threading.Thread(target=self._watch, daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._done.set()
        self._thread.join()

    def _watch(self) -> None:
        while not self._done.is_set():
            sizes = [_resident(pid) for pid in _family(self._pid)]
            self.bytes = max(self.bytes, sum(sizes))
            self.largest = max(self.largest, *sizes, 0)
            self._done.wait(_EVERY_S)


def _family(pid: int) -> list[int]:
    found, waiting = [], [pid]
    while waiting:
        one = waiting.pop()
        found.append(one)
        for task in Path(f"/proc/{one}/task").glob("*/children"):
            try:
                waiting.extend(int(word) for word in task.read_text().split())
            except OSError:
                continue
    return found


def _resident(pid: int) -> int:
    try:
        return int(Path(f"/proc/{pid}/statm").read_text().split()[1]) * _PAGE
    except (OSError, IndexError):
        return 0
