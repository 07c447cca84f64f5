"""The status bar: a hint for the mouse, and the result of the last solve."""

from imgui_bundle import imgui

from faceposer.gui.context import EditorContext
from faceposer.gui.widgets.basic import tooltip
from faceposer.gui.widgets.text import truncated
from faceposer.gui.widgets.theme import FAINT, em


def status_height() -> float:
    """Return the height of the bar."""
    return round(imgui.get_font_size() + 2.0 * em(0.42))


def draw_status_bar(context: EditorContext) -> None:
    """Draw the bar into the current window."""
    right = _figures(context)
    edge = imgui.get_window_width() - imgui.get_style().window_padding.x
    width = imgui.calc_text_size(right).x
    imgui.set_cursor_pos_y((imgui.get_window_height() - imgui.get_font_size()) / 2.0)
    left = imgui.get_cursor_screen_pos()
    end = imgui.get_window_pos().x + edge - width - em(1.5)
    hint = context.hint()
    shown = truncated(hint, max(end - left.x, em(2.0)))
    imgui.text_unformatted(shown)
    if shown != hint:
        tooltip(hint)
    if edge - width > em(8):
        imgui.same_line(edge - width)
        imgui.text_colored(FAINT, right)


def _figures(context: EditorContext) -> str:
    session = context.session
    parts = [session.model.character.title]
    if session.document.constraints:
        worst = max(
            (r for r, c in zip(session.residuals_px, session.document.constraints, strict=True) if c.enabled),
            default=0.0,
        )
        parts.append(f"residual {worst:.1f} px")
    if session.solution is not None:
        parts.append(f"solved in {session.solution.seconds * 1e3:.1f} ms")
    if context.debug:
        parts.append(f"frame {context.frame_seconds * 1e3:.1f} ms")
    return "   ·   ".join(reversed(parts))
