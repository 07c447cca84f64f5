"""Progress and cancellation of long functions."""

from collections.abc import Callable
from dataclasses import dataclass

from faceposer.errors import FacePoserError


class CancelledError(FacePoserError):
    """The user cancelled the work; nothing was written."""

    def __init__(self) -> None:
        super().__init__("The work was cancelled; nothing was written.")


def _ignore(_stage: str, _share: float) -> None:
    pass


@dataclass(frozen=True)
class Progress:
    """Progress reports and cancellation of a long function.

    Attributes:
        show: Callback for the name of a stage and its completed share, 0 to 1, or 0 if unknown.
        cancelled: Returns True if the user has cancelled the work.
    """

    show: Callable[[str, float], None] = _ignore
    cancelled: Callable[[], bool] = lambda: False

    def at(self, stage: str, share: float = 0.0) -> None:
        """Report that the ``share``, 0 to 1, of ``stage`` is done.

        Raises:
            CancelledError: If the user has cancelled the work.
        """
        self.check()
        self.show(stage, share)

    def part(self, begin: float, end: float) -> "Progress":
        """Return the progress of a part of the work, of all of which the share ``begin`` is done before it.

        Stages of the part follow each other without the share falling back.

        Args:
            begin: Share of the work before the part.
            end: Share of the work at the end of the part.
        """
        reached = begin

        def show(stage: str, share: float) -> None:
            nonlocal reached
            reached = max(reached, begin + (end - begin) * min(max(share, 0.0), 1.0))
            self.show(stage, reached)

        return Progress(show, self.cancelled)

    def check(self) -> None:
        """Stop if the work is cancelled.

        Raises:
            CancelledError: If the user has cancelled the work.
        """
        if self.cancelled():
            raise CancelledError
