"""Performances at another rate."""

import numpy as np

from faceposer.model.performance import Performance


def resampled(performance: Performance, rate: float) -> Performance:
    """Return ``performance`` at ``rate`` frames per second, straight between its frames, from the first to the last."""
    if rate == performance.rate or len(performance) == 1:
        return Performance(performance.coefficients, rate)
    count = int(np.floor((len(performance) - 1) / performance.rate * rate + 1e-6)) + 1
    at = np.minimum(np.arange(count) * performance.rate / rate, len(performance) - 1)
    before = np.minimum(at.astype(np.intp), len(performance) - 2)
    share = (at - before)[:, None]
    frames = performance.coefficients
    return Performance((1.0 - share) * frames[before] + share * frames[before + 1], rate)
