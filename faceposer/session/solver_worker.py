"""Solves beside the frame: the newest input wins, older ones are given up."""

import threading
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from faceposer.model.face_model import FaceModel
from faceposer.session.document import Document
from faceposer.solve.map_solver import Solution, prepare, solve
from faceposer.solve.problem import PoseProblem


@dataclass(frozen=True, eq=False)
class Job:
    """A document to solve.

    Attributes:
        epoch: Rises when what went before no longer matters (undo, load); results of older epochs are dropped.
        revision: The session's revision that asked.
        model: The face.
        document: Its constraints and prior weight.
        x0: Coefficients to start from, shape (r,); None for the best of all starts.
    """

    epoch: int
    revision: int
    model: FaceModel
    document: Document
    x0: NDArray[np.float64] | None


@dataclass(frozen=True, eq=False)
class JobResult:
    """What came of a job: a solution, or the exception that ended it."""

    job: Job
    solution: Solution | None
    error: Exception | None = None


class Worker(Protocol):
    """Takes jobs and hands back results."""

    def submit(self, job: Job) -> None:
        """Solve ``job`` next, in place of any that waits."""
        ...

    def prepare(self) -> None:
        """Get ready for the first job, beside the caller if possible."""
        ...

    def poll(self) -> JobResult | None:
        """Return the newest result that was not yet taken, or None."""
        ...

    @property
    def busy(self) -> bool:
        """Whether a job waits or is being solved."""
        ...

    def wait_idle(self, timeout: float) -> bool:
        """Wait until no job waits or runs, at most ``timeout`` seconds; return whether that came to be."""
        ...

    def close(self) -> None:
        """Give up what runs and end."""
        ...


def run_job(job: Job, should_stop: Callable[[], bool] | None = None) -> JobResult:
    """Solve ``job`` and return its result; an exception becomes part of it."""
    try:
        document = job.document
        problem = PoseProblem(
            job.model,
            document.constraints,
            document.start,
            document.prior_weight,
            prior=document.prior,
            spread=document.spread,
        )
        return JobResult(job, solve(problem, job.x0, should_stop=should_stop))
    except Exception as error:  # the frame that polls must learn of it, whatever it is
        return JobResult(job, None, error)


class InlineWorker:
    """Solves at once, in the caller's thread: for tests and the command line."""

    def __init__(self) -> None:
        self._result: JobResult | None = None

    def submit(self, job: Job) -> None:
        """Solve ``job``."""
        self._result = run_job(job)

    def prepare(self) -> None:
        """Do nothing: the first job waits for what it needs."""

    def poll(self) -> JobResult | None:
        """Return the newest result that was not yet taken, or None."""
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
    """Solves in a thread of its own.

    One job waits at most: a newer one takes its place. The running solve is let finish its few milliseconds, since a
    drag that stopped each solve for the next would show none; only a job of a newer epoch ends it early.
    """

    def __init__(self, on_result: Callable[[], None] | None = None) -> None:
        """Start the thread; ``on_result`` is called in it after each result, to wake a sleeping frame loop."""
        self._condition = threading.Condition()
        self._waiting: Job | None = None
        self._running: Job | None = None
        self._result: JobResult | None = None
        self._closed = False
        self._on_result = on_result
        self._thread = threading.Thread(target=self._work, name="solver", daemon=True)
        self._thread.start()

    def submit(self, job: Job) -> None:
        """Solve ``job`` next, in place of any that waits."""
        with self._condition:
            self._waiting = job
            self._condition.notify_all()

    def prepare(self) -> None:
        """Get ready for the first job in a thread of its own, so that jobs are taken meanwhile."""
        threading.Thread(target=prepare, name="prepare", daemon=True).start()

    def poll(self) -> JobResult | None:
        """Return the newest result that was not yet taken, or None."""
        with self._condition:
            result, self._result = self._result, None
            return result

    @property
    def busy(self) -> bool:
        """Whether a job waits or is being solved."""
        with self._condition:
            return self._waiting is not None or self._running is not None

    def wait_idle(self, timeout: float) -> bool:
        """Wait until no job waits or runs, at most ``timeout`` seconds; return whether that came to be."""
        with self._condition:
            return self._condition.wait_for(lambda: self._waiting is None and self._running is None, timeout)

    def close(self) -> None:
        """Give up what runs and end the thread."""
        with self._condition:
            self._closed, self._waiting = True, None
            self._condition.notify_all()
        self._thread.join()

    def _outdated(self, job: Job) -> bool:
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
