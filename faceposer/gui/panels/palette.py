"""The command palette: search for actions and run them from the keyboard."""

from imgui_bundle import ImVec2, imgui

from faceposer.errors import counted
from faceposer.gui.actions import Action, Actions, display_key
from faceposer.gui.context import EditorContext
from faceposer.gui.panels.action_search import Match, ranked
from faceposer.gui.widgets.theme import ACCENT, FAINT, INK, Colour, em, u32
from faceposer.gui.widgets.widget_rects import WidgetRects

_NAME = "##palette"
_WIDTH, _ROW, _MAX_ROWS, _ABOVE = 38.0, 1.85, 14, 1.5
_DIM = 0.40
# Colour of matching letters, distinct on the chosen row, too.
_MATCHING: Colour = (0.52, 0.82, 1.0, 1.0)


class Palette:
    """A search field with the matching actions below.

    Attributes:
        open: True if the palette is shown, or will be in the next frame.
        query: Text of the search field.
        chosen: Index of the row for Enter.
    """

    def __init__(self) -> None:
        self.open = False
        self.query = ""
        self.chosen = 0
        self._matches: list[Match] = []
        self._focus = self._reveal = False

    @property
    def rows(self) -> list[Action]:
        """The listed actions, in order."""
        return [match.action for match in self._matches]

    def show(self) -> None:
        """Open the palette in the next frame, with an empty query."""
        self.open = self._focus = self._reveal = True
        self.query, self.chosen = "", 0

    def close(self) -> None:
        """Close the palette."""
        self.open = False

    def draw(self, context: EditorContext) -> None:
        """Draw the palette if it is open, and run the chosen action."""
        if not self.open:
            return
        if self._focus and not imgui.is_popup_open(_NAME):
            imgui.open_popup(_NAME)
        self._matches = ranked(self.query, list(context.actions))
        if not self._begin():
            # Closed by Esc or a click outside.
            self.open = False
            return
        appearing = imgui.is_window_appearing()
        step = self._steps()
        self._draw_field(context.widget_rects)
        self._move(step)
        picked = self._draw_rows(context.widget_rects)
        self._draw_footer(context.actions)
        if not appearing and (_pressed(imgui.Key.enter) or _pressed(imgui.Key.keypad_enter)):
            picked = self._matches[self.chosen].action if self._matches else None
            # Enter takes the focus from the field; typing continues if no action was run.
            self._focus = True
        if picked is not None and picked.enabled():
            self.open = False
        else:
            picked = None
        if not self.open:
            imgui.close_current_popup()
        imgui.end_popup()
        if picked is not None:
            picked.run()
            context.redraw()

    def _begin(self) -> bool:
        view = imgui.get_main_viewport()
        width = min(em(_WIDTH), view.size.x - em(2))
        top = view.work_pos.y + em(_ABOVE)
        imgui.set_next_window_pos(ImVec2(view.pos.x + 0.5 * view.size.x, top), imgui.Cond_.always, ImVec2(0.5, 0.0))
        imgui.set_next_window_size(ImVec2(width, 0.0))
        flags = imgui.WindowFlags_.no_move | imgui.WindowFlags_.no_resize | imgui.WindowFlags_.no_saved_settings
        imgui.push_style_var(imgui.StyleVar_.window_padding, ImVec2(em(0.7), em(0.7)))
        shown = imgui.begin_popup(_NAME, flags)
        imgui.pop_style_var()
        return shown

    def _steps(self) -> int:
        """Return the number of rows by which the pressed keys move down."""
        page, all_rows = max(self._shown_rows() - 1, 1), len(self._matches)
        keys = (
            (imgui.Key.up_arrow, -1),
            (imgui.Key.down_arrow, 1),
            (imgui.Key.page_up, -page),
            (imgui.Key.page_down, page),
            (imgui.Key.home, -all_rows),
            (imgui.Key.end, all_rows),
        )
        return sum(rows for key, rows in keys if _pressed(key, repeat=True))

    def _move(self, step: int) -> None:
        last = max(len(self._matches) - 1, 0)
        chosen = self.chosen + step
        if abs(step) == 1 and not 0 <= chosen <= last:
            # Wraps around at both ends.
            chosen = 0 if step > 0 else last
        self.chosen = min(max(chosen, 0), last)
        self._reveal = self._reveal or step != 0

    def _draw_field(self, rects: WidgetRects) -> None:
        if self._focus:
            imgui.set_keyboard_focus_here()
            self._focus = False
        imgui.set_next_item_width(-1.0)
        imgui.push_style_var(imgui.StyleVar_.frame_padding, ImVec2(em(0.6), em(0.5)))
        flags = imgui.InputTextFlags_.callback_always.value
        _, query = imgui.input_text_with_hint(
            "##query", "Type to find a command", self.query, flags, _keep_cursor_at_end
        )
        imgui.pop_style_var()
        rects.record("palette:query")
        if query != self.query:
            self.query, self.chosen, self._reveal = query, 0, True

    def _shown_rows(self) -> int:
        """Return the number of rows that fit."""
        view = imgui.get_main_viewport()
        others = em(_ABOVE + 5.6) + 4.0 * imgui.get_style().item_spacing.y
        room = (view.work_size.y - others) / em(_ROW)
        return max(min(len(self._matches), _MAX_ROWS, int(room)), 1)

    def _draw_rows(self, rects: WidgetRects) -> Action | None:
        """Draw the list and return the clicked action, if any."""
        picked = None
        row = round(em(_ROW))
        height = self._shown_rows() * row
        imgui.push_style_var(imgui.StyleVar_.item_spacing, ImVec2(0.0, 0.0))
        imgui.begin_child("##rows", ImVec2(0.0, height))
        if self._reveal:
            low = self.chosen * row
            imgui.set_scroll_y(min(max(imgui.get_scroll_y(), low + row - height), low))
        if not self._matches:
            imgui.set_cursor_pos(ImVec2(em(0.6), (row - imgui.get_font_size()) / 2.0))
            imgui.text_disabled("No matching commands.")
        for i, match in enumerate(self._matches):
            imgui.push_id(match.action.name)
            corner, width = imgui.get_cursor_screen_pos(), imgui.get_content_region_avail().x
            pressed, _ = imgui.selectable(
                "##row", i == self.chosen, imgui.SelectableFlags_.no_auto_close_popups.value, ImVec2(width, row)
            )
            rects.record(f"palette:{match.action.name}")
            if imgui.is_item_hovered() and _pointer_moved():
                self.chosen = i
            if pressed:
                picked, self.chosen, self._focus = match.action, i, True
            _draw_row(match, corner, width, row, i == self.chosen)
            imgui.pop_id()
        self._reveal = False
        imgui.end_child()
        imgui.pop_style_var()
        return picked

    def _draw_footer(self, actions: Actions) -> None:
        """Draw the help text of the chosen action in one line."""
        text = f"{counted(len(list(actions)), 'command')}"
        if self._matches:
            action = self._matches[min(self.chosen, len(self._matches) - 1)].action
            text = action.help or action.label
            if not action.enabled():
                text = f"Unavailable:  {text}"
        imgui.separator()
        left = imgui.get_cursor_screen_pos()
        right = left.x + imgui.get_content_region_avail().x
        draw = imgui.get_window_draw_list()
        draw.push_clip_rect(left, ImVec2(right, left.y + em(1.4)), True)
        draw.add_text(ImVec2(left.x + em(0.6), left.y + em(0.15)), u32(FAINT), text)
        draw.pop_clip_rect()
        imgui.dummy(ImVec2(0.0, em(1.3)))


def _draw_row(match: Match, corner: ImVec2, width: float, height: float, chosen: bool) -> None:
    """Draw a row: state of a switch, label with the matching letters, menu, and keys at the right."""
    action = match.action
    alpha = 1.0 if action.enabled() else _DIM
    draw = imgui.get_window_draw_list()
    y = corner.y + round((height - imgui.get_font_size()) / 2.0)
    if action.checked is not None:
        _draw_switch(draw, (corner.x + em(0.6), y), action.checked(), alpha)
    x = corner.x + em(2.1)
    for text, colour in _runs(match):
        draw.add_text(ImVec2(x, y), u32(colour, alpha), text)
        x += imgui.calc_text_size(text).x
    keys = ", ".join(display_key(key) for key in action.keys)
    right = corner.x + width - em(0.6)
    keys_left = right - imgui.calc_text_size(keys).x
    draw.add_text(ImVec2(keys_left, y), u32(INK, 0.85 * alpha), keys)
    menu_left = corner.x + max(0.56 * width, em(13.5))
    menu_right = menu_left + imgui.calc_text_size(action.menu).x
    if x + em(0.5) < menu_left and menu_right + em(0.5) < (keys_left if keys else right):
        draw.add_text(
            ImVec2(menu_left, y), u32(INK if chosen else FAINT, alpha * (0.75 if chosen else 1.0)), action.menu
        )


def _draw_switch(draw: imgui.ImDrawList, corner: tuple[float, float], on: bool, alpha: float) -> None:
    """Draw a check box."""
    side = round(em(0.9))
    left, top = corner[0], corner[1] + round((imgui.get_font_size() - side) / 2.0)
    colour = u32(ACCENT if on else FAINT, alpha if on else 0.8 * alpha)
    draw.add_rect((left, top), (left + side, top + side), colour, em(0.15), thickness=max(em(0.08), 1.0))
    if on:
        imgui.internal.render_check_mark(draw, (left + 0.15 * side, top + 0.15 * side), colour, 0.7 * side)


def _runs(match: Match) -> list[tuple[str, Colour]]:
    """Return the label in runs of one colour each."""
    runs: list[tuple[str, Colour]] = []
    for i, letter in enumerate(match.action.label):
        colour = _MATCHING if i in match.letters else INK
        if runs and runs[-1][1] == colour:
            runs[-1] = (runs[-1][0] + letter, colour)
        else:
            runs.append((letter, colour))
    return runs


def _keep_cursor_at_end(data: imgui.InputTextCallbackData) -> int:
    """Undo the effect of Home and End on the cursor of the field: these keys move in the list."""
    if _pressed(imgui.Key.home) or _pressed(imgui.Key.end):
        data.cursor_pos = data.selection_start = data.selection_end = data.buf_text_len
    return 0


def _pressed(key: imgui.Key, repeat: bool = False) -> bool:
    return imgui.is_key_pressed(key, repeat)


def _pointer_moved() -> bool:
    delta = imgui.get_io().mouse_delta
    return delta.x != 0.0 or delta.y != 0.0
