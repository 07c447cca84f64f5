"""Centre lines of thin outlines, as calligraphic pens and brushes write strokes."""

import numpy as np
from numpy.typing import NDArray

from faceposer.sketch.polyline import evenly, lengths_along

Array = NDArray[np.float64]

# Greatest mean width of an outline that is a stroke, as a share of its length, and number of points of a side.
_WIDEST, _SIDE = 0.16, 64
# Greatest distance of the ends of a closed line, as a share of its length.
_CLOSED = 0.1


def is_closed(line: Array, gap: float = _CLOSED) -> bool:
    """Return True if the ends of ``line``, shape (n, 2), are nearer than ``gap``, a share of its length."""
    return bool(np.linalg.norm(line[-1] - line[0]) < gap * lengths_along(line)[-1])


def centreline(outline: Array) -> Array | None:
    """Return the centre line of a thin closed ``outline``, (n, 2), or None if it is not one.

    The outline is cut at the two points that are furthest apart along it and in the plane; its two sides are averaged.
    """
    if not is_closed(outline) or len(outline) < 4:
        return None
    around = evenly(np.concatenate([outline, outline[:1]]), 2 * _SIDE + 1)[:-1]
    x, y = around.T
    area = 0.5 * abs(float((x * np.roll(y, -1) - np.roll(x, -1) * y).sum()))
    half = 0.5 * float(lengths_along(np.concatenate([around, around[:1]]))[-1])
    if half <= 0.0 or area / half**2 > _WIDEST:
        return None
    # Ends of a stroke are half the outline apart, and sharp: both sides leave them in the same direction.
    reach = max(_SIDE // 8, 2)
    ahead, behind = np.roll(around, -reach, axis=0) - around, np.roll(around, reach, axis=0) - around
    product = np.linalg.norm(ahead, axis=1) * np.linalg.norm(behind, axis=1)
    sharp = (ahead * behind).sum(axis=1) / np.maximum(product, 1e-12)
    shifts = np.arange(_SIDE - _SIDE // 4, _SIDE + _SIDE // 4 + 1)
    scores = sharp[:, None] + sharp[(np.arange(2 * _SIDE)[:, None] + shifts) % (2 * _SIDE)]
    first, shift = np.unravel_index(int(np.argmax(scores)), scores.shape)
    turned = np.roll(around, -int(first), axis=0)
    cut = int(shifts[shift])
    there, back = turned[: cut + 1], np.concatenate([turned[cut:], turned[:1]])
    return 0.5 * (evenly(there, _SIDE) + evenly(back[::-1], _SIDE))
