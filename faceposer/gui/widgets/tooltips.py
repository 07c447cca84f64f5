"""Tooltips, placed where they cover nothing that can be pressed."""

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass

from imgui_bundle import ImVec2, imgui

from faceposer.gui.widgets.text import displayed
from faceposer.gui.widgets.theme import em
from faceposer.gui.widgets.widget_rects import Rectangle, WidgetRects, overlap

Size = tuple[float, float]

# In units of the font size: gap to the widget, height from which a window is tall, distance from a widget up to which a
# place beside its modal window is near, widths to try.
_GAP, _TALL, _NEAR = 0.4, 12.0, 4.0
_WIDTHS = (24.0, 14.0, 9.0)


@dataclass(frozen=True)
class _Request:
    """A tooltip to be drawn at the end of the frame: its text, and the rectangles of the widget and its window.

    Attributes:
        modal: Id of the window if it is modal: nothing behind it can be pressed.
    """

    text: str
    item: Rectangle
    window: Rectangle
    modal: int | None


_requests: list[_Request] = []


def tooltip(text: str) -> None:
    """Show a tooltip for the last drawn widget, enabled or not, after the pointer has rested on it for a moment."""
    flags = (
        imgui.HoveredFlags_.stationary.value
        | imgui.HoveredFlags_.delay_normal.value
        | imgui.HoveredFlags_.no_shared_delay.value
        | imgui.HoveredFlags_.allow_when_disabled.value
    )
    if not text or not imgui.is_item_hovered(flags):
        return
    window = imgui.internal.get_current_window().root_window
    low, high = imgui.get_item_rect_min(), imgui.get_item_rect_max()
    around = (window.pos.x, window.pos.y, window.pos.x + window.size.x, window.pos.y + window.size.y)
    modal = window.id_ if window.flags & imgui.WindowFlags_.modal.value else None
    _requests.append(_Request(displayed(text), (low.x, low.y, high.x, high.y), around, modal))


def draw_tooltip(rects: WidgetRects) -> None:
    """Draw the tooltip of this frame, if any, after all widgets: only then is it known what it must not cover."""
    if not _requests:
        return
    request = _requests[-1]
    _requests.clear()
    padding, view = imgui.get_style().window_padding, imgui.get_main_viewport().size
    unit = em()

    def measured(width: float) -> Size:
        extent = imgui.calc_text_size(request.text, wrap_width=width - 2.0 * padding.x)
        return (extent.x + 2.0 * padding.x, extent.y + 2.0 * padding.y)

    obstacles = [rect for rect in rects.pressable(request.modal) if rect != request.item]
    # Around a modal window all is dimmed: a tooltip there would be taken for another window's.
    near = math.inf if request.modal is None else _NEAR * unit
    placed = tooltip_place(request.item, request.window, (view.x, view.y), obstacles, measured, unit, near)
    if placed is None:
        return
    position, width = placed
    imgui.set_next_window_pos(ImVec2(*position))
    if imgui.begin_tooltip():
        imgui.push_text_wrap_pos(imgui.get_cursor_pos_x() + width - 2.0 * padding.x)
        imgui.text_unformatted(request.text)
        imgui.pop_text_wrap_pos()
        imgui.end_tooltip()


def tooltip_place(
    item: Rectangle,
    window: Rectangle,
    view: Size,
    obstacles: Iterable[Rectangle],
    measured: Callable[[float], Size],
    unit: float,
    near: float = math.inf,
) -> tuple[tuple[float, float], float] | None:
    """Return the top left corner and the maximum width of a tooltip, or None if it would cover what can be pressed.

    Beside the window comes first, on the side that is nearer to the widget, unless that is farther away than ``near``;
    then above or below the window, unless it is tall; then directly below, above or beside the widget; at last beside
    the window, however far.

    Args:
        item: The widget.
        window: The window that holds it.
        view: Width and height of the operating system's window.
        obstacles: Widgets that must not be covered, besides ``item``.
        measured: Returns the size of the tooltip for a maximum width.
        unit: Size of the font.
        near: Distance from the widget up to which a place beside the window comes first.
    """
    gap, covered = _GAP * unit, [item, *obstacles]
    candidates: list[tuple[float, float, float]] = []

    def beside(box: Rectangle) -> list[tuple[float, float, float]]:
        """Return left edge, top edge and maximum width at the left and at the right of ``box``, the nearer first."""
        places = []
        for order, units in enumerate(_WIDTHS):
            for room, right in ((view[0] - box[2] - 2.0 * gap, True), (box[0] - 2.0 * gap, False)):
                size = measured(width := units * unit)
                if size[0] > room:
                    continue
                level = min(max(item[1], gap), max(view[1] - size[1] - gap, 0.0))
                away = box[2] - item[2] if right else item[0] - box[0]
                places.append(((order, away), (box[2] + gap if right else box[0] - gap - size[0], level, width)))
        return [place for _, place in sorted(places, key=lambda found: found[0])]

    def stacked(box: Rectangle) -> list[tuple[float, float, float]]:
        """Return the places below and above ``box``, wide and narrow."""
        places = []
        for units in _WIDTHS:
            width = min(units * unit, view[0] - 2.0 * gap)
            size = measured(width)
            along = min(max(item[0], gap), max(view[0] - size[0] - gap, 0.0))
            places += [(along, box[3] + gap, width), (along, box[1] - gap - size[1], width)]
        return places

    around = beside(window)
    far = [place for place in around if (place[0] - item[2] if place[0] > item[2] else item[0] - window[0]) > near]
    candidates += [place for place in around if place not in far]
    if window[3] - window[1] <= _TALL * unit:
        candidates += stacked(window)
    candidates += [*stacked(item), *beside(item), *far]
    for left, top, width in candidates:
        wide, tall = measured(width)
        box = (left, top, left + wide, top + tall)
        inside = left >= 0.0 and top >= 0.0 and box[2] <= view[0] and box[3] <= view[1]
        if inside and not any(overlap(box, other) for other in covered):
            return (left, top), width
    return None
