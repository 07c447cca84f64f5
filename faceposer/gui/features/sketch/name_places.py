"""Places of names beside strokes, off the features of the face, where the next strokes are drawn."""

from collections.abc import Collection

import numpy as np
from numpy.typing import NDArray

from faceposer.gui.widgets.widget_rects import overlap

Array = NDArray[np.float64]
#: Left, top, right and bottom.
Box = tuple[float, float, float, float]

# Most distances outwards and rows up or down that are tried, and what a row costs in pixels outwards.
_OUTWARDS, _ROWS, _ROW_COST = 30, 7, 1.5
# Most rows by which a name is moved from the end of its line towards the line's mean height.
_LEANING = 1.5
# What a place above the name of a line that is higher costs, in rows.
_ORDER_COST = 4.0


def box_of_name(
    line: Array,
    size: tuple[float, float],
    view: tuple[float, float],
    leftwards: bool,
    obstacles: Array,
    gap: float,
    taken: Collection[Box],
) -> Box | None:
    """Return the box of a name beside the outer end of ``line``: the nearest that covers nothing.

    Args:
        line: The stroke, shape (n, 2).
        size: Width and height of the name.
        view: Width and height of the view.
        leftwards: True if outwards is to the left.
        obstacles: Points of strokes and features, shape (m, 2), that the box keeps ``gap`` away from.
        gap: Distance in pixels.
        taken: Boxes of the names of higher lines.

    Returns:
        The box; None if the end is outside the view. If every place covers something, the one that covers least.
    """
    (wide, tall), (width, height) = view, size
    end = outer_end(line, leftwards)
    if not (0.0 <= end[0] <= wide and 0.0 <= end[1] <= tall):
        return None
    outwards, rows = np.meshgrid(gap * np.arange(1, _OUTWARDS + 1), np.arange(-_ROWS, _ROWS + 1), indexing="ij")
    lefts = end[0] - width - outwards if leftwards else end[0] + outwards
    lefts = np.clip(lefts, 0.0, max(wide - width, 0.0)).ravel()
    # Lines that meet at a corner, as lips and lids do, get their names in the order of the lines.
    middle = end[1] + np.clip(line[:, 1].mean() - end[1], -_LEANING * height, _LEANING * height)
    tops = np.clip(middle - height / 2.0 + rows * (height + 1.0), 0.0, max(tall - height, 0.0)).ravel()
    cost = (outwards + _ROW_COST * height * np.abs(rows)).ravel().astype(np.float64)
    for other in taken:
        beside = (lefts < other[2] + width) & (lefts + width > other[0] - width)
        cost += _ORDER_COST * height * (beside & (tops < other[1]))
    u, v = obstacles[:, 0], obstacles[:, 1]
    # Only those near the rows can be covered.
    near = np.abs(v - middle) < (_ROWS + 2) * (height + 1.0) + gap
    u, v = u[near], v[near]
    covers_column = (u > lefts[:, None] - gap) & (u < lefts[:, None] + width + gap)
    covers_row = (v > tops[:, None] - 0.5 * gap) & (v < tops[:, None] + height + 0.5 * gap)
    covered = (covers_column & covers_row).sum(axis=1)
    best: Box | None = None
    for i in np.lexsort((cost, covered)).tolist():
        box = (float(lefts[i]), float(tops[i]), float(lefts[i] + width), float(tops[i] + height))
        if not any(overlap(box, other) for other in taken):
            return box
        if best is None:
            best = box
    return best


def outer_end(line: Array, leftwards: bool) -> Array:
    """Return the outermost point of ``line``, (n, 2), at its left if ``leftwards``, shape (2,)."""
    return np.asarray(line[np.argmin(line[:, 0])] if leftwards else line[np.argmax(line[:, 0])])


def leader(box: Box, end: Array, shortest: float) -> tuple[tuple[float, float], tuple[float, float]] | None:
    """Return the line from the name in ``box`` to the ``end`` of its stroke, or None if they are close.

    Args:
        box: The box.
        end: Outer end of the stroke, shape (2,).
        shortest: Distance from which a line is drawn.
    """
    x, y = float(end[0]), float(end[1])
    distance = distance_to_box(box, (x, y))
    if distance < shortest:
        return None
    begin = (min(max(x, box[0]), box[2]), 0.5 * (box[1] + box[3]))
    if box[0] < x < box[2]:
        begin = (begin[0], box[1] if y < box[1] else box[3])
    return begin, (x, y)


def distance_to_box(box: Box, position: tuple[float, float]) -> float:
    """Return the distance of ``position`` from ``box``, 0 inside."""
    dx = max(box[0] - position[0], 0.0, position[0] - box[2])
    dy = max(box[1] - position[1], 0.0, position[1] - box[3])
    return float(np.hypot(dx, dy))
