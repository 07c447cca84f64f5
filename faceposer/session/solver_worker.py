"""Background solver: the newest input replaces older ones."""

import threading
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from faceposer.model.face_model import FaceModel
from faceposer.session.document import Document
from faceposer.session.sketching import pose_problem
from faceposer.solve.map_solver import Solution, numeric_errors, prepare, solve


@dataclass(frozen=True, eq=False)
class SolveRequest:
    """A document to solve.

    Attributes:
        epoch: Incremented when earlier jobs become obsolete (undo, load); results of older epochs are discarded.
        revision: Revision of the session at submission.
        model: The face model.
        document: Document with the constraints and the prior.
        x0: Initial coefficients, shape (r,); None to search from several starts.
    """

    epoch: int
    revision: int
    model: FaceModel
    document: Document
    x0: NDArray[np.float64] | None


@dataclass(frozen=True, eq=False)
class SolveResult:
    """The result of a job: a solution, or the exception that ended it."""

    job: SolveRequest
    solution: Solution | None
    error: Exception | None = None


class Worker(Protocol):
    """A solver that accepts jobs and returns results."""

    def submit(self, job: SolveRequest) -> None:
        """Solve ``job`` next, replacing a queued one."""
        ...

    def prepare(self) -> None:
        """Prepare for the first job, in the background if possible."""
        ...

    def poll(self) -> SolveResult | None:
        """Return the newest result not yet taken, or None."""
        ...

    @property
    def busy(self) -> bool:
        """True if a job is queued or running."""
        ...

    def wait_idle(self, timeout: float) -> bool:
        """Wait until no job is queued or running, at most ``timeout`` seconds; return False on timeout."""
        ...

    def close(self) -> None:
        """Cancel the running job and stop."""
        ...


def run_job(job: SolveRequest, should_stop: Callable[[], bool] | None = None) -> SolveResult:
    """Solve ``job``; an exception becomes part of the result."""
    try:
        with numeric_errors():
            return SolveResult(job, solve(pose_problem(job.model, job.document), job.x0, should_stop=should_stop))
    except Exception as error:  # raised again in the thread that polls
        return SolveResult(job, None, error)


class InlineWorker:
    """A worker that solves synchronously, for tests and the command line."""

    def __init__(self) -> None:
        self._result: SolveResult | None = None

    def submit(self, job: SolveRequest) -> None:
        """Solve ``job``."""
        self._result = run_job(job)

    def prepare(self) -> None:
        """Do nothing: the first job prepares the solver."""

    def poll(self) -> SolveResult | None:
        """Return the newest result not yet taken, or None."""
        result, self._result = self._result, None
        return result

    @property
    def busy(self) -> bool:
        """Always False."""
        return False

    def wait_idle(self, timeout: float) -> bool:
        """Return True."""
        return True

    def close(self) -> None:
        """Do nothing."""


class SolverWorker:
    """A worker with its own thread.

    At most one job is queued; a newer one replaces it. The running solve finishes its few milliseconds, because a drag
    that stopped each solve for the next would display none; only a job of a newer epoch stops it early.
    """

    def __init__(self, on_result: Callable[[], None] | None = None) -> None:
        """Start the thread, which calls ``on_result`` after each result, for instance to wake the frame loop."""
        self._condition = threading.Condition()
        self._waiting: SolveRequest | None = None
        self._running: SolveRequest | None = None
        self._result: SolveResult | None = None
        self._closed = False
        self._on_result = on_result
        self._thread = threading.Thread(target=self._work, name="solver", daemon=True)
        self._thread.start()

    def submit(self, job: SolveRequest) -> None:
        """Solve ``job`` next, replacing a queued one."""
        with self._condition:
            self._waiting = job
            self._condition.notify_all()

    def prepare(self) -> None:
        """Prepare for the first job in another thread, so that jobs are accepted meanwhile."""
        # Not a daemon: one that is in native code when the program ends would abort it.
        threading.Thread(target=prepare, name="prepare").start()

    def poll(self) -> SolveResult | None:
        """Return the newest result not yet taken, or None."""
        with self._condition:
            result, self._result = self._result, None
            return result

    @property
    def busy(self) -> bool:
        """True if a job is queued or running."""
        with self._condition:
            return self._waiting is not None or self._running is not None

    def wait_idle(self, timeout: float) -> bool:
        """Wait until no job is queued or running, at most ``timeout`` seconds; return False on timeout."""
        with self._condition:
            return self._condition.wait_for(lambda: self._waiting is None and self._running is None, timeout)

    def close(self) -> None:
        """Cancel the running job and stop the thread."""
        with self._condition:
            self._closed, self._waiting = True, None
            self._condition.notify_all()
        self._thread.join()

    def _outdated(self, job: SolveRequest) -> bool:
        waiting = self._waiting
        return self._closed or (waiting is not None and waiting.epoch != job.epoch)

    def _work(self) -> None:
        while True:
            with self._condition:
                self._condition.wait_for(lambda: self._waiting is not None or self._closed)
                if self._closed:
                    return
                job, self._waiting = self._waiting, None
                assert job is not None
                self._running = job
            result = run_job(job, partial(self._outdated, job))
            with self._condition:
                self._running = None
                if not self._outdated(job):
                    self._result = result
                self._condition.notify_all()
            if self._on_result is not None:
                self._on_result()
