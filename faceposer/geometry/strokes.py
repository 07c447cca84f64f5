"""Strokes on the screen: smoothing, and rasterisation of a round brush."""

import math
from collections.abc import Iterator
from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
StrokeShape = Literal["line", "closed", "filled"]
STROKE_SHAPES: tuple[StrokeShape, ...] = get_args(StrokeShape)

#: Maximum number of pixels that a stroke covers.
MOST_PIXELS = 4_000_000
#: Maximum ``stroke_effort``, of one stroke and of all strokes of a session together.
MOST_EFFORT = 8_000_000.0
#: Runs of pixels, shape (k, 3): row, first column, and the column after the last.
Spans = NDArray[np.int64]
_NO_SPANS: Spans = np.zeros((0, 3), dtype=np.int64)
# Rows of brushes that are handled at a time.
_MOST_ROWS = 100_000
# Tolerance of the distance of a centre from the path, in pixels.
_ROUNDING = 1e-9
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
        around = resampled(np.concatenate([line, line[:1]]), step)
        # A pointer that is held still draws a single point, which is not repeated at the end.
        return around if len(around) < 3 else gaussian_filter1d(around[:-1], reach / step, 0, mode="wrap")
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

    These are the pixels with a centre in the brush, and those that its path passes through. Time and memory depend on
    the length of the path and on the number of pixels, not on the extent of the stroke.

    Args:
        points: Path of the brush, shape (n, 2).
        width: Diameter of the brush in pixels, at least 1.
        shape: "line"; "closed" to connect the last point to the first; "filled" to cover the enclosed pixels as well.

    Raises:
        ValueError: If it covers more than ``MOST_PIXELS``, or is so long that finding them would take too long.
    """
    line = np.asarray(points, dtype=np.float64).reshape(-1, 2)
    if stroke_effort(line, width, shape) > MOST_EFFORT:
        raise ValueError(f"it is too long or too wide: a stroke must not cover more than {MOST_PIXELS} pixels")
    # Half the diagonal of a pixel: the brush then covers all pixels that its path passes through.
    radius = max(width / 2.0, math.sqrt(0.5))
    closed = shape != "line" and len(line) > 2
    ends = np.roll(line, -1, axis=0) if closed else np.concatenate([line[1:], line[-1:]])
    heights = np.abs(ends[:, 1] - line[:, 1]) + 2.0 * radius + 2.0
    spans = _NO_SPANS
    for part in np.split(np.arange(len(line)), np.flatnonzero(np.diff(np.cumsum(heights) // _MOST_ROWS)) + 1):
        spans = _merged(np.concatenate([spans, *_brush_spans(line[part], ends[part], radius)]))
    if shape == "filled" and len(line) > 2:
        spans = _merged(np.concatenate([spans, _inner_spans(line)]))
    lengths = spans[:, 2] - spans[:, 1]
    count = int(lengths.sum())
    if count > MOST_PIXELS:
        raise ValueError(f"it covers {count} pixels; a stroke must not cover more than {MOST_PIXELS}")
    before = np.cumsum(lengths) - lengths
    columns = np.arange(count) + np.repeat(spans[:, 1] - before, lengths)
    return np.column_stack([columns, np.repeat(spans[:, 0], lengths)]) + 0.5


def stroke_effort(points: ArrayLike, width: float, shape: StrokeShape = "line") -> float:
    """Return an upper bound of the rows and pixels that ``stroke_pixels`` handles, without handling any."""
    line = np.asarray(points, dtype=np.float64).reshape(-1, 2)
    is_closed = shape != "line" and len(line) > 2
    path = np.concatenate([line, line[:1]]) if is_closed else line
    length = float(np.hypot(*np.diff(path, axis=0).T).sum())
    rows = length + len(line) * (width + 4.0)
    brushed = length * (width + 2.0) + (width + 2.0) ** 2
    box = float(np.prod(np.ptp(line, axis=0) + width + 2.0))
    # A closed line of this length encloses no more than a circle does.
    inside = length**2 / (4.0 * math.pi) if is_closed and shape == "filled" else 0.0
    return rows + min(brushed + inside, box)


def _brush_spans(begins: Array, ends: Array, radius: float) -> Iterator[Spans]:
    """Yield the pixels, as ``Spans``, with a centre within ``radius`` of the segments from ``begins`` to ``ends``."""
    low = np.minimum(begins[:, 1], ends[:, 1]) - radius
    high = np.maximum(begins[:, 1], ends[:, 1]) + radius
    first = np.ceil(low - 0.5 - _ROUNDING).astype(np.int64)
    counts = np.maximum(np.floor(high - 0.5 + _ROUNDING).astype(np.int64) - first + 1, 0)
    total, done = int(counts.sum()), np.cumsum(counts) - counts
    # A single segment may be longer than what is handled at a time.
    for start in range(0, total, _MOST_ROWS):
        flat = np.arange(start, min(start + _MOST_ROWS, total))
        which = np.searchsorted(done, flat, side="right") - 1
        rows = first[which] + flat - done[which]
        left, right = _intervals(rows + 0.5, begins[which], ends[which], radius)
        columns = np.ceil(left - 0.5 - _ROUNDING), np.floor(right - 0.5 + _ROUNDING) + 1.0
        hit = columns[0] < columns[1]
        yield np.stack([rows[hit], *(column[hit].astype(np.int64) for column in columns)], axis=1)


def _intervals(y: Array, begins: Array, ends: Array, radius: float) -> tuple[Array, Array]:
    """Return the least and greatest x, (k,), within ``radius`` of each segment at its ``y``, (k,); inf, -inf for none.

    The points near a segment are those near an end, and those beside it, whose offsets along the segment are between 0
    and its length. Together they are convex.
    """
    left, right = np.full(len(y), np.inf), np.full(len(y), -np.inf)
    for x0, y0 in (begins.T, ends.T):
        half = np.sqrt(np.maximum(radius * radius - (y - y0) ** 2, 0.0))
        near = np.abs(y - y0) <= radius
        left = np.where(near, np.minimum(left, x0 - half), left)
        right = np.where(near, np.maximum(right, x0 + half), right)
    dx, dy = (ends - begins).T
    length = np.hypot(dx, dy)
    up = y - begins[:, 1]
    with np.errstate(divide="ignore", invalid="ignore"):
        # |(x - x0) dy - up dx| <= radius length, and 0 <= (x - x0) dx + up dy <= length^2.
        across = [(up * dx + side * radius * length) / dy for side in (-1.0, 1.0)]
        along = [(share * length * length - up * dy) / dx for share in (0.0, 1.0)]
    flat, upright = dy == 0.0, dx == 0.0
    low = np.maximum(np.where(flat, -np.inf, np.minimum(*across)), np.where(upright, -np.inf, np.minimum(*along)))
    high = np.minimum(np.where(flat, np.inf, np.maximum(*across)), np.where(upright, np.inf, np.maximum(*along)))
    beside = (low <= high) & (length > 0.0) & (~flat | (np.abs(up) <= radius))
    beside &= ~upright | ((up * dy >= 0.0) & (up * dy <= length * length))
    left = np.where(beside, np.minimum(left, begins[:, 0] + low), left)
    right = np.where(beside, np.maximum(right, begins[:, 0] + high), right)
    return left, right


def _inner_spans(line: Array) -> Spans:
    """Return the pixels, as ``Spans``, with a centre inside the closed polygon ``line``, by the even-odd rule."""
    begins, ends = line, np.roll(line, -1, axis=0)
    upper, lower = np.minimum(begins[:, 1], ends[:, 1]), np.maximum(begins[:, 1], ends[:, 1])
    # A centre y is crossed by an edge if upper <= y < lower, as in ``enclosed``.
    first = np.ceil(upper - 0.5).astype(np.int64)
    counts = np.maximum(np.ceil(lower - 0.5).astype(np.int64) - first, 0)
    which = np.repeat(np.arange(len(line)), counts)
    rows = np.arange(int(counts.sum())) + np.repeat(first - (np.cumsum(counts) - counts), counts)
    slope = (ends - begins)[which]
    x = begins[which, 0] + (rows + 0.5 - begins[which, 1]) * slope[:, 0] / slope[:, 1]
    order = np.lexsort([x, rows])
    rows, x = rows[order], x[order]
    # Every row is crossed an even number of times.
    columns = np.ceil(x - 0.5).astype(np.int64)
    spans = np.stack([rows[::2], columns[::2], columns[1::2]], axis=1)
    return spans[spans[:, 1] < spans[:, 2]]


def _merged(spans: Spans) -> Spans:
    """Return ``spans`` in order, overlapping and adjacent ones joined."""
    if not len(spans):
        return spans
    spans = spans[np.lexsort([spans[:, 1], spans[:, 0]])]
    rows, first, last = spans.T
    new_row = np.concatenate([[True], rows[1:] != rows[:-1]])
    # The running maximum starts anew in every row, since rows are far apart.
    far = np.cumsum(new_row) * (int(last.max()) - int(first.min()) + 1)
    reached = np.maximum.accumulate(far + last) - far
    begins = np.flatnonzero(new_row | np.concatenate([[True], first[1:] > reached[:-1]]))
    ends = np.concatenate([begins[1:], [len(spans)]]) - 1
    return np.stack([rows[begins], first[begins], reached[ends]], axis=1)


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
