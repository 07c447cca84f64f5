"""The operating system's window, with OpenGL 3.3, and its events.

GLFW's callbacks collect events with their times, and the loop takes them once per frame: a slow frame loses no sample
of a gesture.
"""

import ctypes
import sys
import time
from collections.abc import Callable
from typing import Any, Literal

import moderngl
from imgui_bundle import imgui

# The bundle selects the GLFW library that glfw loads, so that both share one; it must be imported first.
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
from faceposer.gui.key_names import BUTTONS, KEY_CODES, KEY_NAMES, MODIFIER_KEYS, MODIFIERS_OF_IMGUI, modifier_bits
from faceposer.gui.window_creation import SMALLEST, Place, Size, create_window, is_on_monitor
from faceposer.render.mesh_buffers import is_software_renderer
from faceposer.tools.tool import Button

# A turn of the wheel too small to scroll.
_NO_TURN = 1e-12


class Window:
    """A window, its OpenGL context and its events.

    Attributes:
        zoom: Scale of the interface chosen by the user.
    """

    def __init__(
        self, size: Size, hidden: bool = False, position: Place | None = None, maximized: bool = False
    ) -> None:
        """Open a window of ``size`` in units of a display at normal density.

        Args:
            size: Width and height.
            hidden: Open an invisible window, which needs no display, for tests and the demo.
            position: Top left corner on the desktop; the system's choice if None, or if no monitor shows it.
            maximized: Maximize it; ``size`` and ``position`` apply once it is restored.

        Raises:
            NoWindowError: If there is no display, or no OpenGL 3.3.
        """
        self._events: list[Event] = []
        self._failure: Exception | None = None
        self._modifiers: Modifiers = frozenset()
        self._position = (0.0, 0.0)
        self._callbacks: list[Any] = []
        self.title = "Face Poser"
        # Time of events; a scripted user may replace it.
        self.clock: Callable[[], float] = time.perf_counter
        self.zoom = 1.0
        self._handle = create_window(size, hidden)
        self.address = int(ctypes.cast(self._handle, ctypes.c_void_p).value or 0)
        glfw.make_context_current(self._handle)
        try:
            self.ctx = moderngl.create_context(require=330)
        except Exception as error:  # glcontext raises plain Exception
            glfw.terminate()
            raise NoWindowError(f"OpenGL 3.3 is not available ({error}); update the graphics driver.") from error
        self._alive = True
        glfw.swap_interval(0 if hidden else 1)
        if not hidden:
            glfw.set_window_size_limits(self._handle, *SMALLEST, glfw.DONT_CARE, glfw.DONT_CARE)
        if position is not None and is_on_monitor(position):
            glfw.set_window_pos(self._handle, *position)
        self._normal: tuple[Size, Place] = (self.size, glfw.get_window_pos(self._handle))
        if maximized:
            glfw.maximize_window(self._handle)
        self._listen()

    @property
    def maximized(self) -> bool:
        """True if the window is maximized."""
        return bool(glfw.get_window_attrib(self._handle, glfw.MAXIMIZED))

    @property
    def normal_size(self) -> Size:
        """Size of the restored window, neither maximized nor minimised, in units of a display at normal density."""
        scale = max(self.display_scale, 0.1)
        width, height = self._normal[0]
        return (round(width / scale), round(height / scale))

    @property
    def normal_position(self) -> Place:
        """Top left corner of the restored window on the desktop."""
        return self._normal[1]

    def _record_place(self) -> None:
        if self.maximized or glfw.get_window_attrib(self._handle, glfw.ICONIFIED) or min(self.size) <= 0:
            return
        self._normal = (self.size, glfw.get_window_pos(self._handle))

    @property
    def modifiers(self) -> Modifiers:
        """The modifier keys held down, of "shift", "ctrl" and "alt"."""
        return self._modifiers

    @property
    def software(self) -> bool:
        """True if the processor draws, not a graphics card."""
        return is_software_renderer(self.ctx)

    @property
    def size(self) -> Size:
        """Width and height in window units, the units of pointer positions."""
        return glfw.get_window_size(self._handle)

    @property
    def pixels(self) -> Size:
        """Width and height of the framebuffer."""
        return glfw.get_framebuffer_size(self._handle)

    @property
    def ui_scale(self) -> float:
        """Window units per unit of the interface, which is a pixel at normal density and zoom 1."""
        return self.display_scale * self.zoom

    @property
    def display_scale(self) -> float:
        """Window units per pixel at normal density."""
        scale: float = glfw.get_window_content_scale(self._handle)[0]
        return min(max(scale * self.size[0] / max(self.pixels[0], 1), 0.5), 4.0) if self.size[0] else 1.0

    @property
    def drawable(self) -> bool:
        """True if the window is neither minimised nor empty."""
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
        """Set the pointer to GLFW's ``cursor``, or to the arrow if None."""
        glfw.set_cursor(self._handle, cursor)

    def show(self) -> None:
        """Make the window visible."""
        glfw.show_window(self._handle)

    def swap(self) -> None:
        """Show the drawn frame."""
        glfw.swap_buffers(self._handle)

    # Events

    def wait(self, seconds: float) -> None:
        """Sleep until an event arrives, at most ``seconds``."""
        if seconds > 0.0 and not self._events:
            glfw.wait_events_timeout(seconds)
        else:
            glfw.poll_events()

    def wake(self) -> None:
        """End ``wait``; may be called from any thread."""
        if self._alive:
            glfw.post_empty_event()

    def take_events(self) -> list[Event]:
        """Return the events since the last call, oldest first.

        Raises:
            Exception: Any error of a callback, which cannot raise it itself.
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
                except Exception as error:  # an exception must not pass through the C library
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
            place_register(window, guarded(lambda *_values: self._record_place()))
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
            # If the last move and the release arrive in one frame, Dear ImGui drops the move of a slider. After a turn
            # of the wheel, however small, it handles the release in the next frame.
            imgui.get_io().add_mouse_wheel_event(0.0, _NO_TURN)
        if button in BUTTONS:
            self._pointer("press" if action == glfw.PRESS else "release", BUTTONS[button])

    def _on_scroll(self, _across: float, along: float) -> None:
        self._pointer("wheel", wheel=along)

    def _on_enter(self, entered: int) -> None:
        if not entered:
            self._pointer("leave")

    def _on_key(self, code: int, scancode: int, action: int, modifiers: int) -> None:
        self._set_modifiers(modifiers)
        if code in MODIFIER_KEYS:
            # Systems differ in whether ``modifiers`` includes the modifier's own key.
            changed = {MODIFIER_KEYS[code]}
            self._modifiers = self._modifiers - changed if action == glfw.RELEASE else self._modifiers | changed
            self._add(Changed())
            return
        name = KEY_NAMES.get(code)
        if glfw.KEY_A <= code <= glfw.KEY_Z:
            printed = glfw.get_key_name(code, scancode)
            name = printed.upper() if printed and len(printed) == 1 and "a" <= printed.lower() <= "z" else name
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

    # Simulated events, for tests and the demo; they pass through Dear ImGui's backend, as real ones do

    def play_move(self, x: float, y: float) -> None:
        """Simulate a move of the pointer to (x, y)."""
        imgui.backends.glfw_cursor_enter_callback(self.address, 1)
        imgui.backends.glfw_cursor_pos_callback(self.address, x, y)

    def play_button(self, button: Button, pressed: bool, modifiers: Modifiers = frozenset()) -> None:
        """Simulate the press or release of a button."""
        code = next(code for code, name in BUTTONS.items() if name == button)
        if not modifiers:
            imgui.backends.glfw_mouse_button_callback(self.address, code, int(pressed), 0)
            return
        # The backend reads modifiers from the keyboard, which no event simulates.
        io = imgui.get_io()
        self._on_button(code, glfw.PRESS if pressed else glfw.RELEASE, modifier_bits(modifiers))
        for name in modifiers:
            io.add_key_event(MODIFIERS_OF_IMGUI[name], pressed)
        io.add_mouse_button_event(code, pressed)

    def play_wheel(self, notches: float) -> None:
        """Simulate a turn of the wheel."""
        imgui.backends.glfw_scroll_callback(self.address, 0.0, notches)

    def play_key(self, name: str, kind: Literal["press", "repeat", "release"], modifiers: Modifiers) -> None:
        """Simulate the press, repetition or release of the key ``name``."""
        action = {"press": glfw.PRESS, "repeat": glfw.REPEAT, "release": glfw.RELEASE}[kind]
        imgui.backends.glfw_key_callback(self.address, KEY_CODES[name], 0, action, modifier_bits(modifiers))

    def play_text(self, text: str) -> None:
        """Simulate the input of ``text``."""
        for character in text:
            imgui.backends.glfw_char_callback(self.address, ord(character))

    def play_event(self, event: Event) -> None:
        """Simulate ``event`` from the window system."""
        self._add(event)

    def close(self) -> None:
        """Close the window and end GLFW; objects of the OpenGL context must be released before."""
        self._alive = False
        self.ctx.release()
        glfw.destroy_window(self._handle)
        glfw.terminate()
