"""Watches every widget that the window draws: ids that two widgets share, and the lines that draw widgets."""

import ast
import sys
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from imgui_bundle import imgui

import faceposer.gui

GUI = Path(faceposer.gui.__file__).parent
# Functions of Dear ImGui that draw a widget whose id follows from their first argument.
WIDGETS = tuple(
    name
    for name in dir(imgui)
    if name.startswith(("slider_", "drag_float", "drag_int", "input_", "v_slider_", "color_edit", "color_picker"))
    or name
    in (
        "button",
        "small_button",
        "invisible_button",
        "image_button",
        "arrow_button",
        "checkbox",
        "radio_button",
        "selectable",
        "combo",
        "begin_combo",
        "list_box",
        "begin_list_box",
        "begin_menu",
        "menu_item",
        "menu_item_simple",
        "begin_tab_bar",
        "begin_tab_item",
        "tab_item_button",
        "tree_node",
        "tree_node_ex",
        "collapsing_header",
        "begin_child",
        "color_button",
    )
)
Site = tuple[str, int]


class WidgetIds:
    """The widgets of each frame by their ids.

    Attributes:
        conflicts: Of each pair of widgets that shared an id in some frame, where they are drawn and their labels.
        visited: The lines that have drawn a widget so far, as file (relative to the package) and number.
    """

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        """Watch all widgets that are drawn until ``monkeypatch`` is undone."""
        self.conflicts: set[tuple[str, ...]] = set()
        self.visited: set[Site] = set()
        self._frame: list[tuple[int, str]] = []
        for name in WIDGETS:
            monkeypatch.setattr(imgui, name, self._watched(getattr(imgui, name)))
        render = imgui.render

        def ended() -> None:
            self._end_frame()
            render()

        monkeypatch.setattr(imgui, "render", ended)

    def _watched(self, draw: Callable[..., Any]) -> Callable[..., Any]:
        def watched(label: str, *rest: Any, **options: Any) -> Any:
            caller = sys._getframe(1)
            path = Path(caller.f_code.co_filename)
            if path.is_relative_to(GUI):
                site = (path.relative_to(GUI).as_posix(), caller.f_lineno)
                self.visited.add(site)
                self._frame.append((imgui.get_id(label), f"{site[0]}:{site[1]} {label}"))
            return draw(label, *rest, **options)

        return watched

    def _end_frame(self) -> None:
        widgets, self._frame = self._frame, []
        twice = {item for item, count in Counter(item for item, _ in widgets).items() if count > 1}
        for item in twice:
            self.conflicts.add(tuple(sorted(where for other, where in widgets if other == item)))


def widget_lines() -> dict[Site, range]:
    """Return the calls in the package that draw widgets, by file and first line, with all of their lines."""
    found: dict[Site, range] = {}
    for path in sorted(GUI.rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if not isinstance(node, ast.Call) or not isinstance(node.func, ast.Attribute):
                continue
            owner = node.func.value
            if isinstance(owner, ast.Name) and owner.id == "imgui" and node.func.attr in WIDGETS:
                where = (path.relative_to(GUI).as_posix(), node.lineno)
                found[where] = range(node.lineno, (node.end_lineno or node.lineno) + 1)
    return found


def hovered_conflicts() -> int:
    """Return how many other widgets shared the id of the hovered one in the last frame, by Dear ImGui's own count."""
    context: Any = imgui.get_current_context()
    return max(int(context.hovered_id_previous_frame_item_count) - 1, 0)
