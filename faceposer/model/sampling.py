"""Resampling of performances to another frame rate."""

import numpy as np

from faceposer.errors import FacePoserError
from faceposer.model.performance import Performance

_MOST_FRAMES = 100_000


def resampled(performance: Performance, rate: float) -> Performance:
    """Return ``performance`` at ``rate`` frames per second, interpolated linearly from the first frame to the last.

    The last pose is held as far as needed for the performance to last as long as before.

    Raises:
        FacePoserError: If the result would have too many frames.
    """
    if rate == performance.rate or len(performance) == 1:
        return Performance(performance.coefficients, rate)
    seconds = (len(performance) - 1) / performance.rate
    if seconds * rate > _MOST_FRAMES:
        raise FacePoserError(
            f"{seconds:.6g} seconds at {rate:g} frames per second give more than {_MOST_FRAMES} frames; "
            "choose a lower rate."
        )
    count = max(int(np.floor(seconds * rate + 1e-6)) + 1, round(performance.seconds * rate))
    at = np.minimum(np.arange(count) * performance.rate / rate, len(performance) - 1)
    before = np.minimum(at.astype(np.intp), len(performance) - 2)
    share = (at - before)[:, None]
    frames = performance.coefficients
    return Performance((1.0 - share) * frames[before] + share * frames[before + 1], rate)
