"""Polylines in an image: lengths, even samples, places at a share of the length."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from faceposer.geometry.strokes import resampled, smoothed
from faceposer.sketch.recognition import DrawnStroke

Array = NDArray[np.float64]

# Points of a stroke that are used; longer ones are thinned out evenly.
_MOST_POINTS = 2000
# Spacing of the points of a smoothed stroke, and reach of the smoothing, in units of the hand.
_STEP, _TREMOR = 2.0, 4.0


def cleaned(pixels: ArrayLike) -> Array:
    """Return the finite points of a stroke, shape (n, 2), without repetitions and at most 2000 of them."""
    points = np.asarray(pixels, dtype=np.float64).reshape(-1, 2)
    points = points[np.isfinite(points).all(axis=1) & (np.abs(points) < 1e7).all(axis=1)]
    if len(points) > _MOST_POINTS:
        points = points[np.linspace(0, len(points) - 1, _MOST_POINTS).round().astype(np.intp)]
    if len(points) > 1:
        moved = np.ones(len(points), dtype=bool)
        moved[1:] = (points[1:] != points[:-1]).any(axis=1)
        points = points[moved]
    return points


def lengths_along(points: Array) -> Array:
    """Return the length of the polyline ``points``, (n, d), up to each of them, shape (n,)."""
    steps = np.sqrt((np.diff(points, axis=0) ** 2).sum(axis=1))
    return np.concatenate([[0.0], np.cumsum(steps)])


def at_lengths(points: Array, along: Array, lengths: ArrayLike) -> Array:
    """Return the places, (m, d), of ``lengths``, (m,), on the polyline ``points`` of lengths ``along``, (n,)."""
    return np.stack([np.interp(np.asarray(lengths, dtype=np.float64), along, axis) for axis in points.T], axis=1)


def evenly(points: Array, count: int) -> Array:
    """Return ``count`` points evenly spaced along the polyline ``points``, shape (count, d)."""
    along = lengths_along(points)
    return at_lengths(points, along, np.linspace(0.0, along[-1], count))


def untidiness(stroke: DrawnStroke, unit: float, samples: Array) -> tuple[float, float]:
    """Return by how much ``stroke`` is more than its ``samples`` show: 0 for a stroke along a smooth curve.

    Args:
        stroke: The stroke.
        unit: The unit of the hand in its pixels.
        samples: Even samples of its line, (n, 2).

    Returns:
        The logarithm of the length of its line as a multiple of that through the samples, and the root mean square of
        the offsets, across and along, that smoothing removes, in units of the hand.
    """
    points = (cleaned(stroke.pixels) - stroke.camera.principal_point) / unit
    length = float(lengths_along(points)[-1])
    step = max(_STEP, length / _MOST_POINTS)
    raw, line = resampled(points, step), smoothed(points, step=step, reach=_TREMOR)
    count = min(len(raw), len(line))
    offsets = float(np.sqrt(((raw[:count] - line[:count]) ** 2).sum(axis=1).mean()))
    lengths = float(lengths_along(line)[-1]), float(lengths_along(samples)[-1])
    return float(np.log(max(lengths[0], 1e-9) / max(lengths[1], 1e-9))), offsets


def stroke_line(stroke: DrawnStroke, unit: float) -> Array:
    """Return ``stroke`` without the tremor of the hand, in units about the principal point, shape (n, 2).

    Args:
        stroke: The stroke.
        unit: The unit of the hand in its pixels.
    """
    points = (cleaned(stroke.pixels) - stroke.camera.principal_point) / unit
    if len(points) < 2:
        return points
    length = float(lengths_along(points)[-1])
    return smoothed(points, step=max(_STEP, length / _MOST_POINTS), reach=_TREMOR)
