"""The panel's last tab: where one looks from, and how the face is drawn."""

from imgui_bundle import imgui

from faceposer.gui.context import EditorContext
from faceposer.gui.widgets.basic import action_button, button_width, choice, heading, tooltip


def draw_view_panel(context: EditorContext) -> None:
    """Draw the part."""
    heading(context.fonts, "Look from", first=True)
    for row in (("front", "three-quarter", "frame"), ("left", "right", "top")):
        width = button_width(len(row))
        for i, name in enumerate(row):
            if i:
                imgui.same_line()
            label = {"three-quarter": "3/4", "frame": "Frame"}.get(name, name.capitalize())
            action_button(
                context.widget_rects, context.actions[name if name == "frame" else f"view-{name}"], width, label
            )
    heading(context.fonts, "Drawing")
    key = context.actions["clay"].shortcut
    tips = (f"Skin, eyes and teeth as they are  ({key})", f"Plain clay, to judge the shape  ({key})")
    chosen = choice(context.widget_rects, "shading", ("Full", "Clay"), int(context.shading == "clay"), tips)
    context.shading = "clay" if chosen else "full"
    _, context.wireframe = imgui.checkbox("Wireframe", context.wireframe)
    context.widget_rects.record("wireframe")
    tooltip(context.actions["wireframe"].tooltip)
    action = context.actions["expression-lines"]
    if imgui.checkbox("Expression lines", context.settings.expression_lines)[0]:
        action.run()
    context.widget_rects.record("expression-lines")
    tooltip(action.tooltip)
    changed, _ = imgui.checkbox("Contact", context.session.document.contact)
    context.widget_rects.record("contact")
    tooltip(context.actions["contact"].tooltip)
    if changed:
        context.actions["contact"].run()
    _, context.points_shown = imgui.checkbox("Show constraints", context.points_shown)
    context.widget_rects.record("points-shown")
    tooltip(context.actions["points"].tooltip)
    marks = context.actions["range-marks"]
    if imgui.checkbox("Show range marks", context.settings.range_marks)[0]:
        marks.run()
    context.widget_rects.record("range-marks")
    tooltip(marks.tooltip)


def draw_output_panel(context: EditorContext) -> None:
    """Draw the foot of the panel: what one takes away."""
    imgui.separator()
    imgui.spacing()
    width = button_width(2)
    action_button(context.widget_rects, context.actions["save"], width, "Save session")
    imgui.same_line()
    action_button(context.widget_rects, context.actions["export"], width, "Save OBJ")
