"""The menus, drawn from the table of actions."""

from imgui_bundle import imgui

from faceposer.viewer.actions import Actions
from faceposer.viewer.panels.widgets import Marks
from faceposer.viewer.theme import em


def draw_menu_bar(actions: Actions, marks: Marks) -> float:
    """Draw the bar along the top of the window and return its height."""
    imgui.push_style_var(imgui.StyleVar_.frame_padding, (em(0.55), em(0.38)))
    shown = imgui.begin_main_menu_bar()
    imgui.pop_style_var()
    if not shown:
        return 0.0
    height = imgui.get_window_height()
    for menu in actions.menus:
        opened = imgui.begin_menu(menu)
        if not opened:
            marks.note(f"menu:{menu}")
            continue
        for action in actions.in_menu(menu):
            if action.separated:
                imgui.separator()
            on = action.checked is not None and action.checked()
            pressed, _ = imgui.menu_item(action.label, action.shortcut, on, action.enabled())
            marks.note(f"menu:{action.name}")
            if pressed:
                action.run()
        imgui.end_menu()
    imgui.end_main_menu_bar()
    return float(height)
