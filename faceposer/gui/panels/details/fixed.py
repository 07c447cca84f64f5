"""Settings of a fixed area."""

from faceposer.gui.context import EditorContext
from faceposer.gui.panels.details.sliders import attribute_slider
from faceposer.gui.widgets.basic import caption
from faceposer.solve.constraints.fixed import FixedConstraint

LARGEST_HOLD = 1000.0


def draw(context: EditorContext, index: int, constraint: FixedConstraint) -> None:
    """Draw the number of vertices and a slider for the weight."""
    caption(f"{len(constraint.points)} fixed vertices")
    tip, limits = "How strongly the vertices are held in place, from 0 (free) upwards.", (0.0, LARGEST_HOLD)
    attribute_slider(context, index, "Hold", "weight", constraint.weight, limits, "%.2f", tip, logarithmic=True)
