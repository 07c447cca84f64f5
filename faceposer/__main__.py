"""Entry point of ``faceposer`` and ``python -m faceposer``."""

import os
import signal
from types import FrameType


def _end(_number: int, _frame: FrameType | None) -> None:
    os._exit(130)


def start() -> None:
    """Run the program; Ctrl+C ends it quietly from the first moment."""
    if is_default := signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        # There is nothing to clean up yet, and an interrupted import would print a traceback.
        signal.signal(signal.SIGINT, _end)
    from faceposer.cli import main

    if is_default:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    main()


if __name__ == "__main__":
    start()
