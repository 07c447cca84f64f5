"""The details of a stroke."""

from dataclasses import replace

from imgui_bundle import imgui

from faceposer.gui.context import EditorContext
from faceposer.gui.panels.details.sliders import weight_slider
from faceposer.gui.widgets.basic import choice, tooltip
from faceposer.solve.constraints.stroke import STROKE_ENERGIES, StrokeConstraint


def draw(context: EditorContext, index: int, constraint: StrokeConstraint) -> None:
    """Draw the button that redraws the target, the energy and the weight."""
    if imgui.button("Redraw the target", (-1.0, 0.0)) and not context.busy:
        context.toolbox.choose("stroke")
        context.toolbox.stroke_tool.redraw(constraint)
    context.widget_rects.record("redraw")
    tooltip("The next stroke becomes its target; the source stays")
    tips = ("Distances both ways between the strokes.", "The difference of two images, as in the paper of 2009.")
    before = STROKE_ENERGIES.index(constraint.energy)
    chosen = choice(context.widget_rects, "stroke-energy", ("Distance", "Image"), before, tips)
    if chosen != before and not context.busy:
        changed = replace(constraint, energy=STROKE_ENERGIES[chosen])
        context.session.change_constraint(index, changed, "Compare strokes differently")
    weight_slider(context, index, constraint)
