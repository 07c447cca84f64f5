"""The panel's last tab: where one looks from, and how the face is drawn."""

from typing import TYPE_CHECKING

from imgui_bundle import imgui

from faceposer.viewer.panels.widgets import action_button, button_width, choice, heading, tooltip

if TYPE_CHECKING:
    from faceposer.viewer.app import App


def draw_view_panel(app: "App") -> None:
    """Draw the part."""
    heading(app.gui.fonts, "Look from", first=True)
    for row in (("front", "three-quarter", "frame"), ("left", "right", "top")):
        width = button_width(len(row))
        for i, name in enumerate(row):
            if i:
                imgui.same_line()
            label = {"three-quarter": "3/4", "frame": "Frame"}.get(name, name.capitalize())
            action_button(app.marks, app.actions[name if name == "frame" else f"view-{name}"], width, label)
    heading(app.gui.fonts, "Drawing")
    key = app.actions["clay"].shortcut
    tips = (f"Skin, eyes and teeth as they are  ({key})", f"Plain clay, to judge the shape  ({key})")
    chosen = choice(app.marks, "shading", ("Full", "Clay"), int(app.shading == "clay"), tips)
    app.shading = "clay" if chosen else "full"
    _, app.wireframe = imgui.checkbox("Wireframe", app.wireframe)
    app.marks.note("wireframe")
    tooltip(app.actions["wireframe"].tooltip)
    action = app.actions["expression-lines"]
    if imgui.checkbox("Expression lines", app.settings.expression_lines)[0]:
        action.run()
    app.marks.note("expression-lines")
    tooltip(action.tooltip)
    changed, _ = imgui.checkbox("Contact", app.session.document.contact)
    app.marks.note("contact")
    tooltip(app.actions["contact"].tooltip)
    if changed:
        app.actions["contact"].run()
    _, app.points_shown = imgui.checkbox("Show constraints", app.points_shown)
    app.marks.note("points-shown")
    tooltip(app.actions["points"].tooltip)
    marks = app.actions["range-marks"]
    if imgui.checkbox("Show range marks", app.settings.range_marks)[0]:
        marks.run()
    app.marks.note("range-marks")
    tooltip(marks.tooltip)


def draw_output_panel(app: "App") -> None:
    """Draw the foot of the panel: what one takes away."""
    imgui.separator()
    imgui.spacing()
    width = button_width(2)
    action_button(app.marks, app.actions["save"], width, "Save session")
    imgui.same_line()
    action_button(app.marks, app.actions["export"], width, "Save OBJ")
