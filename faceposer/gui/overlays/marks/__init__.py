"""Marks of constraints in the view, one module per kind, registered in ``MARKS``.

A kind without an entry is drawn as dots at its points. Point constraints are drawn as pins (``overlays/pins.py``).
"""

from faceposer.gui.overlays.marks import curve, distance, fixed, gaze, sketch, stroke
from faceposer.gui.overlays.marks.mark import Mark, MarkMaker, MarkView
from faceposer.solve.constraints.registry import Constraint

__all__ = ["MARKS", "Mark", "MarkMaker", "MarkView", "mark_of", "painted_order"]

MARKS: dict[str, MarkMaker | None] = {
    "point": None,
    "fixed": fixed.mark_of,
    "stroke": stroke.mark_of,
    "sketch": sketch.mark_of,
    "curve": curve.mark_of,
    "distance": distance.mark_of,
    "gaze": gaze.mark_of,
}


def mark_of(index: int, constraint: Constraint, view: MarkView) -> Mark | None:
    """Return the mark of ``constraint`` in ``view``, or None if it has none."""
    make = MARKS.get(constraint.kind, fixed.points_mark_of)
    return None if make is None else make(index, constraint, view)


def painted_order(kind: str) -> int:
    """Return the rank of a ``kind`` in the drawing order, from back to front."""
    kinds = list(MARKS)
    return kinds.index(kind) if kind in MARKS else 0
