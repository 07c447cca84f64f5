"""The details of a distance."""

from faceposer.gui.context import EditorContext
from faceposer.gui.panels.details.sliders import attribute_slider, weight_slider
from faceposer.gui.widgets.basic import caption
from faceposer.solve.constraints.distance import DistanceConstraint


def draw(context: EditorContext, index: int, constraint: DistanceConstraint) -> None:
    """Draw the distance, as far as this face can do it, and the weight."""
    low, high = constraint.reach(context.session.model)
    limits = (min(low, constraint.target), max(high, constraint.target))
    tip = "Pixels between the two points, as far as this face can do. Ctrl+click to type a value."
    attribute_slider(context, index, "Distance", "target", constraint.target, limits, "%.1f px", tip)
    caption(f"now {constraint.measured(context.session.model, context.session.coefficients):.1f} px")
    weight_slider(context, index, constraint)
