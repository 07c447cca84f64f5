"""The list of constraints: kind, location and residual of each, switches, and the settings of the selected one."""

from dataclasses import dataclass, replace
from typing import Any

from imgui_bundle import ImVec2, ImVec4, imgui

from faceposer.gui.context import EditorContext
from faceposer.gui.panels.details import draw_details
from faceposer.gui.panels.tool_bar import TOOL_ICONS
from faceposer.gui.widgets.basic import action_button, button_width, caption, heading
from faceposer.gui.widgets.text import text_width, wrapped
from faceposer.gui.widgets.theme import FAINT, INK, WARNING, Icon, em, u32
from faceposer.gui.widgets.tooltips import tooltip
from faceposer.solve.constraints.registry import Constraint

# Rows that are always shown; more are if the panel has room.
_LEAST_ROWS = 4
# Height of the buttons and settings below the list until they have been drawn, in units of the font size.
_BELOW = 7.5
# In units of the font size: side of a row's buttons, width of the icon, padding above and below the text.
_BUTTON, _ICON, _PAD = 1.45, 1.4, 0.3


@dataclass(frozen=True)
class _Row:
    """Content and height of a row."""

    constraint: Constraint
    lines: list[str]
    residual_text: str
    residual: float
    height: float


class ConstraintsPanel:
    """The list of constraints, and the settings of the selected one."""

    def __init__(self) -> None:
        # Selection and height of the list when it was scrolled last.
        self._revealed: tuple[frozenset[int], float] = (frozenset(), 0.0)
        # Height of what was drawn below the list last.
        self._below: float | None = None

    def draw(self, context: EditorContext) -> None:
        """Draw the panel."""
        count = len(context.session.document.constraints)
        heading(context.fonts, f"Constraints   {count}" if count else "Constraints")
        if not count:
            caption(context.toolbox.chosen.empty_text)
            return
        self._draw_rows(context)
        begin = imgui.get_cursor_pos().y
        imgui.spacing()
        width = button_width(2)
        reason = "The selection is locked; unlock it first." if context.toolbox.selection else "Nothing is selected."
        action_button(context.widget_rects, context.actions["delete"], width, "Remove", reason=reason)
        imgui.same_line()
        action_button(context.widget_rects, context.actions["clear"], width, "Remove all")
        selected = sorted(context.toolbox.selection)
        if len(selected) == 1:
            imgui.spacing()
            draw_details(context, selected[0])
        below = imgui.get_cursor_pos().y - begin
        if below != self._below:
            # The list takes the room that is left.
            self._below = below
            context.redraw()

    def _rows(self, context: EditorContext, width: float) -> list[_Row]:
        """Return the rows of a list of ``width``; a name that is too long for one line takes two."""
        rows = []
        residuals = context.drawn_constraints.residuals_px
        for i, constraint in enumerate(context.session.document.constraints):
            sign = f"{Icon.CONFLICT} " if i in context.drawn_constraints.conflicts else ""
            residual = residuals[i]
            # Until a new constraint is solved, its residual would be that of a pose that does not know it.
            residual_text = "" if residual is None else f"{sign}{residual:.1f} px"
            room = width - em(4.0 * _BUTTON + _ICON + 0.5) - text_width(residual_text)
            lines = wrapped(context.point_name(i), room)
            height = len(lines) * imgui.get_text_line_height() + 2.0 * em(_PAD)
            rows.append(_Row(constraint, lines, residual_text, residual or 0.0, round(height)))
        return rows

    def _draw_rows(self, context: EditorContext) -> None:
        imgui.push_style_color(imgui.Col_.button, ImVec4(0.0, 0.0, 0.0, 0.0))
        imgui.push_style_var(imgui.StyleVar_.item_spacing, ImVec2(0.0, 0.0))
        imgui.push_style_var(imgui.StyleVar_.frame_padding, ImVec2(0.0, em(_PAD)))
        # Room for the scroll bar is always reserved, so that rows do not change when it appears.
        rows = self._rows(context, imgui.get_content_region_avail().x - imgui.get_style().scrollbar_size)
        whole = sum(row.height for row in rows)
        least = sum(row.height for row in rows[:_LEAST_ROWS])
        below = em(_BELOW) if self._below is None else self._below
        height = min(whole, max(imgui.get_content_region_avail().y - below, least))
        imgui.begin_child("##constraints", ImVec2(0.0, height))
        selection = frozenset(context.toolbox.selection)
        seen, at_height = self._revealed
        new = selection if height < at_height else selection - seen
        self._revealed = (selection, height)
        for i, row in enumerate(rows):
            if i in new:
                _reveal(imgui.get_cursor_pos().y, row.height)
            imgui.push_id(i)
            removed = self._draw_row(context, i, row)
            imgui.pop_id()
            if removed:
                break
        imgui.end_child()
        imgui.pop_style_var(2)
        imgui.pop_style_color()

    def _draw_row(self, context: EditorContext, index: int, row: _Row) -> bool:
        """Draw a row and return True if its constraint was removed."""
        constraint, free = row.constraint, not context.busy
        begin, width = imgui.get_cursor_pos(), imgui.get_content_region_avail().x
        corner = imgui.get_cursor_screen_pos()
        imgui.set_next_item_allow_overlap()
        highlighted = index in context.toolbox.selection or (
            context.toolbox.hover is not None and context.toolbox.hover.pin == index
        )
        pressed, _ = imgui.selectable("##row", highlighted, 0, ImVec2(width, row.height))
        context.widget_rects.record(f"point:{index}")
        if imgui.is_item_hovered():
            context.highlighted = index
        if pressed and free:
            context.toolbox.select(index, extend=imgui.get_io().key_shift)
        conflict = context.drawn_constraints.conflicts.get(index)
        name = f"{constraint.noun.capitalize()}: {context.point_name(index)}"
        tooltip(name if conflict is None else f"{name}\n{conflict}")
        self._draw_text(row, (corner.x, corner.y, width))
        self._draw_enabled(context, index, constraint, (begin.x, begin.y, row.height), free)
        left = begin.x + width - 3.0 * em(_BUTTON)
        self._draw_visible(context, index, (left, begin.y, row.height))
        left += em(_BUTTON)
        icon = Icon.LOCK if constraint.locked else Icon.UNLOCK
        if self._small_button(icon, constraint.locked, left, begin.y, row) and free:
            self._change(context, index, "Unlock" if constraint.locked else "Lock", locked=not constraint.locked)
        context.widget_rects.record(f"point:{index}:lock")
        tooltip("Locked; click to unlock" if constraint.locked else "Lock, so that it can be neither moved nor removed")
        left += em(_BUTTON)
        imgui.begin_disabled(constraint.locked)
        removed = self._small_button(Icon.CLOSE, True, left, begin.y, row) and free
        imgui.end_disabled()
        context.widget_rects.record(f"point:{index}:delete")
        tooltip("Remove\nThis constraint is locked; unlock it first." if constraint.locked else "Remove")
        imgui.set_cursor_pos(ImVec2(begin.x, begin.y + row.height))
        if removed:
            context.toolbox.select(index)
            context.toolbox.delete_selected()
        return removed

    def _small_button(self, icon: str, bright: bool, left: float, top: float, row: _Row) -> bool:
        imgui.set_cursor_pos(ImVec2(left, top))
        imgui.push_style_color(imgui.Col_.text, ImVec4(*(INK if bright else (*FAINT[:3], 0.55))))
        pressed = imgui.button(icon, ImVec2(em(_BUTTON), row.height))
        imgui.pop_style_color()
        return bool(pressed)

    def _draw_text(self, row: _Row, box: tuple[float, float, float]) -> None:
        """Draw icon, name and residual of ``row`` into ``box``: left, top, width."""
        left, top, width = box
        right = left + width - em(3.0 * _BUTTON + 0.1)
        draw = imgui.get_window_draw_list()
        line = imgui.get_text_line_height()
        middle = top + (row.height - imgui.get_font_size()) / 2.0
        tint = INK if row.constraint.enabled else FAINT
        left += em(_BUTTON + 0.1)
        draw.add_text(ImVec2(left, middle), u32(tint, 0.75), TOOL_ICONS[row.constraint.icon])
        for n, text in enumerate(row.lines):
            draw.add_text(ImVec2(left + em(_ICON), top + em(_PAD) + n * line), u32(tint), text)
        far = row.constraint.enabled and row.residual > row.constraint.notable_px
        draw.add_text(
            ImVec2(right - text_width(row.residual_text), middle), u32(WARNING if far else FAINT), row.residual_text
        )

    def _draw_enabled(
        self,
        context: EditorContext,
        index: int,
        constraint: Constraint,
        place: tuple[float, float, float],
        free: bool,
    ) -> None:
        left, top, height = place
        imgui.set_cursor_pos(ImVec2(left, top))
        imgui.push_style_color(imgui.Col_.text, ImVec4(*(INK if constraint.enabled else (*FAINT[:3], 0.55))))
        pressed = imgui.button(Icon.POWER, ImVec2(em(_BUTTON), height))
        imgui.pop_style_color()
        if pressed and free:
            label = "Disable a constraint" if constraint.enabled else "Enable a constraint"
            self._change(context, index, label, enabled=not constraint.enabled)
        context.widget_rects.record(f"point:{index}:on")
        tooltip("Enabled; click to disable" if constraint.enabled else "Disabled; click to enable")

    def _draw_visible(self, context: EditorContext, index: int, place: tuple[float, float, float]) -> None:
        """Draw the switch that hides the mark of the constraint in the view; the constraint remains in effect."""
        left, top, height = place
        constraints, marks = context.session.document.constraints, context.drawn_constraints.hidden
        shown = index not in marks.indices(constraints)
        imgui.set_cursor_pos(ImVec2(left, top))
        imgui.push_style_color(imgui.Col_.text, ImVec4(*((*FAINT[:3], 0.55) if shown else INK)))
        if imgui.button(Icon.EYE if shown else Icon.EYE_OFF, ImVec2(em(_BUTTON), height)):
            marks.toggle(index, constraints)
        imgui.pop_style_color()
        context.widget_rects.record(f"point:{index}:visible")
        tooltip("Visible; click to hide in the view" if shown else "Hidden; click to show in the view")

    def _change(self, context: EditorContext, index: int, label: str, **switches: Any) -> None:
        constraint: Any = context.session.document.constraints[index]
        context.session.change_constraint(index, replace(constraint, **switches), label)


def _reveal(top: float, height: float) -> None:
    """Scroll the current window to the row at ``top``, if it is not visible."""
    scroll, room = imgui.get_scroll_y(), imgui.get_window_height()
    if top < scroll:
        imgui.set_scroll_y(top)
    elif top + height > scroll + room:
        imgui.set_scroll_y(top + height - room)
