"""Long-running work in a thread or in steps of the frame loop, with progress, cancellation, result and error."""

import threading
import time
from collections.abc import Callable, Generator
from typing import Generic, Protocol, TypeVar

from faceposer.errors import FacePoserError
from faceposer.progress import CancelledError, Progress

T = TypeVar("T")
R_co = TypeVar("R_co", covariant=True)

# Seconds between two wake-ups of the frame loop: progress may be reported a thousand times a second.
_WAKE_EVERY = 0.07


class Job(Protocol[R_co]):
    """A long-running task.

    Attributes:
        stage: Description of the current stage.
        share: Progress of the stage, 0 to 1; 0 if unknown.
    """

    stage: str
    share: float

    @property
    def result(self) -> R_co | None:
        """The result, or None before the end."""
        ...

    @property
    def error(self) -> Exception | None:
        """The exception that ended the job, or None; a cancelled job has no error."""
        ...

    @property
    def done(self) -> bool:
        """True if the job has ended for any reason."""
        ...

    @property
    def cancelled(self) -> bool:
        """True if the user has cancelled the job."""
        ...

    @property
    def seconds(self) -> float:
        """Elapsed time."""
        ...

    def advance(self, until: float) -> None:
        """Advance until ``time.perf_counter`` reaches ``until``; threads ignore the call."""

    def cancel(self) -> None:
        """Cancel the job, which ends soon without a result."""

    def join(self) -> None:
        """Wait until the job has ended."""


class ThreadJob(Generic[T]):
    """A job in its own thread.

    Attributes:
        stage: Description of the current stage.
        share: Progress of the stage, 0 to 1.
        result: The result, or None.
        error: The exception that ended the job, or None.
    """

    def __init__(self, work: Callable[[Progress], T], wake: Callable[[], None], stage: str = "") -> None:
        """Start ``work``.

        Args:
            work: Function that returns the result and reports its progress; an exception becomes the job's error.
            wake: Called from the thread when progress, result or error have changed.
            stage: Description before the first report.
        """
        self.stage, self.share = stage, 0.0
        self.result: T | None = None
        self.error: Exception | None = None
        self._work, self._wake = work, wake
        self._cancelled = threading.Event()
        self._started = time.monotonic()
        self._woken = 0.0
        self._thread = threading.Thread(target=self._run, name="job")
        self._thread.start()

    @property
    def done(self) -> bool:
        """True if the job has ended for any reason."""
        return not self._thread.is_alive()

    @property
    def cancelled(self) -> bool:
        """True if the user has cancelled the job."""
        return self._cancelled.is_set()

    @property
    def seconds(self) -> float:
        """Elapsed time."""
        return time.monotonic() - self._started

    def advance(self, until: float) -> None:
        """Do nothing: the thread runs by itself."""

    def cancel(self) -> None:
        """Cancel the job, which ends at its next report without a result."""
        self._cancelled.set()

    def join(self) -> None:
        """Wait until the job has ended."""
        self._thread.join()

    def _run(self) -> None:
        try:
            self.result = self._work(Progress(self._report, self._cancelled.is_set))
        except CancelledError:
            pass
        except Exception as error:  # reported in the window, not here
            self.error = error
        self._wake()

    def _report(self, stage: str, share: float) -> None:
        self.stage, self.share = stage, share
        now = time.monotonic()
        if now - self._woken > _WAKE_EVERY:
            self._woken = now
            self._wake()


class StepJob(Generic[T]):
    """A job advanced by the frame loop, such as rendering in the OpenGL context of the window.

    Attributes:
        stage: Description of the work.
        share: Progress, 0 to 1.
        result: The result, or None.
        error: The exception that ended the job, or None.
    """

    def __init__(self, steps: Generator[float, None, None], result: T, stage: str = "") -> None:
        """Advance the generator ``steps``, which yields its progress; ``result`` is the result after the last step."""
        self.stage, self.share = stage, 0.0
        self.result: T | None = None
        self.error: Exception | None = None
        self._steps, self._outcome = steps, result
        self._started = time.monotonic()
        self._done = self._cancelled = False

    @property
    def done(self) -> bool:
        """True if the job has ended for any reason."""
        return self._done

    @property
    def cancelled(self) -> bool:
        """True if the user has cancelled the job."""
        return self._cancelled

    @property
    def seconds(self) -> float:
        """Elapsed time."""
        return time.monotonic() - self._started

    def advance(self, until: float) -> None:
        """Run at least one step, and more until ``time.perf_counter`` reaches ``until``."""
        while not self._done:
            try:
                self.share = next(self._steps)
            except StopIteration:
                self.result, self._done = self._outcome, True
            except Exception as error:  # reported in the window, not here
                self.error, self._done = error, True
            if time.perf_counter() >= until:
                return

    def cancel(self) -> None:
        """Cancel the job; closing the generator lets it clean up."""
        if not self._done:
            self._cancelled = self._done = True
            self._steps.close()

    def join(self) -> None:
        """Cancel the job, since nothing advances it any more."""
        self.cancel()


def outcome(job: Job[T], too_large: str) -> tuple[T | None, str]:
    """Return the result of a ``job`` that has ended, or None if it was cancelled or failed, and why, or "".

    Args:
        job: The job.
        too_large: Sentence on what to do if there was not enough memory.

    Raises:
        Exception: The error of the job, unless the user can resolve it.
    """
    if isinstance(job.error, FacePoserError):
        return None, str(job.error)
    if isinstance(job.error, MemoryError):
        return None, f"There is not enough memory; {too_large}"
    if job.error is not None:
        raise job.error
    return job.result, ""
