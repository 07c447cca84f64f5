"""Even times at which curves with keys of their own are sampled."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from faceposer.files.sample_rates import USUAL_RATE, apart, key_rate, nearest_known

Array = NDArray[np.float64]

# Keys per second from which curves are frames, and the highest rate of frames.
_SLOWEST, _FASTEST = 10.0, 240.0
# Frames by which keys may be off the rate of their usual step.
_EVEN = 0.05
_CLOCK = 4e-4


@dataclass(frozen=True, eq=False)
class Sampling:
    """Even times from the first key of curves to the last.

    Attributes:
        seconds: Shape (F,); the last one may be up to a frame after the last key.
        rate: Frames per second.
        note: A sentence about keys that are farther apart than frames, or "".
    """

    seconds: Array
    rate: float
    note: str


def sampling(keys: Sequence[Array], most: int, rate: float | None = None) -> Sampling | float:
    """Return the times at which curves with these ``keys`` are sampled, or the number of frames if it exceeds ``most``.

    Curves with a key at every frame are sampled at its rate. Others are sampled at a usual rate at which all keys are
    on frames, or at 30 frames per second.

    Args:
        keys: Rising times of the keys of each curve in seconds.
        most: Maximum number of frames.
        rate: Frames per second, or None to determine it.
    """
    times = np.unique(np.concatenate(list(keys)))
    since = times - times[0]
    found, are_frames = _rate(since, max(keys, key=len))
    found = rate or found
    note = (
        "" if are_frames else f"Its keys are {apart(since)}; they were interpolated at {found:.5g} frames per second."
    )
    frames = float(since[-1]) * found
    if not frames + 1.0 <= most:
        return frames + 1.0
    # The last key is a frame of its own, even where it is between two.
    count = int(np.ceil(frames - 1e-2)) + 1
    return Sampling(times[0] + np.arange(count) / found, found, note)


def _rate(since: Array, densest: Array) -> tuple[float, bool]:
    """Return the frames per second for keys at seconds ``since`` the first, and True if the keys are frames."""
    if len(since) < 2:
        return USUAL_RATE, True
    steps = np.diff(since)
    dense = np.diff(densest) if len(densest) > 1 else steps
    measured = 1.0 / float(np.median(dense))
    if measured >= _SLOWEST * (1.0 - _CLOCK):
        # Equal keys in a row are often left out, so that one step is not the rate, but most are.
        found = round(min(nearest_known(measured, _CLOCK), _FASTEST), 2)
        if np.abs(since * found - np.rint(since * found)).max() <= _EVEN or found >= USUAL_RATE:
            return found, True
    return key_rate(since), False
