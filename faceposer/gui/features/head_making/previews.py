"""Pictures of a fit in progress, drawn no oftener than they are worth."""

import time
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Pixels = NDArray[np.uint8]

#: Longer side of the pictures in pixels.
SIDE = 480
# Seconds between two pictures at least, and share of the time that they may take.
_LEAST, _SHARE = 0.3, 0.2


class Previews:
    """Draws pictures of a fit and shows them."""

    def __init__(self, show: Callable[[Pixels], None], clock: Callable[[], float] = time.perf_counter) -> None:
        """Give the pictures to ``show``."""
        self._show, self._clock = show, clock
        self._next = -np.inf

    def draw(self, draw: Callable[[], Pixels], always: bool = False) -> None:
        """Show the picture that ``draw`` returns if enough time has passed since the last one, or ``always``."""
        begun = self._clock()
        if begun < self._next and not always:
            return
        self._show(draw())
        ended = self._clock()
        self._next = ended + max(_LEAST, (ended - begun) / _SHARE)
