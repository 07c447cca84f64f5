"""The menu bar, drawn from the table of actions."""

from collections.abc import Sequence

from imgui_bundle import imgui

from faceposer.gui.actions import Action, Actions, Submenu
from faceposer.gui.widgets.basic import WidgetRects
from faceposer.gui.widgets.theme import em


def draw_menu_bar(actions: Actions, rects: WidgetRects) -> float:
    """Draw the menu bar at the top of the window and return its height."""
    imgui.push_style_var(imgui.StyleVar_.frame_padding, (em(0.55), em(0.38)))
    shown = imgui.begin_main_menu_bar()
    imgui.pop_style_var()
    if not shown:
        return 0.0
    height = imgui.get_window_height()
    for menu in actions.menus:
        opened = imgui.begin_menu(menu)
        if not opened:
            rects.record(f"menu:{menu}")
            continue
        _draw_items(actions.items(menu), rects)
        imgui.end_menu()
    imgui.end_main_menu_bar()
    return float(height)


def _draw_items(items: Sequence[Action | Submenu], rects: WidgetRects) -> None:
    for item in items:
        if item.separated:
            imgui.separator()
        # Two entries may have the same label.
        imgui.push_id(item.name)
        if isinstance(item, Action):
            on = item.checked is not None and item.checked()
            pressed, _ = imgui.menu_item(item.label, item.shortcut, on, item.enabled())
            rects.record(f"menu:{item.name}")
            if pressed:
                item.run()
        elif imgui.begin_menu(item.label, item.enabled()):
            _draw_items(item.entries(), rects)
            imgui.end_menu()
        else:
            rects.record(f"menu:{item.name}")
        imgui.pop_id()
