"""The View tab, with view directions and display options, and the buttons at the bottom of the side panel."""

from imgui_bundle import imgui

from faceposer.gui.context import EditorContext
from faceposer.gui.widgets.basic import action_button, button_width, choice, heading, tooltip

# Actions with a check box, and its label.
_SWITCHES = (
    ("wireframe", "Wireframe"),
    ("expression-lines", "Expression lines"),
    ("contact", "Contact"),
    ("points", "Show constraints"),
    ("range-marks", "Show range marks"),
)


def draw_view_panel(context: EditorContext) -> None:
    """Draw the View tab."""
    heading(context.fonts, "View from", first=True)
    for row in (("front", "three-quarter", "frame"), ("left", "right", "top")):
        width = button_width(len(row))
        for i, name in enumerate(row):
            if i:
                imgui.same_line()
            label = {"three-quarter": "3/4", "frame": "Frame"}.get(name, name.capitalize())
            action_button(
                context.widget_rects, context.actions[name if name == "frame" else f"view-{name}"], width, label
            )
    heading(context.fonts, "Display")
    key = context.actions["clay"].bracketed_shortcut
    tips = (f"Show textures of skin, eyes and teeth{key}", f"Show plain clay, to judge the form{key}")
    chosen = choice(context.widget_rects, "shading", ("Full", "Clay"), int(context.shading == "clay"), tips)
    context.shading = "clay" if chosen else "full"
    for action, label in _SWITCHES:
        _switch(context, action, label)


def _switch(context: EditorContext, name: str, label: str) -> None:
    """Draw the check box of the action ``name``."""
    action = context.actions[name]
    if imgui.checkbox(label, action.checked is not None and action.checked())[0]:
        action.run()
    context.widget_rects.record(name)
    tooltip(action.tooltip)


def draw_save_buttons(context: EditorContext) -> None:
    """Draw the buttons that save, at the bottom of the side panel."""
    imgui.separator()
    imgui.spacing()
    width = button_width(2)
    action_button(context.widget_rects, context.actions["save"], width, "Save session")
    imgui.same_line()
    action_button(context.widget_rects, context.actions["export"], width, "Save OBJ")
