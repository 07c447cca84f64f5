"""The folder of key poses that is open: read in the background, and again when its files change."""

from pathlib import Path

from faceposer.files import paths
from faceposer.gui.context import EditorContext
from faceposer.gui.features.keys.work import TOO_LARGE
from faceposer.progress import Progress
from faceposer.session.jobs import ThreadJob, outcome
from faceposer.session.key_set import KeySet, Stamp, read_key_set, stamp_of

# Seconds between two looks at the files.
_LOOK_EVERY = 1.0


class OpenKeys:
    """The open folder of keys.

    Attributes:
        folder: The folder, or None.
        keys: Its keys as they were read last, or None.
        error: Why they cannot be read, one sentence, or "".
    """

    def __init__(self, context: EditorContext) -> None:
        """Open no folder yet; that of the last run is opened when it is needed."""
        self._context = context
        self.folder: Path | None = None
        self.keys: KeySet | None = None
        self.error = ""
        self._job: ThreadJob[KeySet] | None = None
        self._again = False
        self._looked = -_LOOK_EVERY
        # The files as they were when they were read last, or could not be read.
        self._stamp: Stamp = ()

    @property
    def reading(self) -> bool:
        """True while the keys are read."""
        return self._job is not None

    @property
    def transferable(self) -> KeySet | None:
        """The keys if they can be used, otherwise None."""
        return self.keys if self.keys is not None and self.keys.transfer is not None else None

    def open_last(self) -> None:
        """Open the folder of the last run, if none is open and it still exists."""
        last = self._context.settings.keys_folder
        if self.folder is None and last and paths.is_dir(last):
            self.open(Path(last))

    def open(self, folder: Path) -> None:
        """Open ``folder``, in the background."""
        self.folder, self.keys, self.error = paths.resolved(folder), None, ""
        self._context.settings.keys_folder = str(self.folder)
        self.read()

    def read(self) -> None:
        """Read the keys again, in the background."""
        if self.folder is None:
            return
        if self._job is not None:
            self._again = True
            return
        folder, last = self.folder, self.keys
        self._again = False

        def work(progress: Progress) -> KeySet:
            self._stamp = stamp_of(folder)
            return read_key_set(folder, progress, last)

        self._job = ThreadJob(work, self._context.wake)
        self._context.redraw()

    def read_changes(self) -> None:
        """Read the keys again if another program has changed a file; looks at most once a second."""
        now = self._context.clock()
        if self.folder is None or self.reading or now - self._looked < _LOOK_EVERY:
            return
        self._looked = now
        if stamp_of(self.folder) != self._stamp:
            self.read()

    def update(self) -> None:
        """Take the result of the background work.

        Raises:
            Exception: Its error, unless the user can resolve it.
        """
        job = self._job
        if job is None or not job.done:
            return
        self._job = None
        self._context.redraw()
        if self._again:
            self.read()
            return
        keys, error = outcome(job, TOO_LARGE)
        if error or keys is not None:
            self.keys, self.error = keys, error

    def close(self) -> None:
        """Cancel the background work."""
        if self._job is not None:
            self._job.cancel()

    def join(self) -> None:
        """Wait for the end of the background work."""
        if self._job is not None:
            self._job.join()
