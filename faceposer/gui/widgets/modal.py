"""Modal windows: frame, title and buttons, and the progress of a job."""

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

from imgui_bundle import imgui

from faceposer.gui.widgets.basic import caption
from faceposer.gui.widgets.text import displayed, shortened
from faceposer.gui.widgets.theme import ACCENT_DARK, BAD, Fonts, Icon, em
from faceposer.gui.widgets.tooltips import tooltip
from faceposer.gui.widgets.widget_rects import WidgetRects
from faceposer.session.jobs import Job

_FLAGS = (
    imgui.WindowFlags_.no_title_bar
    | imgui.WindowFlags_.no_resize
    | imgui.WindowFlags_.no_move
    | imgui.WindowFlags_.always_auto_resize
    | imgui.WindowFlags_.no_saved_settings
    | imgui.WindowFlags_.no_scrollbar
)
# Padding of a modal window, gap above its buttons, least height of its body, in units of the font size.
_PADDING, _GAP, _LEAST_BODY = (1.4, 1.2), 0.3, 2.0
# Least width of a button in units of the font size.
_LEAST_BUTTON = 6.0
# Largest share of a modal window for its second column.
_MOST_SECOND = 0.42

Buttons = Sequence[tuple[str, str]]


@dataclass(frozen=True)
class _Open:
    """A modal window that is being drawn.

    Attributes:
        name: Its name.
        room: Height that the operating system's window has for it.
        least: Its least height, or 0.
    """

    name: str
    room: float
    least: float


_drawn: list[_Open] = []
# Width and height of the second column, and the gap before it, of modal windows with columns.
_columns: list[tuple[float, float, float]] = []
# Modal windows that had a drop-down list or another modal window above them when they were last drawn.
_covered: set[str] = set()
# First and last frame in which each modal window was drawn without a break.
_frames: dict[str, tuple[int, int]] = {}
_FRAMES_TO_SETTLE, _INVISIBLE = 3, 1e-3


@contextmanager
def modal(name: str, width: float, tallest: float = 0.0, least: float = 0.0) -> Iterator[bool]:
    """Open the modal window ``name`` in the middle; the block draws its content if the value is True.

    Esc closes a drop-down list in it, and nothing else.

    Args:
        name: Identifier for Dear ImGui, beginning with "##".
        width: Width in units of the font size, at most that of the window.
        tallest: Height that it can reach, in units of the font size: its top is placed for that and stays in place
            when the height changes. 0 centres it.
        least: Least height in pixels, such as that of the page before; buttons are then at its bottom.
    """
    if not imgui.is_popup_open(name):
        imgui.open_popup(name)
    view = imgui.get_main_viewport()
    across, top = min(em(width), view.size.x - em(1)), 0.0
    if tallest:
        top = max(0.5 * (view.size.y - em(tallest)), 0.0)
        imgui.set_next_window_pos((view.get_center().x, top), imgui.Cond_.always, (0.5, 0.0))
    else:
        imgui.set_next_window_pos(view.get_center(), imgui.Cond_.always, (0.5, 0.5))
    least = min(least, view.work_size.y - top)
    imgui.set_next_window_size_constraints((across, least), (across, view.size.y))
    settling = _settling(name)
    imgui.push_style_var(imgui.StyleVar_.alpha, _INVISIBLE if settling else imgui.get_style().alpha)
    imgui.push_style_var(imgui.StyleVar_.window_padding, _padding())
    shown = imgui.begin_popup_modal(name, None, _FLAGS)[0]
    imgui.pop_style_var()
    if shown:
        # Dear ImGui does not let an auto-sized window grow beyond this height.
        room = view.work_size.y - 2.0 * imgui.get_style().display_safe_area_padding.y
        _drawn.append(_Open(name, room - top, least))
        _close_lists()
    try:
        yield shown
    finally:
        if shown:
            _drawn.pop()
            (_covered.add if _is_covered() else _covered.discard)(name)
            imgui.end_popup()
        else:
            _covered.discard(name)
        imgui.pop_style_var()


def _settling(name: str) -> bool:
    """Return True in the first frames of a modal window, in which Dear ImGui finds out how high it is."""
    now = imgui.get_frame_count()
    first, last = _frames.get(name, (now, now))
    first = first if 0 <= now - last <= 1 else now
    _frames[name] = (first, now)
    return now - first < _FRAMES_TO_SETTLE


def modals_settle() -> bool:
    """Return True if a modal window was drawn in this frame that needs more frames until it is visible."""
    now = imgui.get_frame_count()
    return any(last == now and now - first < _FRAMES_TO_SETTLE for first, last in _frames.values())


def _padding() -> tuple[float, float]:
    """Return the padding of a modal window in pixels, less in a small window."""
    view = imgui.get_main_viewport().size
    return (round(min(em(_PADDING[0]), 0.03 * view.x)), round(min(em(_PADDING[1]), 0.03 * view.y)))


def modal_room() -> float:
    """Return the height, in units of the font size, that the modal window being drawn can have."""
    return _drawn[-1].room / em()


def _is_covered() -> bool:
    """Return True if a popup is open above the current one."""
    context = imgui.get_current_context()
    return len(context.open_popup_stack) > len(context.begin_popup_stack)


def _close_lists() -> None:
    """Close the drop-down list above the current modal window if Esc is pressed."""
    stack = imgui.get_current_context().open_popup_stack
    if not _is_covered() or not imgui.is_key_pressed(imgui.Key.escape, False):
        return
    above = stack[len(stack) - 1].window
    if above is not None and not above.flags & imgui.WindowFlags_.modal.value:
        imgui.internal.close_popup_to_level(len(stack) - 1, True)


def modal_escaped() -> bool:
    """Return True if Esc is pressed for the modal window that is being drawn, and not for what is above it."""
    return _key_pressed(imgui.Key.escape)


def modal_entered() -> bool:
    """Return True if Enter is pressed for the modal window that is being drawn, and not for what is above it."""
    return _key_pressed(imgui.Key.enter, imgui.Key.keypad_enter)


def _key_pressed(*keys: imgui.Key) -> bool:
    if imgui.is_window_appearing() or _drawn[-1].name in _covered or _is_covered():
        return False
    return any(imgui.is_key_pressed(key, False) for key in keys)


@contextmanager
def modal_body(buttons: Buttons, least: float = _LEAST_BUTTON, below: float = 0.0) -> Iterator[None]:
    """Draw the block into a part that scrolls if the window is too low; title and buttons always remain visible.

    Args:
        buttons: The buttons drawn below by ``modal_buttons``.
        least: Minimum width of a button in units of the font size.
        below: Height reserved above the buttons, in pixels.
    """
    width, height = _body_room(buttons, least, below, _drawn[-1].room)
    imgui.set_next_window_size_constraints((width, em(_LEAST_BODY)), (width, height))
    # Measured even while Dear ImGui hides the window in its first frame.
    flags = imgui.ChildFlags_.auto_resize_y | imgui.ChildFlags_.always_auto_resize
    imgui.begin_child("##body", (width, 0.0), flags)
    try:
        yield
    finally:
        imgui.end_child()


def _body_room(buttons: Buttons, least: float, below: float, bottom: float) -> tuple[float, float]:
    """Return width and height that are left above the buttons of a window of height ``bottom``, in pixels."""
    width = imgui.get_content_region_avail().x
    rows = len(_button_rows(buttons, least, width))
    foot = rows * imgui.get_frame_height() + (rows + 2) * imgui.get_style().item_spacing.y + em(_GAP) + below
    height = bottom - imgui.get_cursor_pos_y() - foot - _padding()[1]
    return width, max(height, em(_LEAST_BODY))


@contextmanager
def modal_columns(buttons: Buttons, second: float) -> Iterator[tuple[float, float]]:
    """Fill a modal window of a least height by two columns above its buttons; the value is the size of the first.

    The block draws the first column, then calls `modal_next_column`, which scrolls if it is too low.

    Args:
        buttons: The buttons drawn below by ``modal_buttons``.
        second: Width of the second column in units of the font size; it is less than half of a narrow window.
    """
    opened = _drawn[-1]
    width, height = _body_room(buttons, _LEAST_BUTTON, 0.0, opened.least or opened.room)
    spacing = 2.0 * imgui.get_style().item_spacing.x
    right = min(em(second), _MOST_SECOND * width)
    left = max(width - right - spacing, 1.0)
    still = imgui.WindowFlags_.no_scrollbar | imgui.WindowFlags_.no_scroll_with_mouse
    imgui.begin_child("##first", (left, height), 0, still)
    _columns.append((right, height, spacing))
    try:
        yield (left, height)
    finally:
        _columns.pop()
        imgui.end_child()


def modal_next_column() -> None:
    """Begin the second column of `modal_columns`."""
    right, height, spacing = _columns[-1]
    imgui.end_child()
    imgui.same_line(0.0, spacing)
    imgui.begin_child("##second", (right, height))


def _button_rows(buttons: Buttons, least: float, room: float) -> list[list[float]]:
    """Return the widths of the buttons of each row: one row if they fit."""
    style = imgui.get_style()
    texts = [imgui.calc_text_size(label).x + 2.0 * style.frame_padding.x for _, label in buttons]
    for narrowest in (em(least), 0.0):
        widths = [max(text, narrowest) for text in texts]
        if sum(widths) + style.item_spacing.x * (len(widths) - 1) <= room:
            return [widths] if widths else []
    rows: list[list[float]] = []
    for text in texts:
        if rows and sum(rows[-1]) + len(rows[-1]) * style.item_spacing.x + text <= room:
            rows[-1].append(text)
        else:
            rows.append([min(text, room)])
    return rows


def buttons_width(buttons: Buttons, least: float = _LEAST_BUTTON) -> float:
    """Return the width of a modal window with ``buttons`` in one row, in units of the font size."""
    widths = _button_rows(buttons, least, float("inf"))[0]
    spacing = imgui.get_style().item_spacing.x * (len(widths) - 1)
    return (sum(widths) + spacing) / em() + 2.0 * _padding()[0] / em() + 0.1


def modal_title(fonts: Fonts, text: str, bad: bool = False) -> None:
    """Draw the title of a modal window, with a warning sign if ``bad``."""
    if bad:
        imgui.text_colored(BAD, Icon.WARNING)
        imgui.same_line()
    imgui.push_font(fonts.bold, 0.0)
    imgui.text_unformatted(shortened(text, max(imgui.get_main_viewport().size.x - em(5), em(5))))
    imgui.pop_font()
    imgui.dummy((0.0, em(0.2)))


def modal_buttons(
    rects: WidgetRects,
    prefix: str,
    buttons: Buttons,
    default: int | None = 0,
    least: float = _LEAST_BUTTON,
    disabled: Collection[str] = (),
    tips: Mapping[str, str] | None = None,
) -> str:
    """Draw the buttons at the bottom right of a modal window and return the name of the pressed one, or "".

    Args:
        rects: Records each button as ``prefix``:name.
        prefix: Prefix of the names.
        buttons: Name and label of each button.
        default: Index of the button highlighted as the choice for Enter, or None.
        least: Minimum width in units of the font size.
        disabled: Names of buttons that cannot be pressed.
        tips: Tooltips by name.
    """
    buttons = [(name, displayed(label)) for name, label in buttons]
    imgui.dummy((0.0, em(_GAP)))
    left, room = imgui.get_cursor_pos_x(), imgui.get_content_region_avail().x
    spacing = imgui.get_style().item_spacing.x
    pressed, i = "", 0
    rows = _button_rows(buttons, least, room)
    foot = len(rows) * imgui.get_frame_height_with_spacing() - imgui.get_style().item_spacing.y + _padding()[1]
    imgui.set_cursor_pos_y(max(imgui.get_cursor_pos_y(), _drawn[-1].least - foot))
    for widths in rows:
        imgui.set_cursor_pos_x(left + max(room - sum(widths) - spacing * (len(widths) - 1), 0.0))
        for column, width in enumerate(widths):
            name, label = buttons[i]
            if column:
                imgui.same_line()
            if i == default:
                imgui.push_style_color(imgui.Col_.button, ACCENT_DARK)
            imgui.begin_disabled(name in disabled)
            if imgui.button(f"{label}##{prefix}", (width, 0.0)):
                pressed = name
            imgui.end_disabled()
            if i == default:
                imgui.pop_style_color()
            rects.record(f"{prefix}:{name}")
            tooltip((tips or {}).get(name, ""))
            i += 1
    return pressed


def job_bar(rects: WidgetRects, prefix: str, job: Job[object]) -> None:
    """Draw the progress bar of ``job``, recorded as ``prefix``:progress."""
    known = job.share > 0.0
    imgui.push_style_color(imgui.Col_.plot_histogram, ACCENT_DARK)
    imgui.progress_bar(
        min(job.share, 1.0) if known else -0.35 * imgui.get_time(),
        (-1.0, em(1.5)),
        f"{100.0 * job.share:.0f} %" if known else "",
    )
    imgui.pop_style_color()
    rects.record(f"{prefix}:progress")


def draw_job(
    fonts: Fonts,
    rects: WidgetRects,
    prefix: str,
    title: str,
    job: Job[object],
    text: str,
    escapes: bool = True,
    more: Callable[[], None] | None = None,
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
        more: Draws what belongs above the progress bar, such as a preview.
    """
    modal_title(fonts, title)
    buttons = (("cancel", "Cancel"),)
    with modal_body(buttons):
        if more is not None:
            more()
        job_bar(rects, prefix, job)
        # Stages have texts of one or two lines, between which the window does not change its size.
        below = imgui.get_cursor_pos_y() + 2.0 * imgui.get_text_line_height() + imgui.get_style().item_spacing.y
        caption(text)
        imgui.set_cursor_pos_y(max(imgui.get_cursor_pos_y(), below))
        imgui.dummy((0.0, 0.0))
    pressed = modal_buttons(rects, prefix, buttons, None, disabled=("cancel",) if job.cancelled else ())
    if pressed or (escapes and modal_escaped()):
        job.cancel()
