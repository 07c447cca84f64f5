"""Sliders, with the number beside the handle, and their rows: label, slider and reset button."""

import math
import re

from imgui_bundle import ImVec2, ImVec4, imgui

from faceposer.gui.widgets.text import text_width
from faceposer.gui.widgets.theme import Icon, em
from faceposer.gui.widgets.tooltips import tooltip
from faceposer.gui.widgets.widget_rects import WidgetRects

_CLEAR = ImVec4(0.0, 0.0, 0.0, 0.0)
#: Width of the column of labels, and of a button that resets a slider, in units of the font size.
LABEL_WIDTH, RESET_WIDTH = 6.6, 1.8
# Largest share of a row for its label.
_SHARE = 0.45
# Gap between a number and the end of its slider.
_MARGIN = 0.4
# Space that Dear ImGui leaves at both ends of a slider, in pixels.
_PADDING = 2.0


def row_label(text: str, tip: str = "", width: float = LABEL_WIDTH) -> None:
    """Draw the label of a row, with the tooltip ``tip``; the next widget begins ``width`` font sizes further right.

    In a narrow window the label has less than half of the row.
    """
    left, whole = imgui.get_cursor_pos_x(), imgui.get_content_region_avail().x
    imgui.align_text_to_frame_padding()
    imgui.text_unformatted(text)
    tooltip(tip)
    imgui.same_line(left + min(em(width), _SHARE * whole))


def slider(label: str, value: float, low: float, high: float, form: str, flags: int = 0) -> tuple[bool, float]:
    """Draw a slider as ``imgui.slider_float`` does, with its number at the end that the handle leaves free.

    Returns:
        True if the value has changed, and the value.
    """
    corner, width = imgui.get_cursor_screen_pos(), imgui.calc_item_width()
    typing = imgui.internal.temp_input_is_active(imgui.get_id(label))
    if not typing:
        imgui.push_style_color(imgui.Col_.text, _CLEAR)
    changed, new = imgui.slider_float(label, value, low, high, form, flags)
    if typing:
        return changed, new
    imgui.pop_style_color()
    logarithmic = bool(flags & imgui.SliderFlags_.logarithmic.value)
    text = form % new if "%" in form else form
    share = handle_share(new, low, high, _decimals(form) if logarithmic else None)
    left = number_left(share, width, text_width(text), em(_MARGIN))
    draw, top = imgui.get_window_draw_list(), corner.y + imgui.get_style().frame_padding.y
    colour = imgui.get_color_u32(imgui.Col_.text)
    draw.add_text(ImVec2(corner.x + left, top), colour, text)
    title = label.partition("##")[0]
    if title:
        draw.add_text(ImVec2(corner.x + width + imgui.get_style().item_inner_spacing.x, top), colour, title)
    return changed, new


def handle_share(value: float, low: float, high: float, decimals: int | None) -> float:
    """Return the position of the handle, 0 to 1, for ``value`` between ``low`` and ``high``.

    Args:
        value: The value.
        low: Minimum.
        high: Maximum, greater than ``low``.
        decimals: Digits after the point of a logarithmic scale, whose least value stands for 0; None if linear.
    """
    if decimals is None:
        return min(max((value - low) / max(high - low, 1e-12), 0.0), 1.0)
    least = max(low, 0.1**decimals)
    return min(max(math.log(max(value, least) / least) / math.log(high / least), 0.0), 1.0)


def number_left(share: float, width: float, text: float, margin: float) -> float:
    """Return the left edge, within a slider of ``width``, of a number of width ``text`` beside the handle."""
    grab = imgui.get_style().grab_min_size
    handle = _PADDING + share * (width - 2.0 * _PADDING - grab)
    left_room, right_room = handle - margin, width - handle - grab - margin
    return margin if left_room > right_room else max(width - margin - text, handle + grab)


def reset_button(rects: WidgetRects, name: str, at_default: bool, tip: str) -> bool:
    """Draw the button that resets the slider ``name`` at its left, greyed if there is nothing to reset."""
    imgui.same_line()
    imgui.begin_disabled(at_default)
    imgui.push_style_var(imgui.StyleVar_.frame_padding, ImVec2(0.0, imgui.get_style().frame_padding.y))
    pressed = imgui.button(f"{Icon.UNDO}##{name}:reset", (em(RESET_WIDTH), 0.0))
    imgui.pop_style_var()
    imgui.end_disabled()
    rects.record(f"{name}:reset")
    tooltip(tip)
    return bool(pressed)


def slider_room() -> float:
    """Return the item width, to be set before a slider, that leaves room for its reset button."""
    return -(em(RESET_WIDTH) + imgui.get_style().item_spacing.x)


def _decimals(form: str) -> int:
    found = re.search(r"%\.(\d+)", form)
    return int(found.group(1)) if found else 3
