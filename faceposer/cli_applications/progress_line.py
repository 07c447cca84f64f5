"""How far a command is, for whoever is looking."""

import sys


class ProgressLine:
    """One line that is written over and over, where the errors go to a terminal; nothing elsewhere."""

    def __init__(self) -> None:
        """Show nothing yet."""
        self._wanted = sys.stderr.isatty()
        self._shown = False

    def show(self, text: str) -> None:
        """Show ``text`` in place of what was there."""
        if self._wanted:
            print(f"\r{text:40}", end="", file=sys.stderr, flush=True)
            self._shown = True

    def share(self, share: float) -> None:
        """Show which ``share``, 0 to 1, is done."""
        self.show(f"{100.0 * share:3.0f} %")

    def clear(self) -> None:
        """Take the line away."""
        if self._shown:
            print(f"\r{'':40}\r", end="", file=sys.stderr, flush=True)
            self._shown = False
