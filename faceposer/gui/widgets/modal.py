"""Modal windows: frame, title and buttons, and the progress of a job."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager

from imgui_bundle import imgui

from faceposer.gui.widgets.basic import WidgetRects, caption
from faceposer.gui.widgets.theme import ACCENT_DARK, BAD, Fonts, Icon, em
from faceposer.session.jobs import Job

_FLAGS = (
    imgui.WindowFlags_.no_title_bar
    | imgui.WindowFlags_.no_resize
    | imgui.WindowFlags_.no_move
    | imgui.WindowFlags_.always_auto_resize
    | imgui.WindowFlags_.no_saved_settings
)


@contextmanager
def modal(name: str, width: float, scrolls: bool = True, widens: bool = False) -> Iterator[bool]:
    """Open the modal window ``name`` in the middle; the block draws its content if the value is True.

    Args:
        name: Identifier for Dear ImGui, beginning with "##".
        width: Width in units of the font size, at most that of the window.
        scrolls: True if a scroll bar appears when the content is too high for the window.
        widens: True if the modal window grows with content wider than ``width``.
    """
    if not imgui.is_popup_open(name):
        imgui.open_popup(name)
    view = imgui.get_main_viewport()
    across = min(em(width), view.size.x - em(1))
    imgui.set_next_window_pos(view.get_center(), imgui.Cond_.always, (0.5, 0.5))
    imgui.set_next_window_size_constraints((across, 0.0), (view.size.x if widens else across, view.size.y))
    imgui.push_style_var(imgui.StyleVar_.window_padding, (em(1.4), em(1.2)))
    flags = _FLAGS if scrolls else _FLAGS | imgui.WindowFlags_.no_scrollbar
    shown = imgui.begin_popup_modal(name, None, flags)[0]
    imgui.pop_style_var()
    try:
        yield shown
    finally:
        if shown:
            imgui.end_popup()


def modal_title(fonts: Fonts, text: str, bad: bool = False) -> None:
    """Draw the title of a modal window, with a warning sign if ``bad``."""
    if bad:
        imgui.text_colored(BAD, Icon.WARNING)
        imgui.same_line()
    imgui.push_font(fonts.bold, 0.0)
    imgui.text_unformatted(text)
    imgui.pop_font()
    imgui.dummy((0.0, em(0.2)))


def modal_buttons(
    rects: WidgetRects, prefix: str, buttons: Sequence[tuple[str, str]], default: int | None = 0, least: float = 6.0
) -> str:
    """Draw the buttons at the bottom right of a modal window and return the name of the pressed one, or "".

    Args:
        rects: Records each button as ``prefix``:name.
        prefix: Prefix of the names.
        buttons: Name and label of each button.
        default: Index of the button highlighted as the choice for Enter, or None.
        least: Minimum width in units of the font size.
    """
    style = imgui.get_style()
    widths = [max(imgui.calc_text_size(label).x + 2.0 * style.frame_padding.x, em(least)) for _, label in buttons]
    imgui.dummy((0.0, em(0.3)))
    room = imgui.get_content_region_avail().x - sum(widths) - style.item_spacing.x * (len(widths) - 1)
    imgui.set_cursor_pos_x(imgui.get_cursor_pos_x() + max(room, 0.0))
    pressed = ""
    for i, (name, label) in enumerate(buttons):
        if i:
            imgui.same_line()
        if i == default:
            imgui.push_style_color(imgui.Col_.button, ACCENT_DARK)
        if imgui.button(f"{label}##{prefix}", (widths[i], 0.0)):
            pressed = name
        if i == default:
            imgui.pop_style_color()
        rects.record(f"{prefix}:{name}")
    return pressed


def draw_job(
    fonts: Fonts, rects: WidgetRects, prefix: str, title: str, job: Job[object], text: str, escapes: bool = True
) -> None:
    """Draw the progress of ``job`` into a modal window, with a button that cancels it.

    Args:
        fonts: Fonts of the window.
        rects: Records the bar as ``prefix``:progress and the button as ``prefix``:cancel.
        prefix: Prefix of the names.
        title: Title of the modal window.
        job: The job.
        text: Text below the progress bar.
        escapes: True if Esc cancels, too.
    """
    modal_title(fonts, title)
    known = job.share > 0.0
    imgui.push_style_color(imgui.Col_.plot_histogram, ACCENT_DARK)
    imgui.progress_bar(
        min(job.share, 1.0) if known else -0.35 * imgui.get_time(),
        (-1.0, em(1.5)),
        f"{100.0 * job.share:.0f} %" if known else "",
    )
    imgui.pop_style_color()
    rects.record(f"{prefix}:progress")
    caption(text)
    imgui.begin_disabled(job.cancelled)
    pressed = modal_buttons(rects, prefix, (("cancel", "Cancel"),), default=None)
    imgui.end_disabled()
    if pressed or (escapes and imgui.is_key_pressed(imgui.Key.escape, False)):
        job.cancel()
