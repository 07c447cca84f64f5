"""Strokes on the screen: smoothing, and rasterisation of a round brush."""

from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
StrokeShape = Literal["line", "closed", "filled"]
STROKE_SHAPES: tuple[StrokeShape, ...] = get_args(StrokeShape)

# Spacing of the points of a smoothed stroke, and standard deviation of the smoothing along it, in pixels.
_STEP = 2.0
_SMOOTHING = 5.0


def resampled(points: ArrayLike, step: float) -> Array:
    """Return points about ``step`` apart along the polyline ``points``, shape (n, 2), including both ends."""
    line = np.asarray(points, dtype=np.float64).reshape(-1, 2)
    lengths = np.hypot(*np.diff(line, axis=0).T)
    keep = np.concatenate([[True], lengths > 1e-9])
    line = line[keep]
    if len(line) < 2:
        return line
    along = np.concatenate([[0.0], np.cumsum(lengths[keep[1:]])])
    at = np.linspace(0.0, along[-1], max(round(float(along[-1]) / step), 1) + 1)
    return np.column_stack([np.interp(at, along, line[:, axis]) for axis in range(2)])


def smoothed(points: ArrayLike, closed: bool = False, step: float = _STEP, reach: float = _SMOOTHING) -> Array:
    """Return the stroke ``points``, shape (n, 2), resampled every ``step`` pixels and without the hand's tremor.

    A Gaussian filter with a standard deviation of ``reach`` pixels is applied along the stroke, to the offsets from the
    chord between the ends. The offsets are continued by point reflection, so that the ends do not move.
    """
    # Imported late to shorten the start of the window.
    from scipy.ndimage import gaussian_filter1d

    line = np.asarray(points, dtype=np.float64).reshape(-1, 2)
    if closed and len(line) > 2:
        return gaussian_filter1d(resampled(np.concatenate([line, line[:1]]), step)[:-1], reach / step, 0, mode="wrap")
    line = resampled(line, step)
    if len(line) < 3:
        return line
    chord = np.linspace(0.0, 1.0, len(line))[:, None] * (line[-1] - line[0]) + line[0]
    offsets = line - chord
    odd = np.concatenate([-offsets[:0:-1], offsets, -offsets[-2::-1]])
    filtered: Array = gaussian_filter1d(odd, reach / step, 0)[len(offsets) - 1 : 2 * len(offsets) - 1]
    return chord + filtered


def stroke_pixels(points: ArrayLike, width: float, shape: StrokeShape = "line") -> Array:
    """Return the centres, shape (m, 2), of the pixels that a round brush covers, row by row from the top left.

    Args:
        points: Path of the brush, shape (n, 2).
        width: Diameter of the brush in pixels, at least 1.
        shape: "line"; "closed" to connect the last point to the first; "filled" to cover the enclosed pixels as well.
    """
    line = np.asarray(points, dtype=np.float64).reshape(-1, 2)
    radius = max(width, 1.0) / 2.0
    low = np.floor(line.min(axis=0) - radius).astype(int)
    columns, rows = np.ceil(line.max(axis=0) + radius).astype(int) - low + 1
    covered = np.zeros((rows, columns), dtype=bool)
    ends = np.roll(line, -1, axis=0) if shape != "line" and len(line) > 2 else np.concatenate([line[1:], line[-1:]])
    for begin, end in zip(line, ends, strict=True):
        _cover(covered, low, begin, end, radius)
    if shape == "filled" and len(line) > 2:
        _fill(covered, low, line)
    row, column = np.nonzero(covered)
    return np.column_stack([column, row]) + low + 0.5


def _cover(covered: NDArray[np.bool_], low: NDArray[np.int_], begin: Array, end: Array, radius: float) -> None:
    """Mark the pixels with a centre within ``radius`` of the segment from ``begin`` to ``end``."""
    first = np.maximum(np.floor(np.minimum(begin, end) - radius).astype(int) - low, 0)
    last = np.ceil(np.maximum(begin, end) + radius).astype(int) - low + 1
    x = np.arange(first[0], last[0]) + low[0] + 0.5 - begin[0]
    y = (np.arange(first[1], last[1]) + low[1] + 0.5 - begin[1])[:, None]
    dx, dy = end - begin
    t = np.clip((x * dx + y * dy) / max(dx * dx + dy * dy, 1e-12), 0.0, 1.0)
    near = (x - t * dx) ** 2 + (y - t * dy) ** 2 <= radius * radius
    block = covered[first[1] : last[1], first[0] : last[0]]
    block |= near[: block.shape[0], : block.shape[1]]


def _fill(covered: NDArray[np.bool_], low: NDArray[np.int_], line: Array) -> None:
    """Mark the pixels with a centre inside the closed polygon ``line``, by the even-odd rule."""
    x = np.arange(covered.shape[1]) + low[0] + 0.5
    y = np.arange(covered.shape[0]) + low[1] + 0.5
    covered |= enclosed(np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2), line).reshape(covered.shape)


def enclosed(points: ArrayLike, polygon: ArrayLike) -> NDArray[np.bool_]:
    """Return the mask of ``points``, (n, 2), inside ``polygon``, (m, 2), by the even-odd rule, shape (n,)."""
    at = np.asarray(points, dtype=np.float64)
    corners = np.asarray(polygon, dtype=np.float64)
    inside = np.zeros(len(at), dtype=bool)
    for (x0, y0), (x1, y1) in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        if y0 == y1:
            continue
        crosses = (at[:, 1] < y0) != (at[:, 1] < y1)
        inside ^= crosses & (at[:, 0] < x0 + (at[:, 1] - y0) * (x1 - x0) / (y1 - y0))
    return inside
