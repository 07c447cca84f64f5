"""The details of a fixed area."""

from faceposer.gui.context import EditorContext
from faceposer.gui.panels.details.sliders import attribute_slider
from faceposer.gui.widgets.basic import caption
from faceposer.solve.constraints.fixed import FixedConstraint

LARGEST_HOLD = 1000.0


def draw(context: EditorContext, index: int, constraint: FixedConstraint) -> None:
    """Draw how many vertices are held, and how firmly."""
    caption(f"{len(constraint.points)} vertices, held where they were")
    tip, limits = "From free, at 0, to immovable.", (0.0, LARGEST_HOLD)
    attribute_slider(context, index, "Hold", "weight", constraint.weight, limits, "%.2f", tip, logarithmic=True)
