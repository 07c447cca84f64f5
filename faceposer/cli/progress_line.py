"""Progress of a command on the terminal."""

import sys
import time

from faceposer.progress import Progress

# Seconds of work after which the time left is shown.
_LONG = 10.0


class ProgressLine:
    """A line on standard error that is overwritten in place.

    If standard error is not a terminal, nothing is shown, or with ``log`` one line for each tenth of the work.
    """

    def __init__(self, log: bool = False) -> None:
        """Initialise the line without showing it; ``log`` also reports when standard error is not a terminal."""
        self._live = sys.stderr.isatty()
        self._log = log
        self._shown = ""
        self.restart()

    def restart(self, title: str = "") -> None:
        """Begin another piece of work; ``title`` is prepended to its texts."""
        self._title = title
        self._stage, self._began, self._tenth = "", time.monotonic(), -1

    @property
    def progress(self) -> Progress:
        """Progress object for long functions, shown in this line."""
        return Progress(self.stage)

    def show(self, text: str) -> None:
        """Replace the shown text by ``text``."""
        text = self._title + text
        if self._live and text != self._shown:
            width = max(len(self._shown), len(text))
            print(f"\r{text:{width}}", end="", file=sys.stderr, flush=True)
            self._shown = text

    def share(self, share: float) -> None:
        """Show the ``share``, 0 to 1, that is done."""
        self.show(f"{100.0 * share:3.0f} %")

    def stage(self, stage: str, share: float) -> None:
        """Show the name of a ``stage`` and, between 0 and 1, the ``share`` of it that is done and the time left.

        Work that takes minutes is logged at each tenth if so configured.
        """
        if stage != self._stage:
            self._stage, self._began, self._tenth = stage, time.monotonic(), -1
        text = f"{stage} {100 * share:.0f} %" if 0.0 < share < 1.0 else stage
        seconds = time.monotonic() - self._began
        if 0.0 < share < 1.0 and seconds > _LONG:
            text += f", about {max(1, round(seconds * (1.0 - share) / share / 60.0))} min to go"
        self.show(text)
        if self._log and not self._live and int(10 * share) > self._tenth:
            self._tenth = int(10 * share)
            print(self._title + text, file=sys.stderr, flush=True)

    def clear(self) -> None:
        """Remove the line."""
        if self._shown:
            print(f"\r{'':{len(self._shown)}}\r", end="", file=sys.stderr, flush=True)
            self._shown = ""
