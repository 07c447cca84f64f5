"""Worker processes with an initialiser, which end when the main process is stopped."""

import multiprocessing
import signal
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from typing import Any

from faceposer.errors import FacePoserError


@contextmanager
def processes(number: int, prepare: Callable[..., None], *arguments: Any) -> Iterator[ProcessPoolExecutor]:
    """Yield a pool of ``number`` processes, each initialised by ``prepare(*arguments)``.

    Raises:
        FacePoserError: If a process was killed.
    """
    # A forked process would inherit locks and threads, and only Linux forks by default.
    context = multiprocessing.get_context("spawn")
    executor = ProcessPoolExecutor(number, context, initializer=_initialise, initargs=(prepare, *arguments))
    try:
        yield executor
    except BrokenProcessPool as error:
        raise FacePoserError(
            "A process of the study was killed, perhaps because memory ran out; repeat the command with --jobs 1."
        ) from error
    except BaseException:
        for process in multiprocessing.active_children():
            process.terminate()
        raise
    finally:
        executor.shutdown(wait=True, cancel_futures=True)


def _initialise(prepare: Callable[..., None], *arguments: Any) -> None:
    # Ctrl-C in the terminal interrupts all processes; the main process terminates the others.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    prepare(*arguments)
