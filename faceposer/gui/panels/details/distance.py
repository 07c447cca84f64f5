"""Settings of a distance."""

from faceposer.gui.context import EditorContext
from faceposer.gui.panels.details.sliders import attribute_slider, weight_slider
from faceposer.gui.widgets.basic import caption
from faceposer.solve.constraints.distance import DistanceConstraint


def draw(context: EditorContext, index: int, constraint: DistanceConstraint) -> None:
    """Draw sliders for the distance, within the range of the face, and the weight."""
    low, high = constraint.reach(context.session.model)
    limits = (min(low, constraint.target), max(high, constraint.target))
    tip = "Target distance in pixels, within the range of this face. Ctrl+click to type a value."
    attribute_slider(context, index, "Distance", "target", constraint.target, limits, "%.1f px", tip)
    caption(f"Current: {constraint.measured(context.session.model, context.session.coefficients):.1f} px")
    weight_slider(context, index, constraint)
