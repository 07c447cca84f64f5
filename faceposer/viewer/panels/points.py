"""The panel's second part: the pins, by name, with how far the face is from each."""

from dataclasses import replace
from typing import TYPE_CHECKING

from imgui_bundle import ImVec4, imgui

from faceposer.solve.constraints.point import PointConstraint
from faceposer.viewer.panels.widgets import action_button, button_width, caption, heading, tooltip
from faceposer.viewer.theme import FAINT, INK, WARNING, Icon, em

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
        self._draw_rows(app)
        width = button_width(2)
        action_button(app.marks, app.actions["delete"], width, "Delete")
        imgui.same_line()
        action_button(app.marks, app.actions["clear"], width, "Clear all")

    def _draw_rows(self, app: "App") -> None:
        constraints = app.session.document.constraints
        flags = imgui.TableFlags_.row_bg.value
        height = 0.0
        if len(constraints) > _MOST_ROWS:
            flags |= imgui.TableFlags_.scroll_y.value
            height = _MOST_ROWS * imgui.get_frame_height_with_spacing()
        imgui.push_style_var(imgui.StyleVar_.cell_padding, (em(0.1), em(0.1)))
        shown = imgui.begin_table("##points", 4, flags, (0.0, height))
        imgui.pop_style_var()
        if not shown:
            return
        fixed = imgui.TableColumnFlags_.width_fixed.value
        imgui.table_setup_column("on", fixed, em(1.5))
        imgui.table_setup_column("name", imgui.TableColumnFlags_.width_stretch.value)
        imgui.table_setup_column("residual", fixed, em(3.6))
        imgui.table_setup_column("delete", fixed, em(1.5))
        residuals = app.session.residuals_px
        for i in range(len(constraints)):
            imgui.table_next_row()
            imgui.push_id(i)
            removed = self._draw_row(app, i, residuals[i])
            imgui.pop_id()
            if removed:
                break
        imgui.end_table()

    def _draw_row(self, app: "App", index: int, residual: float) -> bool:
        """Draw one row and return whether its point was removed."""
        constraint = app.session.document.constraints[index]
        free = not app.busy
        imgui.push_style_color(imgui.Col_.button, ImVec4(0.0, 0.0, 0.0, 0.0))
        imgui.table_next_column()
        imgui.set_next_item_allow_overlap()
        if imgui.button(Icon.EYE if constraint.enabled else Icon.EYE_OFF, (em(1.7), 0.0)) and free:
            self._switch(app, index)
        app.marks.note(f"point:{index}:on")
        tooltip("It pulls; click to let it rest." if constraint.enabled else "It rests; click to let it pull.")

        imgui.table_next_column()
        imgui.push_style_color(imgui.Col_.text, ImVec4(*(INK if constraint.enabled else FAINT)))
        imgui.align_text_to_frame_padding()
        name = app.point_name(index)
        height = imgui.get_frame_height()
        row = imgui.SelectableFlags_.span_all_columns | imgui.SelectableFlags_.allow_overlap
        pressed, _ = imgui.selectable(name, index in app.toolbox.selection, row, (0.0, height))
        imgui.pop_style_color()
        app.marks.note(f"point:{index}")
        if imgui.is_item_hovered():
            app.highlighted = index
        if pressed and free:
            app.toolbox.select(index, extend=imgui.get_io().key_shift)

        imgui.table_next_column()
        imgui.align_text_to_frame_padding()
        text = f"{residual:.1f} px"
        imgui.set_cursor_pos_x(
            imgui.get_cursor_pos_x() + max(imgui.get_content_region_avail().x - imgui.calc_text_size(text).x, 0.0)
        )
        colour = WARNING if residual > _NOTABLE and constraint.enabled else FAINT
        imgui.text_colored(colour, text)
        tooltip("How far the face is from the point, in pixels of the view that it was made in.")

        imgui.table_next_column()
        removed = imgui.button(Icon.CLOSE, (em(1.7), 0.0)) and free
        app.marks.note(f"point:{index}:delete")
        tooltip("Remove the point")
        imgui.pop_style_color()
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
