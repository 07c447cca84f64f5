"""The window of the operating system: one GLFW window with OpenGL 3.3, and everything that happens to it as events.

Events are collected in GLFW's callbacks, each with its own time, and taken once per frame: however slow a frame is, no
sample of a gesture is lost.
"""

import ctypes
import sys
import time
from collections.abc import Callable
from typing import Any, Literal

import moderngl
from imgui_bundle import imgui

# The bundle tells glfw which GLFW library to load, so that both share one; it must come first.
# isort: split
import glfw

from faceposer.errors import NoWindowError
from faceposer.gui.events import (
    Changed,
    CloseRequest,
    Drop,
    Event,
    FocusLost,
    Key,
    Modifiers,
    Pointer,
    PointerKind,
)
from faceposer.render.mesh_buffers import drawn_by_processor
from faceposer.tools.tool import Button

Size = tuple[int, int]
Place = tuple[int, int]
SMALLEST: Size = (480, 360)
# Notches of the wheel that move nothing.
_NO_TURN = 1e-12

_BUTTONS: dict[int, Button] = {
    glfw.MOUSE_BUTTON_LEFT: "left",
    glfw.MOUSE_BUTTON_MIDDLE: "middle",
    glfw.MOUSE_BUTTON_RIGHT: "right",
}
_MODIFIER_KEYS = {
    glfw.KEY_LEFT_SHIFT: "shift",
    glfw.KEY_RIGHT_SHIFT: "shift",
    glfw.KEY_LEFT_CONTROL: "ctrl",
    glfw.KEY_RIGHT_CONTROL: "ctrl",
    glfw.KEY_LEFT_ALT: "alt",
    glfw.KEY_RIGHT_ALT: "alt",
}
_MODIFIERS_OF_GUI = {"shift": imgui.Key.mod_shift, "ctrl": imgui.Key.mod_ctrl, "alt": imgui.Key.mod_alt}
if sys.platform == "darwin":
    # Shortcuts are with Command there.
    _MODIFIER_KEYS |= {glfw.KEY_LEFT_SUPER: "ctrl", glfw.KEY_RIGHT_SUPER: "ctrl"}
_KEY_NAMES: dict[int, str] = {
    **{glfw.KEY_A + i: chr(ord("A") + i) for i in range(26)},
    **{glfw.KEY_0 + i: str(i) for i in range(10)},
    **{glfw.KEY_KP_0 + i: str(i) for i in range(10)},
    **{glfw.KEY_F1 + i: f"F{i + 1}" for i in range(12)},
    glfw.KEY_ESCAPE: "Esc",
    glfw.KEY_ENTER: "Enter",
    glfw.KEY_KP_ENTER: "Enter",
    glfw.KEY_SPACE: "Space",
    glfw.KEY_DELETE: "Delete",
    glfw.KEY_BACKSPACE: "Backspace",
    glfw.KEY_TAB: "Tab",
    glfw.KEY_LEFT: "Left",
    glfw.KEY_RIGHT: "Right",
    glfw.KEY_UP: "Up",
    glfw.KEY_DOWN: "Down",
    glfw.KEY_LEFT_BRACKET: "[",
    glfw.KEY_RIGHT_BRACKET: "]",
    glfw.KEY_COMMA: ",",
    glfw.KEY_PERIOD: ".",
    glfw.KEY_HOME: "Home",
    glfw.KEY_END: "End",
}
_KEY_CODES = {name: code for code, name in reversed(_KEY_NAMES.items())}


class Window:
    """A window, its OpenGL context and its events.

    Attributes:
        zoom: The user's factor on the size of everything but the face.
    """

    def __init__(
        self, size: Size, hidden: bool = False, position: Place | None = None, maximized: bool = False
    ) -> None:
        """Open a window of ``size`` in units of a display at normal density.

        Args:
            size: Width and height.
            hidden: Open it where nobody sees it and no display is needed: for tests and the demo.
            position: Of its top left corner on the desktop; None, or one that no monitor shows, for the system's.
            maximized: Let it fill the monitor; ``size`` and ``position`` are those of the window that is not maximized.

        Raises:
            NoWindowError: If there is no display, or no OpenGL 3.3.
        """
        self._events: list[Event] = []
        self._failure: Exception | None = None
        self._modifiers: Modifiers = frozenset()
        self._position = (0.0, 0.0)
        self._callbacks: list[Any] = []
        self.title = "Face Poser"
        # What stamps events; who plays them may bring a clock of its own.
        self.clock: Callable[[], float] = time.perf_counter
        self.zoom = 1.0
        self._handle = _open(size, hidden)
        self.address = int(ctypes.cast(self._handle, ctypes.c_void_p).value or 0)
        glfw.make_context_current(self._handle)
        try:
            self.ctx = moderngl.create_context(require=330)
        except Exception as error:  # glcontext raises plain Exception
            glfw.terminate()
            raise NoWindowError(f"OpenGL 3.3 is not to be had here ({error}); update the graphics driver.") from error
        self._alive = True
        self._hidden = hidden
        glfw.swap_interval(0 if hidden else 1)
        if not hidden:
            glfw.set_window_size_limits(self._handle, *SMALLEST, glfw.DONT_CARE, glfw.DONT_CARE)
        if position is not None and _on_a_monitor(position):
            glfw.set_window_pos(self._handle, *position)
        self._normal: tuple[Size, Place] = (self.size, glfw.get_window_pos(self._handle))
        if maximized:
            glfw.maximize_window(self._handle)
        self._listen()

    @property
    def maximized(self) -> bool:
        """Whether it fills the monitor."""
        return bool(glfw.get_window_attrib(self._handle, glfw.MAXIMIZED))

    @property
    def normal_size(self) -> Size:
        """Its size when it was last neither maximized nor minimised, in units of a display at normal density."""
        scale = max(self.display_scale, 0.1)
        width, height = self._normal[0]
        return (round(width / scale), round(height / scale))

    @property
    def normal_position(self) -> Place:
        """Likewise, where its top left corner was on the desktop."""
        return self._normal[1]

    def _note_place(self) -> None:
        if self.maximized or glfw.get_window_attrib(self._handle, glfw.ICONIFIED) or min(self.size) <= 0:
            return
        self._normal = (self.size, glfw.get_window_pos(self._handle))

    @property
    def modifiers(self) -> Modifiers:
        """Of "shift", "ctrl" and "alt", those that are held."""
        return self._modifiers

    @property
    def software(self) -> bool:
        """Whether the processor draws, not a graphics card."""
        return drawn_by_processor(self.ctx)

    @property
    def size(self) -> Size:
        """Width and height in window units, in which the pointer is measured."""
        return glfw.get_window_size(self._handle)

    @property
    def pixels(self) -> Size:
        """Width and height of the framebuffer."""
        return glfw.get_framebuffer_size(self._handle)

    @property
    def ui_scale(self) -> float:
        """How many window units something takes that takes one on a display at normal density at a zoom of 1."""
        return self.display_scale * self.zoom

    @property
    def display_scale(self) -> float:
        """How many window units the display takes for one at normal density."""
        scale: float = glfw.get_window_content_scale(self._handle)[0]
        return min(max(scale * self.size[0] / max(self.pixels[0], 1), 0.5), 4.0) if self.size[0] else 1.0

    @property
    def drawable(self) -> bool:
        """Whether there is anything to see: it is neither minimised nor without area."""
        return min(self.pixels) > 0 and not glfw.get_window_attrib(self._handle, glfw.ICONIFIED)

    def set_title(self, title: str) -> None:
        """Show ``title`` in the title bar."""
        if title != self.title:
            self.title = title
            glfw.set_window_title(self._handle, title)

    def set_size(self, size: Size) -> None:
        """Resize the window."""
        glfw.set_window_size(self._handle, *size)

    def set_cursor(self, cursor: Any) -> None:
        """Show the pointer as ``cursor`` of GLFW, None for the arrow."""
        glfw.set_cursor(self._handle, cursor)

    def show(self) -> None:
        """Make the window visible."""
        glfw.show_window(self._handle)

    def swap(self) -> None:
        """Show what was drawn."""
        glfw.swap_buffers(self._handle)
        if self._hidden:
            # No screen limits the number of frames: the driver would queue dozens, with tens of megabytes for each.
            self.ctx.finish()

    # Events

    def wait(self, seconds: float) -> None:
        """Sleep until something happens, at most ``seconds``."""
        if seconds > 0.0 and not self._events:
            glfw.wait_events_timeout(seconds)
        else:
            glfw.poll_events()

    def wake(self) -> None:
        """End the sleep; may be called from any thread."""
        if self._alive:
            glfw.post_empty_event()

    def take_events(self) -> list[Event]:
        """Return what has happened since the last call, oldest first.

        Raises:
            Exception: Whatever went wrong in a callback, where it could not be told.
        """
        events, self._events = self._events, []
        failure, self._failure = self._failure, None
        if failure is not None:
            raise failure
        return events

    def _listen(self) -> None:
        def guarded(handler: Callable[..., None]) -> Callable[..., None]:
            def call(_window: Any, *arguments: Any) -> None:
                try:
                    handler(*arguments)
                except Exception as error:  # an exception must not travel through the C library
                    self._failure = error

            self._callbacks.append(call)
            return call

        window = self._handle
        glfw.set_cursor_pos_callback(window, guarded(self._on_move))
        glfw.set_mouse_button_callback(window, guarded(self._on_button))
        glfw.set_scroll_callback(window, guarded(self._on_scroll))
        glfw.set_cursor_enter_callback(window, guarded(self._on_enter))
        glfw.set_key_callback(window, guarded(self._on_key))
        glfw.set_char_callback(window, guarded(lambda _code: self._add(Changed())))
        glfw.set_drop_callback(window, guarded(lambda paths: self._add(Drop(tuple(paths)))))
        glfw.set_window_focus_callback(window, guarded(self._on_focus))
        glfw.set_window_close_callback(window, guarded(self._on_close))
        for place_register in (glfw.set_window_size_callback, glfw.set_window_pos_callback):
            place_register(window, guarded(lambda *_values: self._note_place()))
        for register in (
            glfw.set_framebuffer_size_callback,
            glfw.set_window_content_scale_callback,
            glfw.set_window_refresh_callback,
            glfw.set_window_iconify_callback,
        ):
            register(window, guarded(lambda *_values: self._add(Changed())))

    def _add(self, event: Event) -> None:
        self._events.append(event)

    def _pointer(self, kind: PointerKind, button: Button | None = None, wheel: float = 0.0) -> None:
        self._add(Pointer(kind, self._position, button, self._modifiers, self.clock(), wheel))

    def _on_move(self, x: float, y: float) -> None:
        self._position = (x, y)
        self._pointer("move")

    def _on_button(self, button: int, action: int, modifiers: int) -> None:
        self._set_modifiers(modifiers)
        if action == glfw.RELEASE and any(isinstance(e, Pointer) and e.kind == "move" for e in self._events):
            # Dear ImGui lets a slider go where it was in the frame before if the last move and the release come in one
            # frame. After any turn of the wheel, however small, it leaves the release to the next frame.
            imgui.get_io().add_mouse_wheel_event(0.0, _NO_TURN)
        if button in _BUTTONS:
            self._pointer("press" if action == glfw.PRESS else "release", _BUTTONS[button])

    def _on_scroll(self, _across: float, along: float) -> None:
        self._pointer("wheel", wheel=along)

    def _on_enter(self, entered: int) -> None:
        if not entered:
            self._pointer("leave")

    def _on_key(self, code: int, scancode: int, action: int, modifiers: int) -> None:
        self._set_modifiers(modifiers)
        if code in _MODIFIER_KEYS:
            # Whether the modifier's own key is part of ``modifiers`` depends on the system.
            changed = {_MODIFIER_KEYS[code]}
            self._modifiers = self._modifiers - changed if action == glfw.RELEASE else self._modifiers | changed
            self._add(Changed())
            return
        name = _KEY_NAMES.get(code)
        if glfw.KEY_A <= code <= glfw.KEY_Z:
            here = glfw.get_key_name(code, scancode)
            name = here.upper() if here and len(here) == 1 and "a" <= here.lower() <= "z" else name
        if name is None:
            self._add(Changed())
            return
        kind: dict[int, Literal["press", "repeat", "release"]]
        kind = {glfw.PRESS: "press", glfw.REPEAT: "repeat", glfw.RELEASE: "release"}
        self._add(Key(kind[action], name, self._modifiers, self.clock()))

    def _set_modifiers(self, bits: int) -> None:
        control = glfw.MOD_CONTROL | (glfw.MOD_SUPER if sys.platform == "darwin" else 0)
        names = {"shift": glfw.MOD_SHIFT, "ctrl": control, "alt": glfw.MOD_ALT}
        self._modifiers = frozenset(name for name, bit in names.items() if bits & bit)

    def _on_focus(self, focused: int) -> None:
        if not focused:
            self._modifiers = frozenset()
            self._add(FocusLost())
        self._add(Changed())

    def _on_close(self) -> None:
        glfw.set_window_should_close(self._handle, False)
        self._add(CloseRequest())

    # Played events, for tests and the demo: they take the way of real ones, through Dear ImGui's backend

    def play_move(self, x: float, y: float) -> None:
        """Act as if the pointer had moved to (x, y)."""
        imgui.backends.glfw_cursor_enter_callback(self.address, 1)
        imgui.backends.glfw_cursor_pos_callback(self.address, x, y)

    def play_button(self, button: Button, pressed: bool, modifiers: Modifiers = frozenset()) -> None:
        """Act as if a button had gone down or come up."""
        code = next(code for code, name in _BUTTONS.items() if name == button)
        if not modifiers:
            imgui.backends.glfw_mouse_button_callback(self.address, code, int(pressed), 0)
            return
        # The backend asks the keyboard which modifiers are held, and nobody plays at that.
        io = imgui.get_io()
        self._on_button(code, glfw.PRESS if pressed else glfw.RELEASE, _bits(modifiers))
        for name in modifiers:
            io.add_key_event(_MODIFIERS_OF_GUI[name], pressed)
        io.add_mouse_button_event(code, pressed)

    def play_wheel(self, notches: float) -> None:
        """Act as if the wheel had turned."""
        imgui.backends.glfw_scroll_callback(self.address, 0.0, notches)

    def play_key(self, name: str, kind: Literal["press", "repeat", "release"], modifiers: Modifiers) -> None:
        """Act as if the key ``name`` had gone down, repeated or come up."""
        action = {"press": glfw.PRESS, "repeat": glfw.REPEAT, "release": glfw.RELEASE}[kind]
        imgui.backends.glfw_key_callback(self.address, _KEY_CODES[name], 0, action, _bits(modifiers))

    def play_text(self, text: str) -> None:
        """Act as if ``text`` had been typed."""
        for character in text:
            imgui.backends.glfw_char_callback(self.address, ord(character))

    def play_event(self, event: Event) -> None:
        """Act as if ``event`` had arrived from the window system."""
        self._add(event)

    def close(self) -> None:
        """Close the window and end GLFW; what was made in the context must be released before."""
        self._alive = False
        self.ctx.release()
        glfw.destroy_window(self._handle)
        glfw.terminate()


def _bits(modifiers: Modifiers) -> int:
    bits = {"shift": glfw.MOD_SHIFT, "ctrl": glfw.MOD_CONTROL, "alt": glfw.MOD_ALT}
    return sum(bits[name] for name in modifiers)


def _open(size: Size, hidden: bool) -> Any:
    """Start GLFW and return a window that is not shown yet."""
    glfw.ERROR_REPORTING = "ignore"
    null = hidden and sys.platform.startswith("linux")
    glfw.init_hint(glfw.PLATFORM, glfw.PLATFORM_NULL if null else glfw.ANY_PLATFORM)
    if not glfw.init():
        raise NoWindowError(
            f"No window can be opened here ({_last_error()}); set DISPLAY, or use 'faceposer demo', which needs none."
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
        size = _fitting(size)
    handle = glfw.create_window(*size, "Face Poser", None, None)
    if not handle:
        reason = _last_error()
        glfw.terminate()
        raise NoWindowError(
            f"No window with OpenGL 3.3 can be opened here ({reason}); update the graphics driver, "
            "or on Debian install libgl1-mesa-dri and libegl1."
        )
    return handle


def _last_error() -> str:
    text: Any = glfw.get_error()[1]
    return text.decode(errors="replace").rstrip(".") if text else "no reason given"


def _on_a_monitor(position: Place) -> bool:
    """Whether some monitor shows the title bar of a window at ``position``."""
    x, y = position[0] + 60, position[1] + 10
    for monitor in glfw.get_monitors():
        left, top, width, height = glfw.get_monitor_workarea(monitor)
        if left <= x < left + width and top <= y < top + height:
            return True
    return False


def _fitting(size: Size) -> Size:
    """Return ``size``, at most what the main monitor has room for."""
    monitor = glfw.get_primary_monitor()
    if not monitor:
        return size
    _, _, width, height = glfw.get_monitor_workarea(monitor)
    scale = glfw.get_monitor_content_scale(monitor)[0] if sys.platform != "darwin" else 1.0
    room = (int(width / scale), int(height / scale) - 40)
    return (max(min(size[0], room[0]), SMALLEST[0]), max(min(size[1], room[1]), SMALLEST[1]))
