"""A GLFW window with an OpenGL context and Dear ImGui: what the system sends becomes pointer events."""

import os
import ctypes
import platform
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

# imgui_bundle brings a GLFW library that pyGLFW must share, so it has to come first.
from imgui_bundle import imgui  # isort: skip
import glfw
import moderngl

from faceposer.errors import FacePoserError
from faceposer.tools.tool import Button, EventKind, PointerEvent

Size = tuple[int, int]
_BUTTONS: dict[int, Button] = {
    glfw.MOUSE_BUTTON_LEFT: "left",
    glfw.MOUSE_BUTTON_MIDDLE: "middle",
    glfw.MOUSE_BUTTON_RIGHT: "right",
}
_MODIFIERS = ((glfw.MOD_SHIFT, "shift"), (glfw.MOD_CONTROL, "ctrl"), (glfw.MOD_ALT, "alt"))


class Window:
    """The system's window. Positions are in its own units, pixels nearly everywhere, from its top left.

    Pointer samples are kept as they come, with their times, so that a slow frame loses none of a stroke.
    """

    def __init__(self, title: str, size: Size, headless: bool = False) -> None:
        """Open a window of ``size``; ``headless`` opens one without a display, for tests and the demo.

        Raises:
            FacePoserError: If there is no display, or no OpenGL 3.3.
        """
        self.headless = headless
        self.events: list[PointerEvent] = []
        self.dropped: list[Path] = []
        self.focus_lost = False
        self.problem: Exception | None = None
        self.on_refresh: Callable[[], None] | None = None
        self._held: Button | None = None
        self._modifiers: frozenset[str] = frozenset()
        self._position = (0.0, 0.0)
        self._handle = self._create(title, size)
        glfw.make_context_current(self._handle)
        if not headless:
            glfw.swap_interval(1)
        try:
            self.ctx = moderngl.create_context(require=330)
        except Exception as error:  # glcontext raises plain Exception
            glfw.terminate()
            raise FacePoserError(f"OpenGL 3.3 is not to be had here ({error}); update the graphics driver.") from error
        self.software = any(name in self.ctx.info["GL_RENDERER"].lower() for name in ("llvmpipe", "softpipe", "swrast"))
        self._listen()
        imgui.create_context()
        imgui.get_io().set_ini_filename("")
        imgui.backends.glfw_init_for_opengl(self.address, True)
        imgui.backends.opengl3_init("#version 330")

    def _create(self, title: str, size: Size) -> Any:
        failure = "no reason given"
        with _quiet():
            if self.headless:
                glfw.init_hint(glfw.PLATFORM, glfw.PLATFORM_NULL)
            else:
                glfw.init_hint(glfw.PLATFORM, glfw.ANY_PLATFORM)
            if not glfw.init():
                failure = _last_error()
                raise FacePoserError(f"No window can be opened here ({failure}); set DISPLAY, or use 'faceposer demo'.")
            glfw.window_hint(glfw.CONTEXT_VERSION_MAJOR, 3)
            glfw.window_hint(glfw.CONTEXT_VERSION_MINOR, 3)
            glfw.window_hint(glfw.OPENGL_PROFILE, glfw.OPENGL_CORE_PROFILE)
            glfw.window_hint(glfw.OPENGL_FORWARD_COMPAT, True)
            glfw.window_hint(glfw.SCALE_TO_MONITOR, True)
            if self.headless:
                glfw.window_hint(glfw.CONTEXT_CREATION_API, glfw.EGL_CONTEXT_API)
            handle = glfw.create_window(*size, title, None, None)
            if not handle:
                failure = _last_error()
                glfw.terminate()
                raise FacePoserError(
                    f"No window with OpenGL 3.3 can be opened here ({failure}); update the graphics driver."
                )
        return handle

    @property
    def address(self) -> int:
        """Where the C side finds the window."""
        address = ctypes.cast(self._handle, ctypes.c_void_p).value
        assert address is not None
        return address

    # What the system sends

    def _listen(self) -> None:
        """Set our callbacks; Dear ImGui chains its own before them."""
        glfw.set_cursor_pos_callback(self._handle, self._guarded(self._cursor_moved))
        glfw.set_mouse_button_callback(self._handle, self._guarded(self._button_changed))
        glfw.set_scroll_callback(self._handle, self._guarded(self._scrolled))
        glfw.set_cursor_enter_callback(self._handle, self._guarded(lambda *_: None))
        glfw.set_window_focus_callback(self._handle, self._guarded(self._focus_changed))
        glfw.set_drop_callback(self._handle, self._guarded(self._files_dropped))
        glfw.set_key_callback(self._handle, self._guarded(self._key_changed))
        glfw.set_char_callback(self._handle, self._guarded(lambda *_: None))
        glfw.set_window_refresh_callback(self._handle, self._guarded(self._refresh))

    def _guarded(self, callback: Callable[..., None]) -> Callable[..., None]:
        """Return ``callback`` with its exceptions kept: GLFW would drop every event after one."""

        def safe(*arguments: object) -> None:
            try:
                callback(*arguments)
            except Exception as error:  # whatever it is, the frame loop must hear of it
                self.problem = error

        return safe

    def _add(self, kind: EventKind, button: Button | None, wheel: float = 0.0) -> None:
        self.events.append(
            PointerEvent(kind, self._position, button, self._modifiers, time.perf_counter(), wheel=wheel)
        )

    def _cursor_moved(self, _window: object, x: float, y: float) -> None:
        self._position = (x, y)
        self._add("hover" if self._held is None else "move", self._held)

    def _button_changed(self, _window: object, button: int, action: int, modifiers: int) -> None:
        name = _BUTTONS.get(button)
        self._modifiers = frozenset(text for bit, text in _MODIFIERS if modifiers & bit)
        if name is None:
            return
        if action == glfw.PRESS:
            if self._held is None:
                self._held = name
                self._add("press", name)
        elif name == self._held:
            self._held = None
            self._add("release", name)

    def _key_changed(self, _window: object, _key: int, _code: int, _action: int, modifiers: int) -> None:
        self._modifiers = frozenset(text for bit, text in _MODIFIERS if modifiers & bit)

    def _scrolled(self, _window: object, _x: float, y: float) -> None:
        self._add("wheel", None, wheel=y)

    def _focus_changed(self, _window: object, focused: int) -> None:
        if not focused:
            self.focus_lost = True

    def _files_dropped(self, _window: object, paths: list[str]) -> None:
        self.dropped += [Path(path) for path in paths]

    def _refresh(self, _window: object) -> None:
        if self.on_refresh is not None:
            self.on_refresh()

    def take_events(self) -> list[PointerEvent]:
        """Return the pointer events since the last call."""
        events, self.events = self.events, []
        return events

    def let_go(self) -> None:
        """Forget a button that is held, as when another window takes the pointer."""
        self._held = None

    # State

    @property
    def size(self) -> Size:
        """Width and height in the units of positions."""
        width, height = glfw.get_window_size(self._handle)
        return int(width), int(height)

    @property
    def framebuffer_size(self) -> Size:
        """Width and height in pixels."""
        width, height = glfw.get_framebuffer_size(self._handle)
        return int(width), int(height)

    @property
    def ui_scale(self) -> float:
        """How large a control must be, relative to a display of normal density, in the units of positions."""
        scale = float(glfw.get_window_content_scale(self._handle)[0])
        pixels_per_unit = self.framebuffer_size[0] / max(self.size[0], 1)
        return max(scale / max(pixels_per_unit, 1e-3), 0.5) if scale > 0 else 1.0

    @property
    def visible(self) -> bool:
        """Whether there is anything to draw into."""
        return not glfw.get_window_attrib(self._handle, glfw.ICONIFIED) and min(self.framebuffer_size) > 0

    @property
    def close_requested(self) -> bool:
        """Whether the user has asked to close the window."""
        return bool(glfw.window_should_close(self._handle))

    def request_close(self, wanted: bool = True) -> None:
        """Ask to close the window, or take that back."""
        glfw.set_window_should_close(self._handle, wanted)

    def set_title(self, title: str) -> None:
        """Show ``title`` in the window's frame."""
        glfw.set_window_title(self._handle, title)

    def set_size(self, size: Size) -> None:
        """Resize the window."""
        glfw.set_window_size(self._handle, *size)

    def wait(self, seconds: float) -> None:
        """Sleep until something happens, at most ``seconds``; 0 looks without sleeping."""
        if seconds > 0:
            glfw.wait_events_timeout(seconds)
        else:
            glfw.poll_events()

    @staticmethod
    def wake() -> None:
        """End a sleep in ``wait``, from any thread."""
        glfw.post_empty_event()

    def begin_frame(self) -> None:
        """Begin a frame of Dear ImGui."""
        imgui.backends.opengl3_new_frame()
        imgui.backends.glfw_new_frame()
        imgui.new_frame()

    def end_frame(self) -> None:
        """Draw Dear ImGui over what the window's framebuffer holds and show it."""
        imgui.render()
        width, height = self.framebuffer_size
        self.ctx.screen.use()
        self.ctx.viewport = (0, 0, width, height)
        self.ctx.screen.clear(0.02, 0.02, 0.02, 1.0)
        imgui.backends.opengl3_render_draw_data(imgui.get_draw_data())
        glfw.swap_buffers(self._handle)

    def close(self) -> None:
        """Free everything, in the order that the libraries want."""
        imgui.backends.opengl3_shutdown()
        imgui.backends.glfw_shutdown()
        imgui.destroy_context()
        self.ctx.release()
        glfw.destroy_window(self._handle)
        glfw.terminate()


def display_available() -> bool:
    """Whether this system can be expected to show a window."""
    if platform.system() != "Linux":
        return True
    return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


@contextmanager
def _quiet() -> Iterator[None]:
    """Silence pyGLFW's own warnings of errors that are told here in their own sentence."""
    before: Any = glfw.ERROR_REPORTING
    glfw.ERROR_REPORTING = False  # type: ignore[assignment]
    try:
        yield
    finally:
        glfw.ERROR_REPORTING = before


def _last_error() -> str:
    text: Any = glfw.get_error()[1]
    return text.decode(errors="replace") if isinstance(text, bytes) else str(text or "no reason given")
