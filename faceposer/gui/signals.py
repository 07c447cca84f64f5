"""Signals of the operating system that end the program; unsaved work is kept."""

import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any

# Not every system has all of these.
_NAMES = ("SIGINT", "SIGTERM", "SIGHUP", "SIGBREAK")


@contextmanager
def interrupted_by_signals(interrupt: Callable[[int], None]) -> Iterator[None]:
    """Call ``interrupt`` with the number of a signal that ends the program; a second signal has its default effect.

    An exception is not raised: it could arise within a callback of the window system and be lost.
    """
    before: dict[int, Any] = {}

    def handle(number: int, _frame: FrameType | None) -> None:
        interrupt(number)
        signal.signal(number, before[number])

    for number in (getattr(signal, name) for name in _NAMES if hasattr(signal, name)):
        handler = signal.getsignal(number)
        # An ignored signal, as under nohup, or one handled outside Python is left as it is.
        if handler not in (signal.SIG_IGN, None):
            before[number] = handler
            signal.signal(number, handle)
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
