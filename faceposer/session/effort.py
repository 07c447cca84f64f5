"""Limits on the work that the constraints of a document take."""

from collections.abc import Sequence

from faceposer.errors import FacePoserError
from faceposer.geometry.strokes import MOST_EFFORT, MOST_PIXELS
from faceposer.solve.constraints.curve import CurveConstraint
from faceposer.solve.constraints.registry import Constraint
from faceposer.solve.constraints.sketch import SketchConstraint
from faceposer.solve.constraints.stroke import StrokeConstraint

#: Largest number of strokes, curves and sketches of a document.
MOST_DRAWN = 200
# Maximum effort of all strokes with the energy "image", whose pixels are compared in each step of the solver.
_MOST_IMAGES = 200_000


def check_effort(constraints: Sequence[Constraint]) -> None:
    """Raise a FacePoserError if strokes, curves and sketches are too many, or cover too many pixels, to be solved."""
    drawn = _drawn(constraints)
    if drawn > MOST_DRAWN:
        raise FacePoserError(f"constraints has {drawn} strokes, curves and sketches; there may be {MOST_DRAWN}.")
    if sum(c.effort for c in constraints if isinstance(c, StrokeConstraint)) > MOST_EFFORT:
        raise FacePoserError(f"the strokes of constraints must not cover more than {MOST_PIXELS} pixels together.")
    images = sum(c.image_effort for c in constraints if isinstance(c, StrokeConstraint))
    if images > _MOST_IMAGES:
        raise FacePoserError(
            f'the strokes of constraints with the energy "image" must not cover more than {_MOST_IMAGES // 2} pixels '
            'together; use the energy "distance".'
        )


def check_room(constraints: Sequence[Constraint], added: int) -> None:
    """Raise a FacePoserError if a document with ``constraints`` has no room for ``added`` further strokes."""
    drawn = _drawn(constraints)
    if drawn + added > MOST_DRAWN:
        raise FacePoserError(
            f"The session has {drawn} strokes, curves and sketches, and {added} would be added; there may be "
            f"{MOST_DRAWN}: remove some, or divide the strokes."
        )


def _drawn(constraints: Sequence[Constraint]) -> int:
    return sum(isinstance(c, StrokeConstraint | CurveConstraint | SketchConstraint) for c in constraints)
