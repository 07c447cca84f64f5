"""Settings of the selected constraint, one module per kind; a kind without an entry in ``DETAILS`` has a weight."""

from collections.abc import Callable
from typing import Any

from imgui_bundle import imgui

from faceposer.gui.context import EditorContext
from faceposer.gui.panels.details import distance, fixed, gaze, sketch, stroke
from faceposer.gui.panels.details.sliders import weight_slider
from faceposer.gui.widgets.theme import WARNING
from faceposer.gui.widgets.tooltips import tooltip

DETAILS: dict[str, Callable[[EditorContext, int, Any], None]] = {
    "distance": distance.draw,
    "stroke": stroke.draw,
    "sketch": sketch.draw,
    "fixed": fixed.draw,
    "gaze": gaze.draw,
}


def draw_details(context: EditorContext, index: int) -> None:
    """Draw the settings of constraint ``index``."""
    constraint = context.session.document.constraints[index]
    imgui.push_id(f"constraint {index}")
    conflict = context.drawn_constraints.conflicts.get(index)
    if conflict is not None:
        imgui.push_style_color(imgui.Col_.text, imgui.ImVec4(*WARNING))
        imgui.text_wrapped(conflict)
        imgui.pop_style_color()
    imgui.begin_disabled(constraint.locked or context.toolbox.active)
    DETAILS.get(constraint.kind, weight_slider)(context, index, constraint)
    imgui.end_disabled()
    if constraint.camera is not None and constraint.camera.transferred((0.0, 0.0), context.viewport.camera) is None:
        if imgui.button("Go to its view", (-1.0, 0.0)):
            context.viewport.look_through(constraint.camera)
        context.widget_rects.record("its-view")
        tooltip("Return to the view in which it was drawn, where its target can be changed")
    imgui.pop_id()
