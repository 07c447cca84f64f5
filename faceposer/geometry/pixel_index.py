"""Search for pixels in boxes of the picture."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
Indices = NDArray[np.intp]
# Coordinates are compared within these bounds, in which cells have exact numbers.
_FARTHEST = float(1 << 30)


class PixelIndex:
    """Pixels in the order of their cells, rows by rows, for searches by boxes."""

    def __init__(self, pixels: ArrayLike) -> None:
        """Sort ``pixels``, shape (n, 2), with n > 0, by their cells."""
        columns, rows = _cells(np.asarray(pixels, dtype=np.float64)).T
        self._low, self._high = (int(columns.min()), int(rows.min())), (int(columns.max()), int(rows.max()))
        self._width = self._high[0] - self._low[0] + 1
        keys = self._keys(columns, rows)
        self._order = np.argsort(keys, kind="stable")
        self._sorted = keys[self._order]

    def _keys(self, columns: NDArray[np.int64], rows: NDArray[np.int64]) -> NDArray[np.int64]:
        return (rows - self._low[1]) * self._width + columns - self._low[0]

    def rows(self, low: Array, high: Array) -> Indices:
        """Return the number of rows with pixels, at most, of boxes from ``low`` to ``high``, (k, 2), as (k,)."""
        first, last = self._row_range(low, high)
        return np.maximum(last - first + 1, 0)

    def counts(self, low: Array, high: Array) -> Indices:
        """Return the number of pixels in the cells of boxes from ``low`` to ``high``, (k, 2), as (k,)."""
        which, begin, end = self._runs(low, high)
        return np.bincount(which, end - begin, minlength=len(low)).astype(np.intp)

    def inside(self, low: Array, high: Array) -> tuple[Indices, Indices]:
        """Return pairs of a box and a pixel in its cells, as two arrays of indices."""
        which, begin, end = self._runs(low, high)
        counts = end - begin
        places = np.arange(int(counts.sum())) + np.repeat(begin - (np.cumsum(counts) - counts), counts)
        return np.repeat(which, counts), self._order[places]

    def _row_range(self, low: Array, high: Array) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        return np.maximum(_cells(low)[:, 1], self._low[1]), np.minimum(_cells(high)[:, 1], self._high[1])

    def _runs(self, low: Array, high: Array) -> tuple[Indices, Indices, Indices]:
        """Return the box and the range of sorted pixels of each row of the boxes."""
        first, last = self._row_range(low, high)
        counts = np.maximum(last - first + 1, 0)
        which = np.repeat(np.arange(len(low)), counts)
        rows = np.arange(len(which)) + np.repeat(first - (np.cumsum(counts) - counts), counts)
        left = np.maximum(_cells(low)[:, 0], self._low[0])[which]
        right = np.minimum(_cells(high)[:, 0], self._high[0])[which]
        begin = np.searchsorted(self._sorted, self._keys(left, rows), side="left")
        end = np.searchsorted(self._sorted, self._keys(right, rows), side="right")
        return which, begin, np.where(left <= right, end, begin)


def _cells(pixels: Array) -> NDArray[np.int64]:
    return np.floor(np.clip(pixels, -_FARTHEST, _FARTHEST)).astype(np.int64)
