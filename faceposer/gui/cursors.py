"""The pointer's shape: tools and widgets name what a press would do, and here is what it looks like."""

from typing import Any

from imgui_bundle import imgui

# The bundle tells glfw which GLFW library to load, so that both share one; it must come first.
# isort: split
import glfw

from faceposer.gui.window import Window
from faceposer.tools.toolbox import Toolbox

# The first group are names that tools use (``Toolbox.cursor``), the second what widgets ask for.
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
    """Return GLFW's standard cursor for ``name``, an arrow for a name that nobody has given a shape."""
    return _SHAPES.get(name, glfw.ARROW_CURSOR)


class Cursors:
    """Shows one shape at a time.

    Attributes:
        shown: Name of the present shape.
    """

    def __init__(self, window: Window) -> None:
        """Take the shape over from Dear ImGui, which has no cross-hair; its wishes are still met."""
        io = imgui.get_io()
        io.config_flags |= imgui.ConfigFlags_.no_mouse_cursor_change.value
        self._window = window
        self._made: dict[int, Any] = {}
        self.shown = "arrow"

    def follow(self, toolbox: Toolbox) -> None:
        """Show what ``toolbox`` names while the pointer is in the view or a gesture goes on, else what widgets want."""
        in_view = toolbox.active or toolbox.hover is not None
        name: str = toolbox.cursor if in_view else str(imgui.MouseCursor_(imgui.get_mouse_cursor()).name)
        if name == self.shown:
            return
        self.shown = name
        shape = shape_of(name)
        if shape not in self._made:
            # None, where the system's theme lacks it: then the window shows its arrow.
            self._made[shape] = glfw.create_standard_cursor(shape)
        self._window.set_cursor(self._made[shape])
