"""Settings of a stroke."""

from dataclasses import replace

from imgui_bundle import imgui

from faceposer.gui.context import EditorContext
from faceposer.gui.panels.details.sliders import weight_slider
from faceposer.gui.widgets.basic import choice, tooltip
from faceposer.solve.constraints.stroke import STROKE_ENERGIES, StrokeConstraint

#: Tooltips of the energies, in the order of ``STROKE_ENERGIES``.
ENERGY_TIPS = (
    "Distances between the strokes in both directions; suits large and small movements.",
    "The difference of two images, as in Lau et al. 2009.",
)


def draw(context: EditorContext, index: int, constraint: StrokeConstraint) -> None:
    """Draw the button for a new target, the energy and the weight."""
    if imgui.button("Redraw the target", (-1.0, 0.0)) and not context.busy:
        context.toolbox.choose("stroke")
        context.toolbox.stroke_tool.redraw(constraint)
    context.widget_rects.record("redraw")
    tooltip("The next stroke replaces the target; the source is kept")
    before = STROKE_ENERGIES.index(constraint.energy)
    chosen = choice(context.widget_rects, "stroke-energy", ("Distance", "Image"), before, ENERGY_TIPS)
    if chosen != before and not context.busy:
        changed = replace(constraint, energy=STROKE_ENERGIES[chosen])
        context.session.change_constraint(index, changed, "Change the energy of a stroke")
    weight_slider(context, index, constraint)
