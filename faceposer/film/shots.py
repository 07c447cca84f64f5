"""Shots of a film: cuts, found by sudden changes of the whole picture."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from PIL import Image

Thumbnail = NDArray[np.float32]

# Size of the pictures that are compared.
_SIZE = (24, 16)
# Least mean difference between two frames at a cut, of 0 to 255, and how many times those around it are less.
_LEAST, _TIMES = 14.0, 3.0


@dataclass(frozen=True)
class Shot:
    """A part of a film without cuts.

    Attributes:
        first: Its first frame.
        last: Its last frame.
    """

    first: int
    last: int


def thumbnail(pixels: NDArray[np.uint8]) -> Thumbnail:
    """Return a small grey picture of ``pixels``, shape (h, w, 3)."""
    small = Image.fromarray(pixels).convert("L").resize(_SIZE, Image.Resampling.BOX)
    return np.asarray(small, dtype=np.float32)


def change(before: Thumbnail | None, now: Thumbnail) -> float:
    """Return the mean difference of two thumbnails, 0 to 255; 0 if there is none ``before``."""
    return 0.0 if before is None else float(np.abs(now - before).mean())


def sudden(now: float, before: float) -> bool:
    """Return True if a ``change`` to a frame is that of a cut, as far as the change ``before`` it tells."""
    return now >= _LEAST and now > _TIMES * before


def shots_of(numbers: Sequence[int], changes: Sequence[float]) -> list[Shot]:
    """Return the shots of frames with ``numbers`` and their ``changes`` since the frames before them.

    A flash changes two frames in a row, and a fast pan many; a cut changes one.
    """
    starts = [0]
    for k in range(1, len(numbers)):
        after = changes[k + 1] if k + 1 < len(changes) else 0.0
        if sudden(changes[k], changes[k - 1]) and changes[k] > _TIMES * after:
            starts.append(k)
    ends = [*(start - 1 for start in starts[1:]), len(numbers) - 1]
    return [Shot(numbers[start], numbers[end]) for start, end in zip(starts, ends, strict=True)]
