"""The panel's second part: the pins, by name, with how far the face is from each."""

from dataclasses import replace
from typing import TYPE_CHECKING

from imgui_bundle import ImVec2, ImVec4, imgui

from faceposer.solve.constraints.point import PointConstraint
from faceposer.viewer.panels.widgets import action_button, button_width, caption, heading, tooltip
from faceposer.viewer.theme import FAINT, INK, WARNING, Icon, em, u32

if TYPE_CHECKING:
    from faceposer.viewer.app import App

_MOST_ROWS = 8
# Pixels from which a residual is worth a glance.
_NOTABLE = 3.0


class PointsPanel:
    """The list of pins."""

    def draw(self, app: "App") -> None:
        """Draw the part."""
        count = len(app.session.document.constraints)
        heading(app.gui.fonts, f"Points   {count}" if count else "Points")
        if not count:
            caption("Press on the face and drag: the point stays where you leave it, and the face follows.")
            return
        self._draw_rows(app, count)
        imgui.spacing()
        width = button_width(2)
        action_button(app.marks, app.actions["delete"], width, "Delete")
        imgui.same_line()
        action_button(app.marks, app.actions["clear"], width, "Clear all")

    def _draw_rows(self, app: "App", count: int) -> None:
        row = imgui.get_frame_height()
        imgui.push_style_color(imgui.Col_.button, ImVec4(0.0, 0.0, 0.0, 0.0))
        imgui.push_style_var(imgui.StyleVar_.item_spacing, ImVec2(0.0, 0.0))
        imgui.push_style_var(imgui.StyleVar_.frame_padding, ImVec2(0.0, em(0.3)))
        imgui.begin_child("##points", ImVec2(0.0, min(count, _MOST_ROWS) * row))
        residuals = app.session.residuals_px
        for i in range(count):
            imgui.push_id(i)
            removed = self._draw_row(app, i, residuals[i], row)
            imgui.pop_id()
            if removed:
                break
        imgui.end_child()
        imgui.pop_style_var(2)
        imgui.pop_style_color()

    def _draw_row(self, app: "App", index: int, residual: float, height: float) -> bool:
        """Draw one row and return whether its point was removed."""
        constraint = app.session.document.constraints[index]
        free = not app.busy
        begin, width = imgui.get_cursor_pos(), imgui.get_content_region_avail().x
        corner = imgui.get_cursor_screen_pos()
        imgui.set_next_item_allow_overlap()
        pressed, _ = imgui.selectable("##row", index in app.toolbox.selection, 0, ImVec2(width, height))
        app.marks.note(f"point:{index}")
        if imgui.is_item_hovered():
            app.highlighted = index
        if pressed and free:
            app.toolbox.select(index, extend=imgui.get_io().key_shift)

        figure = f"{residual:.1f} px"
        figure_left = corner.x + width - height - em(0.2) - imgui.calc_text_size(figure).x
        draw = imgui.get_window_draw_list()
        baseline = corner.y + (height - imgui.get_font_size()) / 2.0
        name_left = corner.x + height + em(0.2)
        draw.push_clip_rect(ImVec2(name_left, corner.y), ImVec2(figure_left - em(0.4), corner.y + height), True)
        draw.add_text(ImVec2(name_left, baseline), u32(INK if constraint.enabled else FAINT), app.point_name(index))
        draw.pop_clip_rect()
        far = residual > _NOTABLE and constraint.enabled
        draw.add_text(ImVec2(figure_left, baseline), u32(WARNING if far else FAINT), figure)

        imgui.set_cursor_pos(begin)
        if imgui.button(Icon.EYE if constraint.enabled else Icon.EYE_OFF, ImVec2(height, height)) and free:
            self._switch(app, index)
        app.marks.note(f"point:{index}:on")
        tooltip("It pulls; click to let it rest." if constraint.enabled else "It rests; click to let it pull.")
        imgui.set_cursor_pos(ImVec2(begin.x + width - height, begin.y))
        removed = imgui.button(Icon.CLOSE, ImVec2(height, height)) and free
        app.marks.note(f"point:{index}:delete")
        tooltip("Remove the point")
        imgui.set_cursor_pos(ImVec2(begin.x, begin.y + height))
        if removed:
            app.toolbox.select(index)
            app.toolbox.delete_selected()
        return removed

    def _switch(self, app: "App", index: int) -> None:
        session = app.session
        constraint = session.document.constraints[index]
        if isinstance(constraint, PointConstraint):
            with session.edit("Rest a point" if constraint.enabled else "Wake a point"):
                changed = replace(constraint, enabled=not constraint.enabled)
                session.replace(session.document.with_constraint(index, changed))
