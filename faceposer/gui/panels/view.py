"""The panel's last tab: where one looks from, and how the face is drawn."""

from imgui_bundle import imgui

from faceposer.gui.context import EditorContext
from faceposer.gui.widgets.basic import action_button, button_width, choice, heading, tooltip

# Actions that have a box, and its label.
_SWITCHES = (
    ("wireframe", "Wireframe"),
    ("expression-lines", "Expression lines"),
    ("contact", "Contact"),
    ("points", "Show constraints"),
    ("range-marks", "Show range marks"),
)


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
    for action, label in _SWITCHES:
        _switch(context, action, label)


def _switch(context: EditorContext, name: str, label: str) -> None:
    """Draw the box of the action ``name``, which is on or off."""
    action = context.actions[name]
    if imgui.checkbox(label, action.checked is not None and action.checked())[0]:
        action.run()
    context.widget_rects.record(name)
    tooltip(action.tooltip)


def draw_output_panel(context: EditorContext) -> None:
    """Draw the foot of the panel: what one takes away."""
    imgui.separator()
    imgui.spacing()
    width = button_width(2)
    action_button(context.widget_rects, context.actions["save"], width, "Save session")
    imgui.same_line()
    action_button(context.widget_rects, context.actions["export"], width, "Save OBJ")
