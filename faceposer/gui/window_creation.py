"""Creation of the operating system's window: one GLFW window with an OpenGL 3.3 context, and its place on a monitor."""

import sys
from typing import Any

from imgui_bundle import imgui  # noqa: F401

# The bundle selects the GLFW library that glfw loads, so that both share one; it must be imported first.
# isort: split
import glfw

from faceposer.errors import NoWindowError

Size = tuple[int, int]
Place = tuple[int, int]
SMALLEST: Size = (480, 360)


def create_window(size: Size, hidden: bool) -> Any:
    """Initialise GLFW and return the handle of a window that is not shown yet.

    Args:
        size: Width and height in units of a display at normal density, reduced to the main monitor.
        hidden: Create a window that needs no display.

    Raises:
        NoWindowError: If there is no display, or no OpenGL 3.3.
    """
    glfw.ERROR_REPORTING = "ignore"
    null = hidden and sys.platform.startswith("linux")
    glfw.init_hint(glfw.PLATFORM, glfw.PLATFORM_NULL if null else glfw.ANY_PLATFORM)
    if not glfw.init():
        raise NoWindowError(
            f"No window can be opened ({_last_error()}); set DISPLAY, or run 'faceposer demo', which needs no display."
        )
    glfw.default_window_hints()
    hints: dict[int, Any] = {
        glfw.CONTEXT_VERSION_MAJOR: 3,
        glfw.CONTEXT_VERSION_MINOR: 3,
        glfw.OPENGL_PROFILE: glfw.OPENGL_CORE_PROFILE,
        glfw.OPENGL_FORWARD_COMPAT: True,
        glfw.DEPTH_BITS: 0,
        glfw.STENCIL_BITS: 0,
        glfw.VISIBLE: False,
        glfw.SCALE_TO_MONITOR: True,
    }
    if null:
        hints[glfw.CONTEXT_CREATION_API] = glfw.EGL_CONTEXT_API
    for hint, value in hints.items():
        glfw.window_hint(hint, value)
    for hint in (glfw.X11_CLASS_NAME, glfw.X11_INSTANCE_NAME):
        glfw.window_hint_string(hint, "faceposer")
    if not hidden:
        size = _limited(size)
    handle = glfw.create_window(*size, "Face Poser", None, None)
    if not handle:
        reason = _last_error()
        glfw.terminate()
        raise NoWindowError(
            f"No window with OpenGL 3.3 can be opened ({reason}); update the graphics driver, "
            "or on Debian install libgl1-mesa-dri and libegl1."
        )
    return handle


def _last_error() -> str:
    text: Any = glfw.get_error()[1]
    return text.decode(errors="replace").rstrip(".") if text else "no reason given"


def is_on_monitor(position: Place) -> bool:
    """Return True if a monitor shows the title bar of a window at ``position``."""
    x, y = position[0] + 60, position[1] + 10
    for monitor in glfw.get_monitors():
        left, top, width, height = glfw.get_monitor_workarea(monitor)
        if left <= x < left + width and top <= y < top + height:
            return True
    return False


def _limited(size: Size) -> Size:
    """Return ``size``, reduced to the work area of the main monitor."""
    monitor = glfw.get_primary_monitor()
    if not monitor:
        return size
    _, _, width, height = glfw.get_monitor_workarea(monitor)
    scale = glfw.get_monitor_content_scale(monitor)[0] if sys.platform != "darwin" else 1.0
    room = (int(width / scale), int(height / scale) - 40)
    return (max(min(size[0], room[0]), SMALLEST[0]), max(min(size[1], room[1]), SMALLEST[1]))
