"""Lines of heads along which sliders move: caricatures and mixtures."""

from dataclasses import dataclass
from weakref import WeakKeyDictionary

from faceposer.identity.identity import Identity


@dataclass(frozen=True, eq=False)
class Line:
    """Place of a head on a line that a slider moves along.

    Attributes:
        start: Head at the slider's value 1 of a caricature, or 0 of a mixture.
        end: The other head of a mixture, or None.
        value: Value of the slider at the head.
    """

    start: Identity
    end: Identity | None
    value: float


class Lines:
    """The lines on which heads of the history are, so that undo and redo show the slider's value of each."""

    def __init__(self) -> None:
        self._of: WeakKeyDictionary[Identity, Line] = WeakKeyDictionary()

    def of(self, head: Identity, end: Identity | None = None) -> Line | None:
        """Return the line of ``head`` to ``end``, or None if it was not made by the slider."""
        line = self._of.get(head)
        return line if line is not None and line.end is end else None

    def add(self, head: Identity, line: Line) -> None:
        """Remember that ``head`` is on ``line``."""
        if head is not line.start:
            self._of[head] = line
