"""Drags that change one constraint and its mirror image, as one step of the history."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from faceposer.solve.constraints.registry import Constraint
from faceposer.solve.constraints.sketch import SketchConstraint
from faceposer.solve.constraints.stroke import StrokeConstraint
from faceposer.tools.symmetry import Mirroring
from faceposer.tools.tool import Gesture, PointerEvent, ToolContext, ToolSettings


def drag_constraint(
    index: int,
    changed: Callable[[NDArray[np.float64]], Constraint],
    label: str,
    event: PointerEvent,
    context: ToolContext,
    tool_settings: ToolSettings,
    begun: Constraint | None = None,
) -> Gesture:
    """Replace constraint ``index`` with each move of the pointer; without a move, the gesture leaves no step.

    Args:
        index: Index of the constraint, which becomes the selection.
        changed: Returns the constraint for an offset of the pointer from the press, in pixels of the view, shape (2,).
        label: Name of the step.
        event: The press.
        context: The view and its session.
        tool_settings: Selection and symmetry.
        begun: Constraint that replaces the present one at once, which is a step without a move, too.
    """
    # on press
    session, press = context.session, event.position
    tool_settings.selection.set(index)
    with session.edit(label):
        mirroring = Mirroring(tool_settings.symmetry, session)
        if begun is not None:
            session.replace(session.document.with_constraint(index, begun))
        moved = begun is not None
        while True:
            event = yield
            # on release
            if event.kind == "release":
                break
            # on move
            moved = True
            document = session.document.with_constraint(index, changed(np.subtract(event.position, press)))
            session.replace(mirroring.with_images(document, [index]))
        if not moved:
            session.restore()


def drag_drawn(
    index: int, label: str, event: PointerEvent, context: ToolContext, tool_settings: ToolSettings
) -> Gesture:
    """Move what is drawn of the stroke or sketch ``index`` by the motion of the pointer."""
    begun = context.session.document.constraints[index]
    assert isinstance(begun, StrokeConstraint | SketchConstraint)
    scale = begun.camera.focal / context.camera.focal

    def moved_by(offset: NDArray[np.float64]) -> Constraint:
        du, dv = (offset * scale).tolist()
        return begun.nudged((du, dv))

    return drag_constraint(index, moved_by, label, event, context, tool_settings)
