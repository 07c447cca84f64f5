"""Processes beside this one that each keep something prepared, and end when this one is stopped."""

import multiprocessing
import signal
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from typing import Any

from faceposer.errors import FacePoserError


@contextmanager
def processes(number: int, prepare: Callable[..., None], *given: Any) -> Iterator[ProcessPoolExecutor]:
    """Give ``number`` processes, in each of which ``prepare(*given)`` has run.

    Raises:
        FacePoserError: If one of them was ended from outside.
    """
    # A forked process would have this one's locks and threads, and no other system than Linux forks.
    context = multiprocessing.get_context("spawn")
    executor = ProcessPoolExecutor(number, context, initializer=_begin, initargs=(prepare, *given))
    try:
        yield executor
    except BrokenProcessPool as error:
        raise FacePoserError(
            "A process of the study was ended from outside, perhaps for want of memory; give the same command again "
            "with --jobs 1."
        ) from error
    except BaseException:
        for process in multiprocessing.active_children():
            process.terminate()
        raise
    finally:
        executor.shutdown(wait=True, cancel_futures=True)


def _begin(prepare: Callable[..., None], *given: Any) -> None:
    # The terminal's Ctrl-C goes to all processes; the one that began the others ends them.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    prepare(*given)
