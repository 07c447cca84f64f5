"""Basic widgets of panels."""

from collections.abc import Iterator, Sequence

from imgui_bundle import ImVec2, ImVec4, imgui

from faceposer.gui.actions import Action
from faceposer.gui.widgets.text import shortened, text_width
from faceposer.gui.widgets.theme import ACCENT_DARK, ACCENT_MID, FAINT, Fonts, em

Rectangle = tuple[float, float, float, float]


class WidgetRects:
    """Rectangles of the named widgets of the last frame, in window units: left, top, right, bottom.

    Tests and the demo use them to click on widgets.
    """

    def __init__(self) -> None:
        self._rectangles: dict[str, Rectangle] = {}

    def clear(self) -> None:
        """Remove all names, at the start of a frame."""
        self._rectangles.clear()

    def record(self, name: str) -> None:
        """Record the rectangle of the last drawn widget as ``name``."""
        low, high = imgui.get_item_rect_min(), imgui.get_item_rect_max()
        self._rectangles[name] = (low.x, low.y, high.x, high.y)

    def __contains__(self, name: str) -> bool:
        return name in self._rectangles

    def __iter__(self) -> Iterator[str]:
        return iter(self._rectangles)

    def __getitem__(self, name: str) -> Rectangle:
        return self._rectangles[name]

    def center(self, name: str) -> tuple[float, float]:
        """Return the centre of the widget ``name``.

        Raises:
            KeyError: If the last frame had no such widget.
        """
        left, top, right, bottom = self._rectangles[name]
        return ((left + right) / 2.0, (top + bottom) / 2.0)


def heading(fonts: Fonts, text: str, first: bool = False) -> None:
    """Draw the heading of a section."""
    if not first:
        imgui.dummy((0.0, em(0.35)))
        imgui.separator()
        imgui.dummy((0.0, em(0.10)))
    imgui.push_font(fonts.bold, 0.0)
    imgui.text(text)
    imgui.pop_font()


def caption(text: str) -> None:
    """Draw wrapped text in a faint colour."""
    imgui.push_style_color(imgui.Col_.text, ImVec4(*FAINT))
    imgui.text_wrapped(text)
    imgui.pop_style_color()


_TOOLTIP_GAP, _WRAP = 0.4, 24.0


def tooltip(text: str) -> None:
    """Show a tooltip for the last drawn widget, enabled or not, after the pointer has rested on it for a moment.

    The tooltip is placed next to the window that holds the widget, so that it covers no other widgets, or below the
    widget if no side has room.
    """
    flags = (
        imgui.HoveredFlags_.stationary.value
        | imgui.HoveredFlags_.delay_normal.value
        | imgui.HoveredFlags_.no_shared_delay.value
        | imgui.HoveredFlags_.allow_when_disabled.value
    )
    if not imgui.is_item_hovered(flags):
        return
    padding = imgui.get_style().window_padding
    extent = imgui.calc_text_size(text, wrap_width=em(_WRAP))
    size = (extent.x + 2.0 * padding.x, extent.y + 2.0 * padding.y)
    imgui.set_next_window_pos(ImVec2(*_tooltip_position(size)))
    if imgui.begin_tooltip():
        imgui.push_text_wrap_pos(imgui.get_cursor_pos_x() + em(_WRAP))
        imgui.text_unformatted(text)
        imgui.pop_text_wrap_pos()
        imgui.end_tooltip()


def _tooltip_position(size: tuple[float, float]) -> tuple[float, float]:
    """Return the top left corner for a tooltip of ``size`` that explains the last drawn widget."""
    view = imgui.get_main_viewport()
    window = imgui.internal.get_current_window().root_window
    low, high = imgui.get_item_rect_min(), imgui.get_item_rect_max()
    gap = em(_TOOLTIP_GAP)
    left, right = window.pos.x, window.pos.x + window.size.x
    top, bottom = window.pos.y, window.pos.y + window.size.y
    level = min(max(low.y, gap), max(view.size.y - size[1] - gap, 0.0))
    along = min(max(low.x, gap), max(view.size.x - size[0] - gap, 0.0))
    if right + gap + size[0] <= view.size.x:
        return (right + gap, level)
    if left - gap - size[0] >= 0.0:
        return (left - gap - size[0], level)
    if bottom + gap + size[1] <= view.size.y and not _is_tall(window):
        return (along, bottom + gap)
    if top - gap - size[1] >= 0.0 and not _is_tall(window):
        return (along, top - gap - size[1])
    below = high.y + gap
    return (along, below if below + size[1] <= view.size.y else max(low.y - gap - size[1], 0.0))


def _is_tall(window: imgui.internal.Window) -> bool:
    """Return True if a tooltip above or below ``window`` would be far from most of its widgets."""
    return bool(window.size.y > em(12.0))


def fitted_button(rects: WidgetRects, label: str, name: str, width: float, tip: str) -> bool:
    """Draw a button of ``width`` and return True if it was pressed.

    A label that is too wide is shortened in the middle, and shown in full in the tooltip, above ``tip``.
    """
    room = width - 2.0 * imgui.get_style().frame_padding.x
    shown = shortened(label, room)
    pressed = imgui.button(f"{shown}##{name}", (width, 0.0))
    rects.record(name)
    tooltip(tip if shown == label else f"{label}\n{tip}")
    return pressed


def button_width(count: int) -> float:
    """Return the width of each of ``count`` buttons that share a line."""
    spacing = imgui.get_style().item_spacing.x
    return max((imgui.get_content_region_avail().x - spacing * (count - 1)) / count, 1.0)


def action_button(rects: WidgetRects, action: Action, width: float, label: str = "", strong: bool = False) -> None:
    """Draw a button for ``action``, highlighted if ``strong``."""
    on = action.checked is not None and action.checked()
    if on or strong:
        _push_button_colour(ACCENT_DARK if on else ACCENT_MID)
    imgui.begin_disabled(not action.enabled())
    full = label or action.label
    room = width if width > 0.0 else imgui.get_content_region_avail().x
    padding = imgui.get_style().frame_padding
    margin = max(min(0.5 * (room - text_width(full)), padding.x), em(0.15))
    imgui.push_style_var(imgui.StyleVar_.frame_padding, ImVec2(margin, padding.y))
    pressed = imgui.button(f"{shortened(full, room - 2.0 * margin)}##{action.name}", (width, 0.0))
    imgui.pop_style_var()
    if pressed:
        action.run()
    imgui.end_disabled()
    rects.record(action.name)
    tooltip(action.tooltip)
    if on or strong:
        imgui.pop_style_color(3)


def toggle_button(label: str, on: bool, colour: tuple[float, float, float, float], width: float) -> bool:
    """Draw a button, in ``colour`` if it is ``on``, and return True if it was pressed."""
    if on:
        _push_button_colour(colour)
    pressed = imgui.button(label, (max(width, 1.0), 0.0))
    if on:
        imgui.pop_style_color(3)
    return pressed


def choice(
    rects: WidgetRects, name: str, labels: Sequence[str], chosen: int, tips: Sequence[str], by_text: bool = False
) -> int:
    """Draw a row of buttons of which one is chosen, and return the index of the chosen one.

    The buttons are equally wide or, with ``by_text``, each as wide as its label and an equal share of the remaining
    width.
    """
    gap = max(round(em(0.1)), 1)
    room = imgui.get_content_region_avail().x - gap * (len(labels) - 1)
    texts = [imgui.calc_text_size(label).x if by_text else 0.0 for label in labels]
    spare = (room - sum(texts)) / len(labels)
    style = imgui.get_style()
    # Narrower margins where labels would be cut off.
    left = min((texts[i] + spare - text_width(label) for i, label in enumerate(labels)), default=0.0)
    margin = min(0.5 * left, em(0.6) if by_text else style.frame_padding.x)
    imgui.push_style_var(imgui.StyleVar_.frame_padding, ImVec2(max(margin, 0.0), style.frame_padding.y))
    for i, label in enumerate(labels):
        if i:
            imgui.same_line(0.0, gap)
        shown = shortened(label, max(texts[i] + spare, 1.0))
        pressed = toggle_button(f"{shown}##{name}{i}", i == chosen, ACCENT_DARK, texts[i] + spare)
        rects.record(f"{name}:{i}")
        tooltip(tips[i] if shown == label else f"{label}\n{tips[i]}")
        if pressed:
            chosen = i
    imgui.pop_style_var()
    return chosen


def _push_button_colour(colour: tuple[float, float, float, float]) -> None:
    for index in (imgui.Col_.button, imgui.Col_.button_hovered, imgui.Col_.button_active):
        imgui.push_style_color(index, ImVec4(*colour))
