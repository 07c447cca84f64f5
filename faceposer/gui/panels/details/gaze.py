"""Settings of a gaze constraint."""

from dataclasses import replace

from faceposer.gui.context import EditorContext
from faceposer.gui.panels.details.sliders import value_slider
from faceposer.solve.constraints.gaze import MOST_PITCH, MOST_YAW, GazeConstraint


def draw(context: EditorContext, index: int, constraint: GazeConstraint) -> None:
    """Draw the two angles; gaze is always met exactly and needs no weight."""
    for axis, (title, most) in enumerate((("Left", MOST_YAW), ("Up", MOST_PITCH))):
        key = f"gaze:{axis}"

        def changed_to(value: float, axis: int = axis) -> GazeConstraint:
            yaw, pitch = constraint.direction
            return replace(constraint, direction=(yaw, value) if axis else (value, pitch))

        value_slider(context, index, title, key, constraint.direction[axis], (-most, most), "%.0f deg", changed_to)
