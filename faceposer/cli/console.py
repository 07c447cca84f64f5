"""The terminal: characters that it cannot show, and output that cannot be written."""

import os
import sys
from contextlib import suppress
from io import TextIOWrapper
from pathlib import Path


def prepare_console() -> None:
    """Escape characters that standard output and standard error cannot show, instead of failing.

    A stream that is closed, as by ``2>&-``, leads nowhere instead: the next file that is opened would otherwise get
    its number, and with it what other libraries print.
    """
    for number in (0, 1, 2):
        try:
            os.fstat(number)
        except OSError:
            # Opened with the lowest number that is free.
            with suppress(OSError):
                os.set_inheritable(os.open(os.devnull, os.O_RDWR), True)
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:
            setattr(sys, name, Path(os.devnull).open("w", encoding="utf-8"))  # noqa: SIM115  # open until the end
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")


def tell(message: object) -> None:
    """Print ``message`` to standard error; if that cannot be written, there is nobody to tell."""
    with suppress(OSError):
        print(message, file=sys.stderr, flush=True)


def flushed(status: int) -> int:
    """Write what standard output still holds; return the exit ``status``, or that of the failure to do so."""
    try:
        if sys.stdout is not None:
            sys.stdout.flush()
    except BrokenPipeError:
        _discard_output()
        return 141
    except OSError as error:
        _discard_output()
        tell(f"The output cannot be written to the terminal or file: {error.strerror}.")
        return status or 2
    return status


def _discard_output() -> None:
    """Let standard output lead nowhere, so that the interpreter does not fail at its end."""
    with suppress(OSError, ValueError):
        null = os.open(os.devnull, os.O_WRONLY)
        os.dup2(null, sys.stdout.fileno())
        os.close(null)
