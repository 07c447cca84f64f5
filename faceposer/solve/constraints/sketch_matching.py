"""Correspondence of the curve of a feature and a stroke that depicts it.

Matched feature points divide curve and stroke into pieces, within which both correspond in proportion to their lengths
in the image, the curve's on the neutral face. A nearest point on the stroke would depend on the pose, and would let a
curve shrink into a part of the stroke. Beyond the outermost matched points the scale of the adjacent piece continues
until the stroke or the feature ends.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from faceposer.geometry.strokes import resampled, smoothed

Array = NDArray[np.float64]
Ids = NDArray[np.intp]

# Spacing of the points of a cleaned stroke in pixels, and their largest number.
_STEP, _MOST = 2.0, 400
# Largest gap between the ends of a closed stroke, as a share of its length.
_GAP = 0.25
# Least and largest scale of the stroke against the curve beyond the matched points.
_SCALES = (0.5, 2.0)


@dataclass(frozen=True, eq=False)
class Correspondence:
    """Points of a curve with their places on a stroke.

    Attributes:
        indices: Indices of the points, shape (m,).
        places: Their places on the stroke, shape (m, 2).
        tangents: Unit tangents of the stroke there, in the direction of the curve, shape (m, 2).
        used: Parameters of the matched points that are in order, shape (k,).
    """

    indices: Ids
    places: Array
    tangents: Array
    used: Ids


def cleaned(stroke: Array, closed: bool) -> Array:
    """Return the polyline ``stroke``, (n, 2), evenly spaced and without tremor, (m, 2).

    Args:
        stroke: Points in the order of drawing.
        closed: True if it depicts a closed feature; its ends are then connected if they are near each other.

    Raises:
        ValueError: If the stroke has no length.
    """
    length = float(np.hypot(*np.diff(stroke, axis=0).T).sum())
    if not length > 1e-6:
        raise ValueError("its stroke has no length")
    step = max(_STEP, length / _MOST)
    if closed and float(np.hypot(*(stroke[-1] - stroke[0]))) <= _GAP * length:
        line = smoothed(stroke, closed=True, step=step)
        if len(line) > 2:
            return np.concatenate([line, line[:1]])
    line = smoothed(stroke, step=step)
    line = line if len(line) > 1 else resampled(stroke[[0, -1]], step)
    if len(line) < 2:
        # It goes back and forth on one spot.
        raise ValueError("its stroke has no length")
    return line


def correspondence(
    pixels: Array, parameters: Array, closed: bool, line: Array, matched: Mapping[int, Array]
) -> Correspondence:
    """Return the correspondence of a curve and a stroke.

    Matched points that are out of order along the stroke are not used.

    Args:
        pixels: The curve on the neutral face in the image, shape (m, 2); a closed one ends where it begins.
        parameters: Parameters of its points, i at the i-th feature point, shape (m,).
        closed: True if the curve is closed.
        line: The stroke as ``cleaned`` returns it, shape (n, 2).
        matched: Pixel of each matched feature point by its parameter, each of shape (2,).
    """
    lengths = np.hypot(*np.diff(pixels, axis=0).T)
    # Pieces along the line of sight have no length in the image.
    curve = np.concatenate([[0.0], np.cumsum(lengths + 1e-3 + 1e-3 * lengths.mean())])
    knots = np.array(sorted(matched))
    at = np.interp(knots, parameters, curve)
    count = len(curve) - 1 if closed else len(curve)
    best, order = None, (-1, 0.0)
    for way in (line, line[::-1]):
        along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(way, axis=0).T))])
        on_line = np.array([_nearest(way, along, matched[knot]) for knot in knots.tolist()])
        round_trip = closed and bool((way[0] == way[-1]).all())
        for kept, begins, ends in _monotone(at, on_line, curve[-1] if closed else None, along[-1], round_trip):
            found = _spread(curve, count, along[-1], begins, ends, closed, round_trip)
            places = np.stack([np.interp(found[1], along, axis) for axis in way.T], axis=1)
            # Of two orders of as many points, as with a single one, the stroke's shape decides.
            offsets = places - pixels[found[0]]
            spread = float(((offsets - offsets.mean(axis=0)) ** 2).sum(axis=1).mean()) if len(offsets) else np.inf
            if (len(kept), -spread) > order or best is None:
                order = (len(kept), -spread)
                best = Correspondence(found[0], places, _tangents(way, along, found[1]), knots[kept])
    assert best is not None
    return best


def distances(points: Array, line: Array) -> Array:
    """Return the distances of ``points``, (m, 2), from the polyline ``line``, (n, 2), shape (m,)."""
    # Matrix products take a third of the time of vectors for every pair. Their rounding errors grow with the distance
    # from the origin.
    origin = line[0]
    points, begins, steps = points - origin, line[:-1] - origin, np.diff(line, axis=0)
    squared = np.maximum(np.einsum("nk,nk->n", steps, steps), 1e-12)
    along = points @ steps.T - np.einsum("nk,nk->n", begins, steps)
    share = np.minimum(np.maximum(along / squared, 0.0), 1.0)
    gaps = share * (share * squared - 2.0 * along) - 2.0 * (points @ begins.T)
    gaps += np.einsum("nk,nk->n", begins, begins)
    nearest = gaps.min(axis=1) + np.einsum("mk,mk->m", points, points)
    return np.asarray(np.sqrt(np.maximum(nearest, 0.0)))


def _nearest(line: Array, along: Array, pixel: Array) -> float:
    """Return the length along the polyline ``line``, (n, 2), of its point nearest to ``pixel``."""
    steps = np.diff(line, axis=0)
    squared = np.maximum((steps * steps).sum(axis=1), 1e-12)
    share = np.clip(((pixel - line[:-1]) * steps).sum(axis=1) / squared, 0.0, 1.0)
    best = int(np.argmin(((line[:-1] + share[:, None] * steps - pixel) ** 2).sum(axis=1)))
    return float(along[best] + share[best] * (along[best + 1] - along[best]))


def _monotone(
    at: Array, on_line: Array, period: float | None, length: float, round_trip: bool
) -> Iterator[tuple[Ids, Array, Array]]:
    """Yield the points in order, and lengths along the curve and along the stroke, for each way to order them.

    Args:
        at: Lengths along the curve of the matched points, ascending, shape (k,).
        on_line: Their lengths along the stroke, shape (k,).
        period: Length of a closed curve, else None.
        length: Length of the stroke.
        round_trip: True if the stroke is closed.
    """
    for base in range(len(at)) if period is not None else (0,):
        begins, ends = at.copy(), on_line.copy()
        if period is not None:
            begins = at[base] + (at - at[base]) % period
        if round_trip:
            ends = (on_line - on_line[base]) % length + on_line[base]
        order = np.lexsort([begins, ends])
        begins, ends = begins[order], ends[order]
        kept = _longest_increasing(begins, ends)
        begins, ends, kept = begins[kept], ends[kept], order[kept]
        if period is not None and round_trip:
            begins, ends = np.append(begins, begins[0] + period), np.append(ends, ends[0] + length)
        yield kept, begins, ends


def _longest_increasing(begins: Array, ends: Array) -> Ids:
    """Return the indices of the longest subsequence in which both ``begins`` and ``ends``, (k,), increase."""
    chains: list[list[int]] = []
    for i in range(len(begins)):
        before = [c for c in chains if begins[c[-1]] < begins[i] - 1e-9 and ends[c[-1]] < ends[i] - 1e-9]
        chains.append([*max(before, key=len, default=[]), i])
    return np.array(max(chains, key=len), dtype=np.intp)


def _spread(
    curve: Array, count: int, length: float, begins: Array, ends: Array, closed: bool, round_trip: bool
) -> tuple[Ids, Array]:
    """Return the indices of the curve's points that correspond to the stroke, (m,), and lengths along it, (m,)."""
    scales = np.diff(ends) / np.diff(begins) if len(begins) > 1 else np.ones(1)
    first, last = np.clip(scales[[0, -1]], *_SCALES)
    indices = np.arange(count)
    if closed:
        # The curve's points that precede the first matched one come after the last.
        places = begins[0] + (curve[:count] - begins[0]) % curve[-1]
        if not round_trip:
            # The remaining points belong to the nearer end.
            beyond = places > begins[-1]
            behind = beyond & (places - begins[-1] > begins[0] + curve[-1] - places)
            places = np.where(behind, places - curve[-1], places)
    else:
        places = curve
    found = np.interp(places, begins, ends)
    found = np.where(places < begins[0], ends[0] - first * (begins[0] - places), found)
    found = np.where(places > begins[-1], ends[-1] + last * (places - begins[-1]), found)
    if round_trip:
        return indices, found % length
    inside = (found >= -1e-9) & (found <= length + 1e-9)
    return indices[inside], found[inside]


def _tangents(line: Array, along: Array, at: Array) -> Array:
    """Return the unit tangents of the polyline ``line``, (n, 2), at the lengths ``at``, shape (m, 2)."""
    slopes = np.gradient(line, along, axis=0) if len(line) > 2 else np.repeat(np.diff(line, axis=0), 2, axis=0)
    if (line[0] == line[-1]).all() and len(line) > 3:
        slopes[[0, -1]] = slopes[0] + slopes[-1]
    found = np.stack([np.interp(at, along, axis) for axis in slopes.T], axis=1)
    lengths = np.hypot(found[:, 0], found[:, 1])[:, None]
    return np.where(lengths > 1e-9, found / np.maximum(lengths, 1e-9), (1.0, 0.0))
