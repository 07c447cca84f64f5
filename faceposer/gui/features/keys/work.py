"""Work on key poses in the background, one at a time, with its progress in a dialog."""

from collections.abc import Callable
from typing import Any

from faceposer.gui.context import EditorContext
from faceposer.gui.widgets.modal import draw_job, modal
from faceposer.progress import Progress
from faceposer.session.jobs import ThreadJob, outcome

_WIDTH = 28.0
#: Report of a lack of memory.
TOO_LARGE = "use fewer key poses, or smaller meshes."


class KeyWork:
    """The work in progress.

    Attributes:
        job: The job, or None.
    """

    def __init__(self, context: EditorContext, read: Callable[[], None]) -> None:
        """Work in the window of ``context``, and ``read`` the keys after each job."""
        self._context, self._read = context, read
        self.job: ThreadJob[Any] | None = None
        self._title = self._failure = ""
        self._done: Callable[[Any], None] = lambda _: None
        self._ended: Callable[[], object] = lambda: None

    @property
    def busy(self) -> bool:
        """True while a job runs."""
        return self.job is not None

    def run(
        self,
        title: str,
        failure: str,
        work: Callable[[Progress], Any],
        done: Callable[[Any], None],
        ended: Callable[[], object] = lambda: None,
    ) -> None:
        """Do ``work`` in the background, then call ``done`` with its result; do nothing while other work runs.

        Args:
            title: Title of the dialog.
            failure: Title of the report of its error.
            work: Function that returns the result.
            done: Called with the result.
            ended: Called at the end, also after an error, or if the user cancelled.
        """
        if self.job is None:
            self._title, self._failure, self._done, self._ended = title, failure, done, ended
            self.job = ThreadJob(work, self._context.wake, "Preparing")
            self._context.redraw()

    def update(self) -> None:
        """Take the result of the job.

        Raises:
            Exception: Its error, unless the user can resolve it; then a dialog reports it.
        """
        job = self.job
        if job is None:
            return
        self._context.redraw(1)
        if not job.done:
            return
        self.job = None
        self._context.redraw()
        # A job that failed or was cancelled may have written some of its files.
        self._read()
        result, error = outcome(job, TOO_LARGE)
        if error:
            self._context.dialogs.report(self._failure, error)
        elif not job.cancelled:
            self._done(result)
        self._ended()

    def draw(self) -> None:
        """Draw the progress, unless another dialog is open above it."""
        context = self._context
        if self.job is None or context.dialogs.open:
            return
        with modal("##keys-job", _WIDTH) as shown:
            if shown:
                draw_job(context.fonts, context.widget_rects, "keys-job", self._title, self.job, self.job.stage)

    def cancel(self) -> None:
        """Cancel the job."""
        if self.job is not None:
            self.job.cancel()

    def join(self) -> None:
        """Wait until the job has ended."""
        if self.job is not None:
            self.job.join()
