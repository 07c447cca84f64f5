"""Intervals of lines that a stroke may depict: too short, too long, in pieces, from any start of a closed line."""

from dataclasses import dataclass
from functools import lru_cache
from itertools import product

import numpy as np
from numpy.typing import NDArray

from faceposer.sketch.hand import SAMPLES

Array = NDArray[np.float64]

# Ends of strokes along the whole line, as shares of its length beyond its ends, with their log weights.
_ENDS = (-0.14, -0.07, 0.0, 0.07, 0.14)
_COARSE_ENDS = (-0.11, 0.0, 0.11)
_END_SPREAD = 0.10
# Pieces of a line, and their weight in all.
_PIECES = ((0.0, 0.5), (0.5, 1.0), (0.25, 0.75), (0.0, 0.65), (0.35, 1.0))
_PIECES_SHARE = 0.08
# Lengths of a closed stroke, and the number of its starts.
_TURNS, _STARTS, _COARSE_STARTS = (0.86, 1.0, 1.14), 20, 12
# Share of a line's length over which it is continued beyond its ends.
_TANGENT = 0.08


@dataclass(frozen=True, eq=False)
class Intervals:
    """Candidate intervals of a line, in shares of its length in the image.

    Attributes:
        begins: Shape (m,); below 0 before the line.
        ends: Shape (m,); above 1 beyond it.
        log_weights: Log of the probability of each, shape (m,).
    """

    begins: Array
    ends: Array
    log_weights: Array

    def __len__(self) -> int:
        return len(self.begins)


@lru_cache(maxsize=4)
def candidate_intervals(closed: bool, coarse: bool = False) -> Intervals:
    """Return the intervals of an open or ``closed`` line, fewer if ``coarse``."""
    if closed:
        starts = _COARSE_STARTS if coarse else _STARTS
        pairs = [(start / starts, start / starts + turn) for start in range(starts) for turn in _TURNS]
        weights = np.full(len(pairs), 1.0 / len(pairs))
    else:
        ends = _COARSE_ENDS if coarse else _ENDS
        whole = list(product([-end for end in ends], [1.0 + end for end in ends]))
        likely = np.exp([-0.5 * (a * a + (b - 1.0) ** 2) / _END_SPREAD**2 for a, b in whole])
        pairs = [*whole, *_PIECES]
        pieces = np.full(len(_PIECES), _PIECES_SHARE / len(_PIECES))
        weights = np.concatenate([(1.0 - _PIECES_SHARE) * likely / likely.sum(), pieces])
    begins, ends = np.array(pairs).T
    return Intervals(begins, ends, np.log(weights))


def refined(begin: float, end: float, closed: bool) -> Intervals:
    """Return intervals close to the one from ``begin`` to ``end``."""
    near = (-0.045, -0.03, -0.015, 0.0, 0.015, 0.03, 0.045)
    moves = np.array(list(product(near, near)))
    begins, ends = begin + moves[:, 0], end + moves[:, 1]
    if not closed:
        weights = -0.5 * (np.minimum(begins, 0.0) ** 2 + np.maximum(ends - 1.0, 0.0) ** 2) / _END_SPREAD**2
    else:
        weights = -0.5 * ((ends - begins - 1.0) / 0.12) ** 2
    return Intervals(begins, ends, weights)


def sampled(pixels: Array, closed: bool, intervals: Intervals) -> tuple[NDArray[np.intp], NDArray[np.intp], Array]:
    """Return samples of ``intervals`` of a line as points between two of its own, possibly beyond them.

    Args:
        pixels: The line in the image, shape (n, 2).
        closed: True if the last point is the first again.
        intervals: m intervals.

    Returns:
        Indices i and j and shares w, each (m, SAMPLES); the samples are (1 - w) x_i + w x_j.
    """
    steps = np.sqrt((np.diff(pixels, axis=0) ** 2).sum(axis=1))
    along = np.concatenate([[0.0], np.cumsum(np.maximum(steps, 1e-9))])
    share = np.linspace(0.0, 1.0, SAMPLES)
    wanted = intervals.begins[:, None] + (intervals.ends - intervals.begins)[:, None] * share
    wanted = (np.mod(wanted, 1.0) if closed else wanted) * along[-1]
    after = np.clip(np.searchsorted(along, wanted), 1, len(along) - 1).astype(np.intp)
    before = after - 1
    if not closed:
        count = len(along)
        inner = min(max(int(np.searchsorted(along, _TANGENT * along[-1])), 1), count - 1)
        outer = max(min(int(np.searchsorted(along, (1.0 - _TANGENT) * along[-1])), count - 2), 0)
        before[wanted < 0.0], after[wanted < 0.0] = 0, inner
        over = wanted > along[-1]
        before[over], after[over] = outer, count - 1
    # A line may have no length in the image, or one too small against its place.
    return before, after, (wanted - along[before]) / np.maximum(along[after] - along[before], 1e-12)
