"""Smooth weights in space."""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def ramp(start: float, stop: float, x: Floats) -> Floats:
    """Return weights for ``x`` that rise smoothly from 0 at ``start`` to 1 at ``stop``, with zero slope at both."""
    t = np.clip((x - start) / (stop - start), 0.0, 1.0)
    return t * t * t * (t * (6.0 * t - 15.0) + 10.0)
