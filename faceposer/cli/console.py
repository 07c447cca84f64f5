"""The terminal: characters that it cannot show, and output that cannot be written."""

import os
import sys
from contextlib import suppress
from io import TextIOWrapper


def prepare_console() -> None:
    """Escape characters that standard output and standard error cannot show, instead of failing."""
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
