"""Shapes of the pointer, by the names that tools and widgets use."""

from typing import Any

from imgui_bundle import imgui

# The bundle selects the GLFW library that glfw loads, so that both share one; it must be imported first.
# isort: split
import glfw

from faceposer.gui.window import Window
from faceposer.tools.toolbox import Toolbox

# First the names of tools (``Toolbox.cursor``), then those of Dear ImGui.
_SHAPES: dict[str, int] = {
    "arrow": glfw.ARROW_CURSOR,
    "grab": glfw.POINTING_HAND_CURSOR,
    "press": glfw.CROSSHAIR_CURSOR,
    "pick": glfw.CROSSHAIR_CURSOR,
    "draw": glfw.CROSSHAIR_CURSOR,
    "paint": glfw.CROSSHAIR_CURSOR,
    "erase": glfw.CROSSHAIR_CURSOR,
    "orbit": glfw.RESIZE_ALL_CURSOR,
    "pan": glfw.RESIZE_ALL_CURSOR,
    "zoom": glfw.RESIZE_NS_CURSOR,
    "forbidden": glfw.NOT_ALLOWED_CURSOR,
    "text_input": glfw.IBEAM_CURSOR,
    "hand": glfw.POINTING_HAND_CURSOR,
    "resize_all": glfw.RESIZE_ALL_CURSOR,
    "resize_ns": glfw.RESIZE_NS_CURSOR,
    "resize_ew": glfw.RESIZE_EW_CURSOR,
    "resize_nesw": glfw.RESIZE_NESW_CURSOR,
    "resize_nwse": glfw.RESIZE_NWSE_CURSOR,
    "not_allowed": glfw.NOT_ALLOWED_CURSOR,
}


def shape_of(name: str) -> int:
    """Return GLFW's standard cursor for ``name``, an arrow for an unknown name."""
    return _SHAPES.get(name, glfw.ARROW_CURSOR)


class Cursors:
    """The pointer of a window.

    Attributes:
        shown: Name of the present shape.
    """

    def __init__(self, window: Window) -> None:
        """Control the pointer of ``window`` in place of Dear ImGui, which has no cross-hair."""
        io = imgui.get_io()
        io.config_flags |= imgui.ConfigFlags_.no_mouse_cursor_change.value
        self._window = window
        self._created: dict[int, Any] = {}
        self.shown = "arrow"

    def update(self, toolbox: Toolbox) -> None:
        """Show the pointer of ``toolbox`` over the view and during gestures, otherwise that of the widgets."""
        in_view = toolbox.active or toolbox.hover is not None
        name: str = toolbox.cursor if in_view else str(imgui.MouseCursor_(imgui.get_mouse_cursor()).name)
        if name == self.shown:
            return
        self.shown = name
        shape = shape_of(name)
        if shape not in self._created:
            # None if the system's theme lacks it; the window then shows an arrow.
            self._created[shape] = glfw.create_standard_cursor(shape)
        self._window.set_cursor(self._created[shape])
