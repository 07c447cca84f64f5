"""The progress of a command on the terminal."""

import sys
import time

from faceposer.progress import Progress


class ProgressLine:
    """One line on the standard error that is written over.

    Where the standard error is no terminal, nothing is shown, or with ``log`` a line at each tenth of the work.
    """

    def __init__(self, log: bool = False) -> None:
        """Show nothing yet; with ``log``, also say something where nobody is watching a terminal."""
        self._live = sys.stderr.isatty()
        self._log = log
        self._shown = ""
        self.restart()

    def restart(self, title: str = "") -> None:
        """Begin another piece of work, whose texts begin with ``title``."""
        self._title = title
        self._began = time.monotonic()
        self._tenth = -1

    @property
    def progress(self) -> Progress:
        """What long functions report to, shown in this line."""
        return Progress(self.stage)

    def show(self, text: str) -> None:
        """Show ``text`` in place of what was there."""
        text = self._title + text
        if self._live and text != self._shown:
            width = max(len(self._shown), len(text))
            print(f"\r{text:{width}}", end="", file=sys.stderr, flush=True)
            self._shown = text

    def share(self, share: float) -> None:
        """Show the ``share``, 0 to 1, that is done."""
        self.show(f"{100.0 * share:3.0f} %")

    def stage(self, stage: str, share: float) -> None:
        """Show the name of a ``stage`` and, unless it is 0, the ``share`` of it that is done."""
        self.show(f"{stage} {100 * share:3.0f} %" if share else stage)

    def count(self, done: int, of: int, text: str) -> None:
        """Show ``text``, with the time left once it can be told; logged at each tenth where nobody watches."""
        if 5 <= done < of:
            left = (time.monotonic() - self._began) * (of - done) / done
            text += f", about {max(1, round(left / 60))} min to go"
        self.show(text)
        if self._log and not self._live and of and 10 * done // of > self._tenth:
            self._tenth = 10 * done // of
            print(self._title + text, file=sys.stderr, flush=True)

    def clear(self) -> None:
        """Remove the line."""
        if self._shown:
            print(f"\r{'':{len(self._shown)}}\r", end="", file=sys.stderr, flush=True)
            self._shown = ""
