"""The list of constraints: what each is, where, how far the face is from it, and what can be set."""

from dataclasses import replace
from typing import Any

from imgui_bundle import ImVec2, ImVec4, imgui

from faceposer.gui.context import EditorContext
from faceposer.gui.panels.details import draw_details
from faceposer.gui.panels.tool_bar import TOOL_ICONS
from faceposer.gui.widgets.basic import action_button, button_width, caption, heading, tooltip
from faceposer.gui.widgets.theme import FAINT, INK, WARNING, Icon, em, u32
from faceposer.solve.conflicts import NOTABLE_PX
from faceposer.solve.constraints.registry import Constraint

_MOST_ROWS = 8


class ConstraintsPanel:
    """The list, and the details of the one that is selected."""

    def draw(self, context: EditorContext) -> None:
        """Draw the part."""
        count = len(context.session.document.constraints)
        heading(context.fonts, f"Constraints   {count}" if count else "Constraints")
        if not count:
            caption("Press on the face and drag: the point stays where you leave it, and the face follows.")
            return
        self._draw_rows(context, count)
        imgui.spacing()
        width = button_width(2)
        action_button(context.widget_rects, context.actions["delete"], width, "Delete")
        imgui.same_line()
        action_button(context.widget_rects, context.actions["clear"], width, "Clear all")
        selected = sorted(context.toolbox.selection)
        if len(selected) == 1:
            imgui.spacing()
            draw_details(context, selected[0])

    def _draw_rows(self, context: EditorContext, count: int) -> None:
        row = imgui.get_frame_height()
        imgui.push_style_color(imgui.Col_.button, ImVec4(0.0, 0.0, 0.0, 0.0))
        imgui.push_style_var(imgui.StyleVar_.item_spacing, ImVec2(0.0, 0.0))
        imgui.push_style_var(imgui.StyleVar_.frame_padding, ImVec2(0.0, em(0.3)))
        imgui.begin_child("##constraints", ImVec2(0.0, min(count, _MOST_ROWS) * row))
        residuals = context.session.residuals_px
        for i in range(count):
            imgui.push_id(i)
            removed = self._draw_row(context, i, residuals[i], row)
            imgui.pop_id()
            if removed:
                break
        imgui.end_child()
        imgui.pop_style_var(2)
        imgui.pop_style_color()

    def _draw_row(self, context: EditorContext, index: int, residual: float, height: float) -> bool:
        """Draw one row and return whether its constraint was removed."""
        constraint = context.session.document.constraints[index]
        free = not context.busy
        begin, width = imgui.get_cursor_pos(), imgui.get_content_region_avail().x
        corner = imgui.get_cursor_screen_pos()
        imgui.set_next_item_allow_overlap()
        lit = index in context.toolbox.selection or (
            context.toolbox.hover is not None and context.toolbox.hover.pin == index
        )
        pressed, _ = imgui.selectable("##row", lit, 0, ImVec2(width, height))
        context.widget_rects.record(f"point:{index}")
        if imgui.is_item_hovered():
            context.highlighted = index
        if pressed and free:
            context.toolbox.select(index, extend=imgui.get_io().key_shift)
        conflict = context.drawn_constraints.conflicts.get(index)
        name = f"{constraint.noun.capitalize()}: {context.point_name(index)}"
        tooltip(name if conflict is None else f"{name}. {conflict}")
        self._draw_text(context, index, constraint, residual, (corner.x, corner.y, width, height))

        self._switch(context, index, constraint, begin, height, free)
        left = begin.x + width - 2.0 * height
        imgui.set_cursor_pos(ImVec2(left, begin.y))
        imgui.push_style_color(imgui.Col_.text, ImVec4(*(INK if constraint.locked else (*FAINT[:3], 0.55))))
        if imgui.button(Icon.LOCK if constraint.locked else Icon.UNLOCK, ImVec2(height, height)) and free:
            self._change(context, index, "Unlock" if constraint.locked else "Lock", locked=not constraint.locked)
        imgui.pop_style_color()
        context.widget_rects.record(f"point:{index}:lock")
        tooltip("Locked; click to let it be moved." if constraint.locked else "Lock it: only a reset removes it then.")
        imgui.set_cursor_pos(ImVec2(left + height, begin.y))
        imgui.begin_disabled(constraint.locked)
        removed = imgui.button(Icon.CLOSE, ImVec2(height, height)) and free
        imgui.end_disabled()
        context.widget_rects.record(f"point:{index}:delete")
        tooltip("Remove it")
        imgui.set_cursor_pos(ImVec2(begin.x, begin.y + height))
        if removed:
            context.toolbox.select(index)
            context.toolbox.delete_selected()
        return removed

    def _draw_text(
        self,
        context: EditorContext,
        index: int,
        constraint: Constraint,
        residual: float,
        box: tuple[float, float, float, float],
    ) -> None:
        left, top, width, height = box
        figure = f"{residual:.1f} px"
        right = left + width - 2.0 * height - em(0.1)
        figure_left = right - imgui.calc_text_size(figure).x
        draw = imgui.get_window_draw_list()
        baseline = top + (height - imgui.get_font_size()) / 2.0
        tint = INK if constraint.enabled else FAINT
        draw.add_text(ImVec2(left + height + em(0.1), baseline), u32(tint, 0.75), TOOL_ICONS[constraint.icon])
        name_left = left + height + em(1.5)
        fights = index in context.drawn_constraints.conflicts
        if fights:
            figure_left -= em(1.0)
        draw.push_clip_rect(ImVec2(name_left, top), ImVec2(figure_left - em(0.3), top + height), True)
        draw.add_text(ImVec2(name_left, baseline), u32(tint), context.point_name(index))
        draw.pop_clip_rect()
        far = residual > NOTABLE_PX and constraint.enabled
        text = f"{Icon.FIGHT} {figure}" if fights else figure
        draw.add_text(ImVec2(figure_left, baseline), u32(WARNING if far else FAINT), text)

    def _switch(
        self, context: EditorContext, index: int, constraint: Constraint, begin: ImVec2, height: float, free: bool
    ) -> None:
        imgui.set_cursor_pos(begin)
        if imgui.button(Icon.EYE if constraint.enabled else Icon.EYE_OFF, ImVec2(height, height)) and free:
            self._change(
                context, index, "Let it rest" if constraint.enabled else "Wake it", enabled=not constraint.enabled
            )
        context.widget_rects.record(f"point:{index}:on")
        tooltip("It pulls; click to let it rest." if constraint.enabled else "It rests; click to let it pull.")

    def _change(self, context: EditorContext, index: int, label: str, **switches: Any) -> None:
        constraint: Any = context.session.document.constraints[index]
        context.session.change_constraint(index, replace(constraint, **switches), label)
