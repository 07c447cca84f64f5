"""The marks of constraints over the view, one file a kind; ``MARKS`` has the maker of each.

A kind without a line here appears as dots at its points. Points themselves are drawn as pins (``overlays/pins.py``).
"""

from faceposer.gui.overlays.marks import curve, distance, fixed, gaze, stroke
from faceposer.gui.overlays.marks.mark import Mark, MarkMaker, MarkView
from faceposer.solve.constraints.registry import Constraint

__all__ = ["MARKS", "Mark", "MarkMaker", "MarkView", "mark_of", "painted_order"]

MARKS: dict[str, MarkMaker | None] = {
    "point": None,
    "fixed": fixed.mark_of,
    "stroke": stroke.mark_of,
    "curve": curve.mark_of,
    "distance": distance.mark_of,
    "gaze": gaze.mark_of,
}


def mark_of(index: int, constraint: Constraint, view: MarkView) -> Mark | None:
    """Return how ``constraint`` appears in ``view``, or None where it has no mark."""
    make = MARKS.get(constraint.kind, fixed.points_mark_of)
    return None if make is None else make(index, constraint, view)


def painted_order(kind: str) -> int:
    """Return the place of a ``kind`` in the order of drawing, from what lies below to what lies above."""
    kinds = list(MARKS)
    return kinds.index(kind) if kind in MARKS else 0
