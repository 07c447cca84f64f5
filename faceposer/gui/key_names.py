"""Names of mouse buttons, modifiers and keys, by GLFW's codes."""

import sys

from imgui_bundle import imgui

# The bundle selects the GLFW library that glfw loads, so that both share one; it must be imported first.
# isort: split
import glfw

from faceposer.gui.events import Modifiers
from faceposer.tools.tool import Button

BUTTONS: dict[int, Button] = {
    glfw.MOUSE_BUTTON_LEFT: "left",
    glfw.MOUSE_BUTTON_MIDDLE: "middle",
    glfw.MOUSE_BUTTON_RIGHT: "right",
}
MODIFIER_KEYS = {
    glfw.KEY_LEFT_SHIFT: "shift",
    glfw.KEY_RIGHT_SHIFT: "shift",
    glfw.KEY_LEFT_CONTROL: "ctrl",
    glfw.KEY_RIGHT_CONTROL: "ctrl",
    glfw.KEY_LEFT_ALT: "alt",
    glfw.KEY_RIGHT_ALT: "alt",
}
MODIFIERS_OF_IMGUI = {"shift": imgui.Key.mod_shift, "ctrl": imgui.Key.mod_ctrl, "alt": imgui.Key.mod_alt}
if sys.platform == "darwin":
    # macOS has Command in place of Control.
    MODIFIER_KEYS |= {glfw.KEY_LEFT_SUPER: "ctrl", glfw.KEY_RIGHT_SUPER: "ctrl"}
KEY_NAMES: dict[int, str] = {
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
KEY_CODES = {name: code for code, name in reversed(KEY_NAMES.items())}


def modifier_bits(modifiers: Modifiers) -> int:
    """Return GLFW's bits for ``modifiers``."""
    bits = {"shift": glfw.MOD_SHIFT, "ctrl": glfw.MOD_CONTROL, "alt": glfw.MOD_ALT}
    return sum(bits[name] for name in modifiers)
