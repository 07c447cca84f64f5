"""The strip of key poses: its commands, the coverage of the animation, and all pairs."""

from typing import TYPE_CHECKING

import numpy as np
from imgui_bundle import ImVec2, ImVec4, imgui
from numpy.typing import NDArray

from faceposer.errors import counted
from faceposer.gui.features.keys.cells import KeyCells
from faceposer.gui.features.keys.covering import GRAPH, Covered
from faceposer.gui.widgets.basic import action_button, caption
from faceposer.gui.widgets.text import shortened, text_width, truncated
from faceposer.gui.widgets.theme import ACCENT, FAINT, WARNING, Icon, em
from faceposer.gui.widgets.tooltips import tooltip
from faceposer.session.key_folder import COMPOSED, EXPRESSION, VISEME
from faceposer.session.key_set import KeySet, ListedKey
from faceposer.transfer.key_coverage import reach_of
from faceposer.transfer.key_parameters import REGIONS

if TYPE_CHECKING:
    from faceposer.gui.features.keys.commands import KeyCommands

_PAD = 0.45
# In units of the font size: heights of the list of pairs with two rows and with one, width of the present pose with its
# clone, and of the picture of a key, in a wide and in a narrow strip.
_LIST, _LIVE, _PICTURE = (15.6, 13.4), (13.4, 8.6), (6.2, 4.6)
_LOW_LIST = (8.2, 7.2)
# Heights of the window from which there are two rows of pairs: without a timeline, and what that needs besides.
_ROOM, _ROOM_OF_TIMELINE = 40.0, 16.0
# Widths of the strip below which pictures are smaller and words fewer, and below which the present pose is left out.
_NARROW, _NARROWEST = 46.0, 30.0
# Widths of the button that goes to a frame, and of the one that shows keys that are left out.
_BEST, _LEFT_OUT = (9.5, 8.2), (10.5, 7.0)
_KINDS = (
    ("", "Show all key poses"),
    (EXPRESSION, "Show emotional key poses"),
    (VISEME, "Show verbal key poses"),
    (COMPOSED, "Show composed key poses"),
)
_REGION_LABELS = {"whole": "Clone whole face", "halves": "Clone halves", "parts": "Clone parts"}


class KeysPanel:
    """Content of the strip."""

    def __init__(self, keys: "KeyCommands") -> None:
        """Show the state of ``keys``."""
        self._keys = keys
        self._cells = KeyCells(keys)
        # 1 if the strip is narrow, which is known when it is drawn.
        self._narrow = 0

    @property
    def height(self) -> float:
        """Height of the strip."""
        rows = imgui.get_frame_height() + em(2 * _PAD)
        keys = self._keys.opened.keys
        if keys is None:
            return round(rows + 2.0 * imgui.get_text_line_height_with_spacing() + em(_PAD))
        if self._keys.covering.of_animation(keys) is not None:
            rows += em(GRAPH)
        return round(rows + em(self._list_height) + em(_PAD))

    @property
    def _list_height(self) -> float:
        """Height of the list in units of the font size: two rows of pairs, or one where the view needs the room."""
        keys = self._keys.opened.keys
        covered = keys is not None and self._keys.covering.of_animation(keys) is not None
        enough = _ROOM + (_ROOM_OF_TIMELINE if covered else 0.0)
        heights = _LIST if imgui.get_main_viewport().size.y > em(enough) else _LOW_LIST
        return heights[self._narrow]

    def draw(self) -> None:
        """Draw the strip into the current window."""
        feature, pad = self._keys, em(_PAD)
        narrow = int(imgui.get_window_width() < em(_NARROW))
        if narrow != self._narrow:
            self._narrow = narrow
            feature.context.redraw()
        keys = feature.opened.keys
        covered = None if keys is None else feature.covering.of_animation(keys)
        if covered is not None:
            imgui.set_cursor_pos(ImVec2(0.0, 0.0))
            feature.covering.draw(covered)
        imgui.set_cursor_pos(ImVec2(em(0.6), pad + (0.0 if covered is None else em(GRAPH))))
        imgui.push_style_var(imgui.StyleVar_.item_spacing, ImVec2(em(0.4), pad))
        imgui.begin_child("##keys-content", ImVec2(-em(0.6), -1.0))
        self._draw_head(covered)
        if keys is None:
            self._draw_empty()
        else:
            feature.faces.show(keys)
            self._draw_pairs(keys)
        imgui.end_child()
        imgui.pop_style_var()

    # Commands

    def _draw_head(self, covered: Covered | None) -> None:
        feature = self._keys
        context, rects = feature.context, feature.context.widget_rects
        room = imgui.get_content_region_avail().x
        right = imgui.get_cursor_pos_x() + room
        if imgui.button(f"Key poses {Icon.LIST}##keys-menu", (em(7.2), 0.0)):
            imgui.open_popup("##keys-menu-list")
        rects.record("keys:menu")
        tooltip("Folder of key poses, and commands for all of them")
        self._draw_menu()
        commands = (("keys-add", "Add...", 4.6), ("keys-compose", "Compose", 5.6))
        edited = feature.editing.edited
        # A narrow strip has the second one in the menu alone, and while a key is edited, both.
        for name, label, width in commands[: (2, 1 if edited is None else 0)[self._narrow]]:
            imgui.same_line()
            action_button(rects, context.actions[name], em(width), label)
        imgui.same_line()
        keys = feature.opened.keys
        # From the right: close, back, save, or the frame that would help most, and keys that are left out.
        save = ("keys-save", "Save", 4.2) if self._narrow else ("keys-save", "Save key pose", 8.0)
        buttons = [save, ("keys-back", "Back", 4.2)] if edited is not None else []
        best = covered if edited is None and covered is not None and covered.best is not None else None
        left_out = keys.left_out if keys is not None and edited is None else []
        widths = [width for _, _, width in buttons]
        widths += [_LEFT_OUT[self._narrow]] * bool(left_out) + [_BEST[self._narrow]] * bool(best)
        taken = sum(em(width + 0.4) for width in widths) + em(1.8)
        imgui.align_text_to_frame_padding()
        self._draw_state(right - taken - imgui.get_cursor_pos_x() - em(0.8), covered)
        imgui.same_line(right - taken)
        for name, label, width in buttons:
            action_button(rects, context.actions[name], em(width), label, strong=name == "keys-save")
            imgui.same_line()
        if left_out:
            self._draw_left_out(left_out)
            imgui.same_line()
        if best is not None and keys is not None:
            feature.covering.button(best, keys, em(_BEST[self._narrow]))
            imgui.same_line()
        if imgui.button(f"{Icon.CLOSE}##keys-close", (em(1.8), 0.0)):
            feature.toggle()
        rects.record("keys:close")
        tooltip("Hide the key poses")

    def _draw_left_out(self, keys: list[ListedKey]) -> None:
        """Draw the button that shows the next of the ``keys`` that are left out."""
        count = f"{len(keys)}" if self._narrow else counted(len(keys), "key pose")
        tip = f"{keys[0].problem}\nClick to show the key pose" + (", and again for the next one" * (len(keys) > 1))
        imgui.push_style_color(imgui.Col_.text, ImVec4(*WARNING))
        # The colour is that of the button alone, not of its tooltip.
        label = f"{Icon.WARNING}  {count} left out"
        pressed = imgui.button(f"{label}##keys-left-out", (em(_LEFT_OUT[self._narrow]), 0.0))
        imgui.pop_style_color()
        self._keys.context.widget_rects.record("keys:left-out")
        tooltip(tip)
        if pressed:
            self._keys.show_left_out()

    def _draw_state(self, room: float, covered: Covered | None) -> None:
        """Draw what is edited, or what is open and how much of the animation it covers, in ``room``."""
        feature = self._keys
        edited, keys = feature.editing.edited, feature.opened.keys
        if edited is not None:
            star = "*" if feature.editing.changed else ""
            texts = [f"Editing the {edited.side} of {edited.title}{star}", f"{edited.title}: {edited.side}{star}"]
            imgui.text_colored(ImVec4(*ACCENT), truncated(_fitting(texts, room), room))
            tooltip(texts[0])
        elif feature.opened.reading and keys is None:
            imgui.text_colored(ImVec4(*FAINT), "Reading key poses...")
        elif keys is not None and (keys.problem or keys.notes):
            text = keys.problem or keys.notes
            imgui.text_colored(ImVec4(*WARNING), truncated(f"{Icon.WARNING}  {text}", room))
            tooltip(text)
        elif keys is not None:
            source, target = keys.models["source"], keys.models["target"]
            names = " to ".join(model.character.title for model in (source, target) if model is not None)
            count = counted(len(keys.keys), "key pose")
            text = f"{names}: {count} in {keys.folder.folder.name}"
            said = "" if covered is None else feature.covering.summary(covered)
            # The longest of these that fits.
            texts = [f"{text}; {said}", f"{names}; {said}", f"{count}; {said}", said] if said else [text, names, count]
            shown = _fitting(texts, room)
            imgui.text_colored(ImVec4(*FAINT), truncated(shown[0].upper() + shown[1:], room))
            tips = [text, *([] if covered is None else [feature.covering.text(covered)]), str(keys.folder.folder)]
            tooltip("\n".join(tips))
        else:
            imgui.text_unformatted(" ")

    def _draw_menu(self) -> None:
        feature = self._keys
        if not imgui.begin_popup("##keys-menu-list"):
            return
        context, rects = feature.context, feature.context.widget_rects
        keys = feature.opened.keys
        for name in (
            "keys-new",
            "keys-open",
            "keys-add",
            "keys-compose",
            "keys-importance-source",
            "keys-importance-target",
        ):
            action = context.actions[name]
            if name == "keys-add":
                imgui.separator()
            if imgui.menu_item_simple(action.label, action.shortcut, False, action.enabled()):
                action.run()
            rects.record(f"menu:{name}")
            tooltip(action.help)
        imgui.separator()
        for regions in REGIONS:
            chosen = keys is not None and keys.folder.regions == regions
            if imgui.menu_item_simple(_REGION_LABELS[regions], "", chosen, keys is not None):
                feature.set_regions(regions)
            rects.record(f"keys:regions:{regions}")
        imgui.separator()
        for kind, label in _KINDS:
            if imgui.menu_item_simple(label, "", feature.kind == kind, keys is not None):
                feature.kind = kind
            rects.record(f"keys:kind:{kind or 'all'}")
        imgui.end_popup()

    def _draw_empty(self) -> None:
        opened = self._keys.opened
        if opened.error:
            imgui.text_colored(
                WARNING, shortened(f"{Icon.WARNING}  {opened.error}", imgui.get_content_region_avail().x)
            )
            tooltip(opened.error)
        elif not opened.reading:
            caption(
                "Key poses say what an expression looks like on another character. Create or open a folder of them."
            )

    # Pairs

    def _draw_pairs(self, keys: KeySet) -> None:
        feature = self._keys
        pose = feature.present_pose()
        wide = imgui.get_content_region_avail().x > em(_NARROWEST)
        if pose is not None and keys.transfer is not None and wide:
            imgui.begin_child(
                "##keys-live", ImVec2(em(_LIVE[self._narrow]), 0.0), 0, imgui.WindowFlags_.no_scrollbar.value
            )
            self._draw_live(keys, pose)
            imgui.end_child()
            imgui.same_line(0.0, em(0.9))
        imgui.begin_child("##keys-list", ImVec2(0.0, 0.0))
        self._cells.draw(keys, {} if pose is None else keys.strengths(pose), em(_PICTURE[self._narrow]))
        imgui.end_child()

    def _draw_live(self, keys: KeySet, pose: NDArray[np.float64]) -> None:
        feature = self._keys
        assert keys.transfer is not None
        gap = imgui.get_style().item_spacing.x
        side = 0.5 * (imgui.get_content_region_avail().x - gap)
        # Pictures of two more faces would slow a drag down.
        steady = feature.context.toolbox.active or feature.context.session.editing
        feature.faces.draw_live("source", keys.source_model(), pose, side, steady)
        feature.context.widget_rects.record("keys:present")
        tooltip("The present pose of the source")
        imgui.same_line()
        target = keys.models["target"]
        assert target is not None
        feature.faces.draw_live("target", target, keys.transfer.pose(pose), side, steady)
        feature.context.widget_rects.record("keys:clone")
        tooltip("Its clone by the key poses")
        distance, sentence = reach_of(keys.transfer, pose)
        measured = f"{10.0 * distance:.1f}\u00a0mm from the key poses"
        if sentence:
            imgui.push_style_color(imgui.Col_.text, ImVec4(*WARNING))
            imgui.text_wrapped(f"{Icon.WARNING}  {measured}" if self._narrow else sentence)
            imgui.pop_style_color()
            tooltip(sentence)
        else:
            caption(f"{measured}." if self._narrow else f"The present pose and its clone; {measured}.")
        feature.context.widget_rects.record("keys:distance")


def _fitting(texts: list[str], room: float) -> str:
    """Return the first of ``texts`` that is no wider than ``room``, or the last one."""
    return next((text for text in texts if text_width(text) <= room), texts[-1])
