"""Performances at another rate."""

import numpy as np

from faceposer.errors import FacePoserError
from faceposer.model.performance import Performance

_MOST_FRAMES = 100_000


def resampled(performance: Performance, rate: float) -> Performance:
    """Return ``performance`` at ``rate`` frames per second, straight between its frames, from the first to the last.

    Raises:
        FacePoserError: If these would be too many.
    """
    if rate == performance.rate or len(performance) == 1:
        return Performance(performance.coefficients, rate)
    seconds = (len(performance) - 1) / performance.rate
    if seconds * rate > _MOST_FRAMES:
        raise FacePoserError(
            f"{seconds:.6g} seconds at {rate:g} frames a second are too many frames; at most {_MOST_FRAMES}."
        )
    count = int(np.floor(seconds * rate + 1e-6)) + 1
    at = np.minimum(np.arange(count) * performance.rate / rate, len(performance) - 1)
    before = np.minimum(at.astype(np.intp), len(performance) - 2)
    share = (at - before)[:, None]
    frames = performance.coefficients
    return Performance((1.0 - share) * frames[before] + share * frames[before + 1], rate)
