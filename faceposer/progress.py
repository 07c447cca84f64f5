"""Progress of long work, and its cancellation: the one way in which long functions report and stop."""

from collections.abc import Callable
from dataclasses import dataclass

from faceposer.errors import FacePoserError


class CancelledError(FacePoserError):
    """The user cancelled a long piece of work; nothing of it was kept."""

    def __init__(self) -> None:
        super().__init__("The work was cancelled; nothing was written.")


def _ignore(_stage: str, _share: float) -> None:
    pass


@dataclass(frozen=True)
class Progress:
    """Reports the progress of long work, and says when to stop.

    Attributes:
        show: Called with the name of a stage and the share of it that is done, 0 to 1; 0 where that is unknown.
        cancelled: Whether the user wants to stop.
    """

    show: Callable[[str, float], None] = _ignore
    cancelled: Callable[[], bool] = lambda: False

    def at(self, stage: str, share: float = 0.0) -> None:
        """Report that ``share``, 0 to 1, of ``stage`` is done.

        Raises:
            CancelledError: If the user wants to stop.
        """
        self.check()
        self.show(stage, share)

    def check(self) -> None:
        """Stop if the user wants to.

        Raises:
            CancelledError: If so.
        """
        if self.cancelled():
            raise CancelledError
