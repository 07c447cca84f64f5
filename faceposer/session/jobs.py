"""Long work beside the frames of the window: progress, cancellation, result and error, in a thread or in steps."""

import threading
import time
from collections.abc import Callable, Generator
from typing import Generic, Protocol, TypeVar

from faceposer.progress import CancelledError, Progress

T = TypeVar("T")
R_co = TypeVar("R_co", covariant=True)

# Seconds between two wakings of the frame loop: progress may come a thousand times a second.
_WAKE_EVERY = 0.07


class Job(Protocol[R_co]):
    """A piece of long work.

    Attributes:
        stage: What it does now.
        share: How much of that is done, 0 to 1; 0 where that is unknown.
    """

    stage: str
    share: float

    @property
    def result(self) -> R_co | None:
        """What came of it, or None as long as there is nothing."""
        ...

    @property
    def error(self) -> Exception | None:
        """What ended it early, or None; no error where it was cancelled."""
        ...

    @property
    def done(self) -> bool:
        """Whether it has ended, in whatever way."""
        ...

    @property
    def cancelled(self) -> bool:
        """Whether the user has cancelled it."""
        ...

    @property
    def seconds(self) -> float:
        """How long it has gone on."""
        ...

    def advance(self, until: float) -> None:
        """Go on until the clock ``time.perf_counter`` says ``until``, unless it goes on by itself."""

    def cancel(self) -> None:
        """Let it end soon, with nothing kept."""

    def join(self) -> None:
        """Wait until it has ended."""


class ThreadJob(Generic[T]):
    """A job in a thread of its own.

    Attributes:
        stage: What it does now.
        share: How much of that is done, 0 to 1.
        result: What came of it, or None.
        error: What ended it early, or None.
    """

    def __init__(self, work: Callable[[Progress], T], wake: Callable[[], None], stage: str = "") -> None:
        """Begin ``work``, which reports to the progress that it is given.

        Args:
            work: Returns the result; what it raises is the job's error.
            wake: Called from the thread when there is news.
            stage: What it does before its first report.
        """
        self.stage, self.share = stage, 0.0
        self.result: T | None = None
        self.error: Exception | None = None
        self._work, self._wake = work, wake
        self._cancelled = threading.Event()
        self._begun = time.monotonic()
        self._woken = 0.0
        self._thread = threading.Thread(target=self._run, name="job")
        self._thread.start()

    @property
    def done(self) -> bool:
        """Whether it has ended, in whatever way."""
        return not self._thread.is_alive()

    @property
    def cancelled(self) -> bool:
        """Whether the user has cancelled it."""
        return self._cancelled.is_set()

    @property
    def seconds(self) -> float:
        """How long it has gone on."""
        return time.monotonic() - self._begun

    def advance(self, until: float) -> None:
        """Do nothing: the thread goes on by itself."""

    def cancel(self) -> None:
        """Let it end at its next report, with nothing kept."""
        self._cancelled.set()

    def join(self) -> None:
        """Wait until it has ended."""
        self._thread.join()

    def _run(self) -> None:
        try:
            self.result = self._work(Progress(self._show, self._cancelled.is_set))
        except CancelledError:
            pass
        except Exception as error:  # reported in the window, not here
            self.error = error
        self._wake()

    def _show(self, stage: str, share: float) -> None:
        self.stage, self.share = stage, share
        now = time.monotonic()
        if now - self._woken > _WAKE_EVERY:
            self._woken = now
            self._wake()


class StepJob(Generic[T]):
    """A job that the frame loop advances, as where frames are drawn by the window's own OpenGL context.

    Attributes:
        stage: What it does.
        share: How much of it is done, 0 to 1.
        result: What came of it, or None.
        error: What ended it early, or None.
    """

    def __init__(self, steps: Generator[float, None, None], result: T, stage: str = "") -> None:
        """Advance ``steps``, which yields the share that is done; ``result`` is what comes of them all."""
        self.stage, self.share = stage, 0.0
        self.result: T | None = None
        self.error: Exception | None = None
        self._steps, self._outcome = steps, result
        self._begun = time.monotonic()
        self._done = self._cancelled = False

    @property
    def done(self) -> bool:
        """Whether it has ended, in whatever way."""
        return self._done

    @property
    def cancelled(self) -> bool:
        """Whether the user has cancelled it."""
        return self._cancelled

    @property
    def seconds(self) -> float:
        """How long it has gone on."""
        return time.monotonic() - self._begun

    def advance(self, until: float) -> None:
        """Do at least one step, and more until the clock ``time.perf_counter`` says ``until``."""
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
        """End it; closing the generator lets it clear away what it has begun."""
        if not self._done:
            self._cancelled = self._done = True
            self._steps.close()

    def join(self) -> None:
        """Cancel it: nobody advances it any more."""
        self.cancel()
