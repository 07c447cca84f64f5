"""How far a long export is, and a way to stop it."""

from collections.abc import Callable

#: Is told the share that is done, 0 to 1; what it raises ends the export, which then leaves nothing behind.
Progress = Callable[[float], None]


def no_progress(_share: float) -> None:
    """Tell nobody."""
