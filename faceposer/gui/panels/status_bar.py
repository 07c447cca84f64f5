"""The status bar: a hint for the mouse, and the result of the last solve."""

from collections.abc import Sequence

from imgui_bundle import ImVec4, imgui

from faceposer.gui.actions import HINT_SEPARATOR
from faceposer.gui.context import EditorContext
from faceposer.gui.widgets.text import Measure, displayed, text_width, truncated
from faceposer.gui.widgets.theme import ACCENT, FAINT, em
from faceposer.gui.widgets.tooltips import tooltip


def status_height() -> float:
    """Return the height of the bar."""
    return round(imgui.get_font_size() + 2.0 * em(0.42))


def draw_status_bar(context: EditorContext) -> None:
    """Draw the bar into the current window; figures that leave no room for the whole hint are left out."""
    hint, gap = context.hint(), em(1.5)
    edge = imgui.get_window_width() - imgui.get_style().window_padding.x
    imgui.set_cursor_pos_y((imgui.get_window_height() - imgui.get_font_size()) / 2.0)
    if context.edited_instead:
        star = "*" if context.session.dirty else ""
        imgui.text_colored(ImVec4(*ACCENT), truncated(f"{context.edited_instead}{star}", 0.5 * edge))
        context.widget_rects.record("status:edited")
        tooltip(f"{context.edited_instead}: Animate > Key poses shows the strip, with the way back to the session")
        imgui.same_line(0.0, gap)
    room = edge - imgui.get_cursor_pos_x()
    figures = fitting(_figures(context), room - text_width(hint) - gap, text_width)
    shown = truncated(hint, max(room, em(2.0)))
    imgui.text_unformatted(shown)
    if shown != hint:
        tooltip(hint)
    if figures:
        imgui.same_line(edge - text_width(figures))
        imgui.text_colored(FAINT, figures)


def fitting(parts: Sequence[str], width: float, measure: Measure) -> str:
    """Return the line of those ``parts`` that fit into ``width``; the first ones are left out first."""
    for first in range(len(parts)):
        line = HINT_SEPARATOR.join(parts[first:])
        if measure(line) <= width:
            return line
    return ""


def _figures(context: EditorContext) -> list[str]:
    """Return the figures, the least important first."""
    session = context.session
    parts = [displayed(session.model.character.title)]
    if session.document.constraints:
        pairs = zip(context.drawn_constraints.residuals_px, session.document.constraints, strict=True)
        known = [residual for residual, constraint in pairs if constraint.enabled and residual is not None]
        parts.append(f"residual {max(known, default=0.0):.1f} px")
    if session.solution is not None:
        parts.append(f"solved in {session.solution.seconds * 1e3:.1f} ms")
    if context.debug:
        parts.append(f"frame {context.frame_seconds * 1e3:.1f} ms")
    return parts[::-1]
