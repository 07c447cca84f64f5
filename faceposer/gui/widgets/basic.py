"""Basic widgets of panels."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager

from imgui_bundle import ImVec2, ImVec4, imgui

from faceposer.gui.actions import Action
from faceposer.gui.widgets.text import displayed, shortened, text_width
from faceposer.gui.widgets.theme import ACCENT_DARK, ACCENT_MID, FAINT, FIELD, RAISED, Fonts, em
from faceposer.gui.widgets.tooltips import tooltip
from faceposer.gui.widgets.widget_rects import WidgetRects


def heading(fonts: Fonts, text: str, first: bool = False) -> None:
    """Draw the heading of a section."""
    if not first:
        imgui.dummy((0.0, em(0.35)))
        imgui.separator()
        imgui.dummy((0.0, em(0.10)))
    imgui.push_font(fonts.bold, 0.0)
    imgui.text_unformatted(displayed(text))
    imgui.pop_font()


def section(label: str, flags: int = 0) -> bool:
    """Draw a header that opens and closes a section, and return True if it is open."""
    imgui.push_style_color(imgui.Col_.header, ImVec4(*FIELD))
    imgui.push_style_color(imgui.Col_.header_hovered, ImVec4(*RAISED))
    opened = imgui.collapsing_header(label, flags)
    imgui.pop_style_color(2)
    return bool(opened)


def caption(text: str) -> None:
    """Draw wrapped text in a faint colour."""
    imgui.push_style_color(imgui.Col_.text, ImVec4(*FAINT))
    wrapped_text(text)
    imgui.pop_style_color()


def wrapped_text(text: str) -> None:
    """Draw ``text``, which may hold names of files, in lines that fit the window."""
    imgui.text_wrapped(displayed(text))


def text_field(label: str, value: str, hint: str = "", flags: int = 0) -> tuple[bool, str]:
    """Draw a field for a line of text; return True if Enter was pressed (with that flag), and the text.

    A ``value`` that cannot be displayed, such as a path that is not UTF-8, is kept until the user edits it.
    """
    shown = displayed(value, label=False)
    entered, typed = imgui.input_text_with_hint(label, hint, shown, flags)
    return entered, value if typed == shown else typed


@contextmanager
def disabled(when: bool) -> Iterator[None]:
    """Draw the widgets of the block disabled, if ``when``; what the block raises leaves no widget disabled."""
    imgui.begin_disabled(when)
    try:
        yield
    finally:
        imgui.end_disabled()


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


def action_button(
    rects: WidgetRects, action: Action, width: float, label: str = "", strong: bool = False, reason: str = ""
) -> None:
    """Draw a button for ``action``, highlighted if ``strong``; its tooltip gives the ``reason`` if it is disabled."""
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
    tooltip(f"{action.tooltip}\n{reason}" if reason and not action.enabled() else action.tooltip)
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
