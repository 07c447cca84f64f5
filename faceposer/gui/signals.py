"""What happens when the system, not the user, wants the program to end: the loop is left, and unsaved work is kept."""

import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any

# Not every system has all of them.
_NAMES = ("SIGINT", "SIGTERM", "SIGHUP", "SIGBREAK")


@contextmanager
def interrupted_by_signals(interrupt: Callable[[int], None]) -> Iterator[None]:
    """Let signals to end call ``interrupt`` with their number; a second one does what it does by itself.

    An exception instead could arise anywhere, also inside a callback of the window system, where it would be lost.
    """
    before: dict[int, Any] = {}

    def note(number: int, _frame: FrameType | None) -> None:
        interrupt(number)
        signal.signal(number, before[number])

    for number in (getattr(signal, name) for name in _NAMES if hasattr(signal, name)):
        handler = signal.getsignal(number)
        # Who ignores a signal, as nohup does, or handles it outside Python means it.
        if handler not in (signal.SIG_IGN, None):
            before[number] = handler
            signal.signal(number, note)
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
