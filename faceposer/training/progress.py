"""How far a training is, and a way to stop it."""

from collections.abc import Callable
from dataclasses import dataclass

from faceposer.errors import FacePoserError


class TrainingCancelled(FacePoserError):
    """The user stopped a training; nothing was written."""


def _ignore(_stage: str, _share: float) -> None:
    pass


@dataclass(frozen=True)
class Progress:
    """Tells how far a training is, and whether to go on.

    Attributes:
        show: Called with what is being done and how much of it is done, 0 to 1.
        cancelled: Whether the user wants to stop.
    """

    show: Callable[[str, float], None] = _ignore
    cancelled: Callable[[], bool] = lambda: False

    def at(self, stage: str, share: float = 0.0) -> None:
        """Say that ``share``, 0 to 1, of ``stage`` is done.

        Raises:
            TrainingCancelled: If the user wants to stop.
        """
        if self.cancelled():
            raise TrainingCancelled("The training was stopped; nothing was written.")
        self.show(stage, share)
