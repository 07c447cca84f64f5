"""The background thread that learns a custom character."""

import threading
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

from faceposer.gui.features.import_character.form import ImportForm

# Seconds between two wakings of the frame loop: progress may come for each of thousands of meshes.
_WAKE_EVERY = 0.07


class Training:
    """One learning, in a thread of its own, from the form to the file.

    Attributes:
        output: The file that it writes, all or nothing.
        stage: What it does now.
        share: How much of that is done, 0 where nobody knows.
        about: What was learned (``description_of``), or None as long as there is nothing.
        error: What ended it early, or None.
    """

    def __init__(self, form: ImportForm, output: Path, wake: Callable[[], None]) -> None:
        """Begin to learn what ``form`` asks for; ``wake`` is called from the thread when there is news."""
        self.output = output
        self.stage, self.share = "Getting ready", 0.0
        self.about: dict[str, Any] | None = None
        self.error: Exception | None = None
        self._form = replace(form, captures=list(form.captures))
        self._wake = wake
        self._woken = 0.0
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="training")
        self._thread.start()

    @property
    def done(self) -> bool:
        """Whether it has ended, in whatever way."""
        return not self._thread.is_alive()

    @property
    def stopping(self) -> bool:
        """Whether the user has stopped it."""
        return self._stop.is_set()

    def stop(self) -> None:
        """Let it end at the next step, with nothing written."""
        self._stop.set()

    def join(self) -> None:
        """Wait for the end."""
        self._thread.join()

    def _run(self) -> None:
        try:
            # Here and not above: the libraries behind take more than a second to load.
            from faceposer.model.subject_file import save_subject
            from faceposer.training.progress import Progress
            from faceposer.training.request import train
            from faceposer.training.summary import description_of

            progress = Progress(self._show, self._stop.is_set)
            progress.at("Getting ready")
            subject = train(self._form.request(self.output), progress)
            progress.at("Saving")
            save_subject(self.output, subject)
            self.about = description_of(subject)
        except Exception as error:  # it is told in the window, not here
            self.error = error
        self._wake()

    def _show(self, stage: str, share: float) -> None:
        self.stage, self.share = stage, share
        now = time.monotonic()
        if now - self._woken > _WAKE_EVERY:
            self._woken = now
            self._wake()
