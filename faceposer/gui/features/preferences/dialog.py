"""Dialog of the preferences: general settings, and the keymap."""

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, get_args

from imgui_bundle import ImVec2, imgui

from faceposer.gui.actions import Action, display_key
from faceposer.gui.settings import LIMITS
from faceposer.gui.widgets.basic import caption, choice, heading
from faceposer.gui.widgets.modal import modal, modal_buttons, modal_escaped, modal_room, modal_title
from faceposer.gui.widgets.sliders import row_label, slider
from faceposer.gui.widgets.text import shortened
from faceposer.gui.widgets.theme import ACCENT, BAD, FAINT, Icon, em
from faceposer.gui.widgets.tooltips import tooltip
from faceposer.render.options import Backdrop, Look
from faceposer.tools.tool import Navigation

if TYPE_CHECKING:
    from faceposer.gui.features.preferences.state import PreferencesState

_WIDTH, _HEIGHT, _LABEL = 42.0, 26.0, 9.0
_SCALES = (0.75, 1.0, 1.25, 1.5, 2.0)
_NAVIGATIONS: tuple[Navigation, ...] = get_args(Navigation)
_NAVIGATION_TIPS = (
    "Middle drag: orbit; with Shift: pan; with Ctrl: zoom",
    "Alt+left drag: orbit; Alt+middle drag: pan; Alt+right drag: zoom",
)
_BACKDROPS: tuple[Backdrop, ...] = get_args(Backdrop)
_BACKDROP_TIPS = ("Default grey", "Nearly black", "Light grey")
_KEYS_WIDTH = 11.0
# Height of title, tabs and button, in units of the font size.
_OTHERS = 9.2


class PreferencesDialog:
    """Pages of the dialog."""

    def __init__(self, preferences: "PreferencesState") -> None:
        """Show and change ``preferences``."""
        self._preferences = preferences
        self._filter = ""

    def draw(self, draw_above: Callable[[], None]) -> None:
        """Draw the dialog; ``draw_above`` draws the dialogs above it."""
        preferences = self._preferences
        context = preferences.context
        with modal("##preferences", _WIDTH) as shown:
            if not shown:
                draw_above()
                return
            has_keys = not context.file_dialogs.open
            modal_title(context.fonts, "Preferences")
            height = max(min(em(_HEIGHT), em(modal_room() - _OTHERS)), em(2))
            if imgui.begin_tab_bar("##pages"):
                for title, draw in (("General", self._draw_general), ("Keymap", self._draw_keymap)):
                    chosen, _ = imgui.begin_tab_item(title)
                    context.widget_rects.record(f"preferences:{title.lower()}")
                    if chosen:
                        imgui.begin_child(f"##{title}", ImVec2(0.0, height))
                        draw()
                        imgui.end_child()
                        imgui.end_tab_item()
                imgui.end_tab_bar()
            pressed = modal_buttons(context.widget_rects, "preferences", (("close", "Close"),))
            captures = bool(preferences.capturing) or preferences.ended_capture
            escaped = has_keys and not captures and modal_escaped()
            preferences.ended_capture &= imgui.is_key_down(imgui.Key.escape)
            if pressed or escaped:
                preferences.hide()
                imgui.close_current_popup()
            draw_above()

    def _draw_general(self) -> None:
        preferences = self._preferences
        context, settings, rects = preferences.context, preferences.settings, preferences.context.widget_rects
        heading(context.fonts, "Interface", first=True)
        row_label("Navigation", "Mouse buttons that orbit, pan and zoom", _LABEL)
        preset = _NAVIGATIONS.index(settings.navigation)
        chosen = choice(rects, "preferences:navigation", ("Blender", "Maya"), preset, _NAVIGATION_TIPS)
        if chosen != preset:
            preferences.navigate(_NAVIGATIONS[chosen])
        row_label("Size", "Scale of text and panels", _LABEL)
        nearest = min(range(len(_SCALES)), key=lambda i: abs(_SCALES[i] - settings.ui_scale))
        labels = [f"{100 * scale:.0f} %" for scale in _SCALES]
        tips = ["Scale of text and panels"] * len(_SCALES)
        chosen = choice(rects, "preferences:scale", labels, nearest, tips)
        if chosen != nearest:
            context.set_ui_scale(_SCALES[chosen])
        heading(context.fonts, "View")
        look = context.scene.look
        row_label("Background", "Background of the view", _LABEL)
        backdrop = _BACKDROPS.index(look.backdrop)
        names = [name.capitalize() for name in _BACKDROPS]
        chosen = choice(rects, "preferences:backdrop", names, backdrop, _BACKDROP_TIPS)
        if chosen != backdrop:
            preferences.set_look(replace(look, backdrop=_BACKDROPS[chosen]))
        self._draw_light("key", "Key light", "Intensity of the light from the front")
        self._draw_light("ambient", "Ambient light", "Intensity of the light from all sides")
        row_label("", width=_LABEL)
        if imgui.button("Reset light"):
            preferences.set_look(Look(backdrop=context.scene.look.backdrop))
        rects.record("preferences:reset-light")
        heading(context.fonts, "Files")
        row_label("Autosave folder", "Folder in which unsaved work is kept in case of a crash", _LABEL)
        folder = str(preferences.autosave_folder)
        room = imgui.get_content_region_avail().x - em(5.5 + 2.6)
        imgui.align_text_to_frame_padding()
        imgui.text_unformatted(shortened(folder, room))
        tooltip(folder)
        imgui.same_line(imgui.get_window_width() - em(5.5 + 2.4))
        if imgui.button("Choose..."):
            preferences.ask_for_autosave_folder()
        rects.record("preferences:autosave")
        imgui.same_line()
        imgui.begin_disabled(not settings.autosave_folder)
        if imgui.button(f"{Icon.UNDO}##autosave"):
            settings.autosave_folder = ""
        imgui.end_disabled()
        rects.record("preferences:autosave-reset")
        tooltip("Reset to the default folder")
        row_label("", width=_LABEL)
        caption("Unsaved work is kept in this folder in case of a crash. A change takes effect at the next start.")

    def _draw_light(self, name: str, label: str, tip: str) -> None:
        preferences = self._preferences
        look = preferences.context.scene.look
        row_label(label, tip, _LABEL)
        imgui.set_next_item_width(-1.0)
        limits = LIMITS[f"{name}_light"]
        flags = imgui.SliderFlags_.clamp_on_input.value
        changed, value = slider(f"##{name}", getattr(look, name), *limits, "%.2f", flags)
        preferences.context.widget_rects.record(f"preferences:{name}")
        tooltip(tip)
        if changed:
            preferences.set_look(replace(look, key=value) if name == "key" else replace(look, ambient=value))

    def _draw_keymap(self) -> None:
        preferences = self._preferences
        context = preferences.context
        reset = em(9.0)
        imgui.set_next_item_width(imgui.get_content_region_avail().x - reset - imgui.get_style().item_spacing.x)
        _, self._filter = imgui.input_text_with_hint("##filter", "Find an action or a key", self._filter)
        context.widget_rects.record("preferences:filter")
        imgui.same_line()
        imgui.begin_disabled(not preferences.settings.keys)
        if imgui.button("Reset all keys", (reset, 0.0)):
            preferences.reset_keys()
        imgui.end_disabled()
        context.widget_rects.record("preferences:reset-keys")
        # The line is drawn even if it is empty, so that nothing jumps.
        text = preferences.problem
        if preferences.capturing:
            text = "Press the new key with its modifiers; Esc cancels."
        imgui.align_text_to_frame_padding()
        imgui.text_colored(ACCENT if preferences.capturing else BAD, text or " ")
        if preferences.refused is not None:
            imgui.same_line()
            if imgui.button("Reassign"):
                preferences.reassign()
            context.widget_rects.record("preferences:reassign")
            tooltip("Take the key from the other action")
        filter_text = self._filter.strip().lower()
        imgui.begin_child("##keys")
        menu = ""
        for action in context.actions:
            written = ", ".join(display_key(key) for key in action.keys)
            if not _matches(filter_text, action.label, written):
                continue
            if action.menu != menu:
                menu = action.menu
                imgui.text_colored(FAINT, menu)
            imgui.push_id(action.name)
            self._draw_action(action, written)
            imgui.pop_id()
        if not menu:
            imgui.text_disabled("No matching actions.")
        imgui.end_child()

    def _draw_action(self, action: Action, written: str) -> None:
        preferences = self._preferences
        rects = preferences.context.widget_rects
        left, width, side = imgui.get_cursor_pos_x(), imgui.get_content_region_avail().x, em(1.9)
        imgui.align_text_to_frame_padding()
        label = action.label.rstrip(".")
        shown = shortened(label, width - em(_KEYS_WIDTH) - 2.0 * side - em(1.5))
        imgui.text_unformatted(shown)
        if shown != label:
            tooltip(label)
        imgui.same_line(left + width - em(_KEYS_WIDTH) - 2.0 * side - em(0.4))
        capturing = preferences.capturing == action.name
        if imgui.button(f"{'Press a key...' if capturing else written}##keys", (em(_KEYS_WIDTH), 0.0)):
            preferences.capture("" if capturing else action.name)
        rects.record(f"keymap:{action.name}")
        tooltip("Click, then press the new key")
        imgui.same_line(0.0, em(0.2))
        imgui.begin_disabled(not action.keys)
        if imgui.button(f"{Icon.CLOSE}##clear", (side, 0.0)):
            preferences.change_keys(action.name, ())
        imgui.end_disabled()
        rects.record(f"keymap:{action.name}:clear")
        tooltip("Remove the key")
        imgui.same_line(0.0, em(0.2))
        default = preferences.context.actions.default_keys(action.name)
        imgui.begin_disabled(action.keys == default)
        if imgui.button(f"{Icon.UNDO}##reset", (side, 0.0)):
            preferences.change_keys(action.name, default)
        imgui.end_disabled()
        rects.record(f"keymap:{action.name}:reset")
        tooltip(f"Reset to {', '.join(map(display_key, default)) or 'no key'}")


def _matches(text: str, label: str, keys: str) -> bool:
    """Return True if ``text`` is in the ``label``, is one of the ``keys``, or begins one with modifiers ("ctrl+")."""
    written = keys.lower().split(", ")
    return text in label.lower() or text in written or ("+" in text and any(key.startswith(text) for key in written))
