"""The list of key poses: pairs of pictures, with the weight of each key in the present pose."""

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING

from imgui_bundle import ImVec2, imgui

from faceposer.gui.features.keys.adding import KIND_TITLES
from faceposer.gui.widgets.basic import caption
from faceposer.gui.widgets.text import shortened, widget_id
from faceposer.gui.widgets.theme import ACCENT, FAINT, FIELD, INK, KEYED, RAISED_MORE, WARNING, Icon, em, u32
from faceposer.gui.widgets.tooltips import tooltip
from faceposer.session.key_folder import COMPOSED, EXPRESSION, SIDES, VISEME, Side
from faceposer.session.key_set import KeySet, ListedKey

if TYPE_CHECKING:
    from faceposer.gui.features.keys.commands import KeyCommands

# Gap between pairs, height of the bar, in units of the font size.
_GAP, _BAR = 0.7, 0.22
# Brightness of the pictures of keys that are left out.
_DIM = 0.35
_KIND_NOTES = {
    EXPRESSION: "Emotional key pose",
    VISEME: "Verbal key pose",
    COMPOSED: "Composed of an emotional and a verbal key pose",
    "": "Neither emotional nor verbal: no part in compositions",
}


class KeyCells:
    """The pairs in rows."""

    def __init__(self, keys: "KeyCommands") -> None:
        """List the keys of ``keys``."""
        self._keys = keys
        self._edited = ""

    def draw(self, keys: KeySet, strengths: Mapping[str, float], picture: float) -> None:
        """Draw the pairs, each ``picture`` that wide, with ``strengths`` of the keys in the present pose by name."""
        listed = self._keys.listed()
        if not listed:
            text = "There are no key poses of this kind." if keys.keys else "The folder is empty; add the present pose."
            caption(text)
            return
        edited = self._keys.editing.edited
        name = "" if edited is None else edited.name
        if name != self._edited:
            # The height of the strip may have changed with the session.
            self._keys.sought = name or self._edited
            self._edited = name
        side, gap = round(picture), round(em(_GAP))
        room = imgui.get_window_width() - imgui.get_style().scrollbar_size
        columns = max(int((room + gap) // (2 * side + 1 + gap)), 1)
        size = ImVec2(2 * side + 1, side + imgui.get_text_line_height() + em(_BAR + 0.1))
        imgui.push_style_var(imgui.StyleVar_.item_spacing, (gap, round(em(0.3))))
        for i, key in enumerate(listed):
            if i % columns:
                imgui.same_line()
            if key.name == self._keys.sought and not self._keys.opened.reading:
                self._keys.sought = ""
                _show(imgui.get_cursor_pos_y(), size.y)
                self._keys.context.redraw()
            # Hundreds of pairs beyond the edge of the list would slow every frame down.
            if not imgui.is_rect_visible(size):
                imgui.dummy(size)
                continue
            imgui.push_id(widget_id(key.name))
            imgui.begin_group()
            self._draw_pair(key, side, strengths.get(key.name))
            imgui.end_group()
            imgui.pop_id()
        imgui.pop_style_var()

    def _draw_pair(self, key: ListedKey, side: int, strength: float | None) -> None:
        imgui.push_style_var(imgui.StyleVar_.item_spacing, (1.0, 0.0))
        for one in SIDES:
            if one == "target":
                imgui.same_line()
            self._draw_picture(key, one, side, strength)
        width = 2 * side + 1
        low = imgui.get_cursor_screen_pos()
        imgui.dummy((width, imgui.get_text_line_height() + em(_BAR + 0.1)))
        draw = imgui.get_window_draw_list()
        name = shortened(key.title, width)
        edited = self._keys.editing.edited
        known = key.name == self._keys.latest or (edited is not None and edited.name == key.name)
        colour = WARNING if key.problem else INK if known else FAINT
        across = imgui.calc_text_size(name).x
        draw.add_text((round(low.x + 0.5 * (width - across)), round(low.y + em(_BAR + 0.1))), u32(colour), name)
        if strength is not None:
            share = min(max(abs(strength), 0.0), 1.0)
            bar = em(_BAR)
            draw.add_rect_filled(low, (low.x + width, low.y + bar), u32(FIELD))
            draw.add_rect_filled(
                low, (low.x + share * width, low.y + bar), u32(ACCENT if strength >= 0.0 else WARNING, 0.9)
            )
        imgui.pop_style_var()

    def _draw_picture(self, key: ListedKey, one: Side, side: int, strength: float | None) -> None:
        feature = self._keys
        context = feature.context
        low = imgui.get_cursor_screen_pos()
        pressed = imgui.invisible_button(one, ImVec2(side, side))
        seen, hovered = imgui.is_item_visible(), imgui.is_item_hovered()
        context.widget_rects.record(f"key:{key.name}:{one}")
        tooltip(self._tip(key, one, strength))
        high = ImVec2(low.x + side, low.y + side)
        draw = imgui.get_window_draw_list()
        if seen:
            draw.add_rect_filled(low, high, u32(FIELD))
            texture = feature.faces.thumbnail(key, one, round(side * context.pixel_ratio))
            if texture is not None:
                shade = imgui.color_convert_float4_to_u32((1.0, 1.0, 1.0, _DIM if key.problem else 1.0))
                draw.add_image(imgui.ImTextureRef(texture), low, high, (0.0, 0.0), (1.0, 1.0), shade)
                if key.problem and one == "source":
                    draw.add_text((low.x + em(0.3), low.y + em(0.2)), u32(WARNING), Icon.WARNING)
            elif key.poses[one] is None:
                extent = imgui.calc_text_size(Icon.WARNING)
                place = (low.x + 0.5 * (side - extent.x), low.y + 0.5 * (side - extent.y))
                draw.add_text(place, u32(WARNING), Icon.WARNING)
            if one == "target" and key.proposed:
                draw.add_circle_filled((high.x - em(0.45), low.y + em(0.45)), em(0.2), u32(KEYED))
            edited = feature.editing.edited
            active = edited is not None and (edited.name, edited.side) == (key.name, one)
            if active or hovered:
                thick = max(round(em(0.13)), 1) if active else max(round(em(0.07)), 1)
                draw.add_rect(low, high, u32(ACCENT if active else RAISED_MORE), thickness=thick)
        if pressed:
            feature.editing.edit(key, one)
        self._draw_menu(key, one)

    def _tip(self, key: ListedKey, one: Side, strength: float | None) -> str:
        lines = [f"{key.title}: {one}. Click to edit it"]
        if key.problem:
            lines = [f"Left out of the clone. {key.problem}", *lines]
        elif one == "target" and key.proposed:
            lines.append("Proposed by a transfer, and not edited yet")
        lines.append(_KIND_NOTES[key.kind])
        if strength is not None:
            # Adding 0 makes -0 positive.
            lines.append(f"Weight in the present pose: {round(strength, 2) + 0.0:.2f}")
        return "\n".join(lines)

    def _draw_menu(self, key: ListedKey, one: Side) -> None:
        # The pictures of a pair touch, the rows of its menu do not.
        imgui.push_style_var(imgui.StyleVar_.item_spacing, (em(0.6), em(0.54)))
        if imgui.begin_popup_context_item(f"##key-menu-{one}"):
            self._draw_commands(key)
            imgui.end_popup()
        imgui.pop_style_var()

    def _draw_commands(self, key: ListedKey) -> None:
        feature = self._keys
        free = not feature.context.busy
        items: tuple[tuple[str, str, bool, Callable[[], None]], ...] = (
            ("edit-source", "Edit source", free, lambda: feature.editing.edit(key, "source")),
            ("edit-target", "Edit target", free, lambda: feature.editing.edit(key, "target")),
            (
                "replace-source",
                "Replace source with present pose",
                free and feature.poses_side("source"),
                lambda: feature.replace_side(key, "source"),
            ),
            (
                "replace-target",
                "Replace target with present pose",
                free and feature.poses_side("target"),
                lambda: feature.replace_side(key, "target"),
            ),
            ("propose", "Propose target again", free, lambda: feature.propose(key)),
            ("rename", "Rename...", free, lambda: feature.ask_to_rename(key)),
            ("remove", "Remove...", free, lambda: feature.ask_to_remove(key)),
        )
        for name, label, enabled, run in items:
            if name in ("replace-source", "rename"):
                imgui.separator()
            if name == "rename":
                self._draw_kinds(key, free)
                imgui.separator()
            if imgui.menu_item_simple(label, "", False, enabled):
                run()
            feature.context.widget_rects.record(f"key-menu:{name}")

    def _draw_kinds(self, key: ListedKey, free: bool) -> None:
        for kind, title in KIND_TITLES.items():
            label = f"{title} key pose" if kind else "Neither emotional nor verbal"
            if imgui.menu_item_simple(label, "", key.kind == kind, free and key.kind != COMPOSED):
                self._keys.set_kind(key, kind)
            self._keys.context.widget_rects.record(f"key-menu:kind:{kind or 'none'}")


def _show(top: float, height: float) -> None:
    """Scroll the list to the row at ``top`` of ``height``, unless it is visible."""
    first, room = imgui.get_scroll_y(), imgui.get_window_height()
    if not first <= top <= top + height <= first + room:
        imgui.set_scroll_y(max(top + 0.5 * (height - room), 0.0))
