"""Lines of heads along which sliders move: caricatures and mixtures."""

from dataclasses import dataclass

from faceposer.identity.identity import Identity


@dataclass(frozen=True, eq=False)
class Line:
    """A line of heads that a slider moves along.

    Attributes:
        start: Head at the slider's value 1 of a caricature, or 0 of a mixture.
        end: The other head of a mixture, or None.
        value: Present value of the slider.
        result: The head at that value, as long as it is the session's.
    """

    start: Identity
    end: Identity | None
    value: float
    result: Identity
