"""Memory that the program has freed, given back to the operating system."""

import contextlib
import ctypes
import sys
from collections.abc import Callable


def _find_trim() -> Callable[[int], int] | None:
    if sys.platform.startswith("linux"):
        # Only glibc has it; other libraries give memory back by themselves.
        with contextlib.suppress(OSError, AttributeError):
            trim: Callable[[int], int] = ctypes.CDLL(None).malloc_trim
            return trim
    return None


_trim = _find_trim()


def return_free_memory() -> None:
    """Give free pages within the heap back to the system, which takes some milliseconds.

    glibc gives back the end of the heap alone. A few small blocks that live long keep all below them: after tens of
    thousands of events the process held 100 MB more than it used.
    """
    if _trim is not None:
        _trim(0)
