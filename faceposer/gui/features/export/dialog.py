"""The dialog that exports: which format, how pictures are to be, and how far a film is."""

from typing import TYPE_CHECKING

from imgui_bundle import imgui

from faceposer.gui.context import EditorContext
from faceposer.gui.widgets.basic import caption, tooltip
from faceposer.gui.widgets.theme import ACCENT_DARK, FAINT, em
from faceposer.interchange.formats import FORMATS

if TYPE_CHECKING:
    from faceposer.gui.features.export.feature import ExportFeature

_WIDTH, _LABEL = 36.0, 7.0
_SMALLEST, _LARGEST = 16, 4096
_FASTEST, _LONGEST = 50, 60.0


def draw_form(context: EditorContext, exchange: "ExportFeature") -> None:
    """Draw what can be exported and how."""
    if not _begin():
        return
    fresh = imgui.is_window_appearing()
    form, rects = exchange.form, context.widget_rects
    _title(context, "Export as")
    for suffix, offered in FORMATS.items():
        missing = offered.missing()
        left = imgui.get_cursor_pos_x()
        imgui.begin_disabled(bool(missing))
        if imgui.radio_button(f"{offered.name}##format", form.suffix == suffix):
            form.suffix = suffix
        imgui.end_disabled()
        rects.record(f"export:{suffix[1:]}")
        imgui.same_line(left + em(_LABEL))
        imgui.align_text_to_frame_padding()
        imgui.text_colored(FAINT, missing or offered.purpose)
    imgui.dummy((0.0, em(0.1)))
    imgui.separator()
    imgui.dummy((0.0, em(0.1)))
    _draw_options(context, exchange)
    pressed = _foot(context, (("accept", "Export..."), ("cancel", "Cancel")))
    typing = imgui.get_io().want_text_input
    if not fresh and not typing:
        if imgui.is_key_pressed(imgui.Key.escape, False):
            pressed = "cancel"
        if imgui.is_key_pressed(imgui.Key.enter, False) or imgui.is_key_pressed(imgui.Key.keypad_enter, False):
            pressed = "accept"
    if pressed:
        imgui.close_current_popup()
    imgui.end_popup()
    if pressed == "accept":
        exchange.choose_file()
    elif pressed == "cancel":
        exchange.end()


def _draw_options(context: EditorContext, exchange: "ExportFeature") -> None:
    form, rects = exchange.form, context.widget_rects
    chosen = FORMATS[form.suffix]
    animated = exchange.performance() is not None
    if not animated:
        moving = "turns round once" if chosen.holds == "film" else "as it is now"
        _label("What")
        imgui.text_unformatted(f"The pose {moving}")
    else:
        _label("What")
        folder = ", a folder of files" if chosen.sequence is not None else ""
        if imgui.radio_button(f"The animation{folder}", form.animated):
            form.animated = True
        rects.record("export:animation")
        imgui.same_line()
        if imgui.radio_button("The pose", not form.animated):
            form.animated = False
        rects.record("export:pose")
    if not chosen.drawn:
        return
    _label("Size")
    imgui.set_next_item_width(em(9))
    _, (width, height) = imgui.input_int2("##size", [form.width, form.height])
    rects.record("export:size")
    tooltip("Width and height of the picture in pixels")
    form.width, form.height = (min(max(side, _SMALLEST), _LARGEST) for side in (width, height))
    imgui.same_line()
    imgui.text_disabled("pixels")
    if chosen.holds != "film":
        return
    plays = animated and form.animated
    _label("Turn")
    if plays:
        _, form.turning = imgui.checkbox("##turning", form.turning)
        tooltip("Let the camera go round the head while the animation plays")
        imgui.same_line()
    imgui.begin_disabled(plays and not form.turning)
    imgui.set_next_item_width(em(9))
    _, form.seconds = imgui.input_float("##seconds", form.seconds, 0.5, 1.0, "%.1f")
    rects.record("export:seconds")
    imgui.end_disabled()
    tooltip("How long the camera takes to go round the head once")
    form.seconds = min(max(form.seconds, 0.5), _LONGEST)
    imgui.same_line()
    imgui.text_disabled("seconds")
    _label("Rate")
    imgui.set_next_item_width(em(9))
    _, form.rate = imgui.input_int("##rate", form.rate)
    rects.record("export:rate")
    form.rate = min(max(form.rate, 1), _FASTEST)
    imgui.same_line()
    imgui.text_disabled("frames a second")


def draw_progress(context: EditorContext, exchange: "ExportFeature") -> None:
    """Draw how far the film is, with a button that ends it."""
    filming = exchange.filming
    if filming is None or not _begin():
        return
    _title(context, f"Writing {filming.path.name}")
    imgui.push_style_color(imgui.Col_.plot_histogram, ACCENT_DARK)
    imgui.progress_bar(filming.share, (-1.0, em(1.5)), f"{100.0 * filming.share:.0f} %")
    imgui.pop_style_color()
    context.widget_rects.record("export:progress")
    caption("Nothing is written before it is done.")
    pressed = _foot(context, (("cancel", "Cancel"),), lit=False)
    if imgui.is_key_pressed(imgui.Key.escape, False):
        pressed = "cancel"
    if pressed:
        imgui.close_current_popup()
    imgui.end_popup()
    if pressed:
        exchange.end()


def _begin() -> bool:
    name = "##export"
    if not imgui.is_popup_open(name):
        imgui.open_popup(name)
    view = imgui.get_main_viewport()
    width = min(em(_WIDTH), view.size.x - em(1))
    imgui.set_next_window_pos(view.get_center(), imgui.Cond_.always, (0.5, 0.5))
    imgui.set_next_window_size_constraints((width, 0.0), (width, view.size.y))
    imgui.push_style_var(imgui.StyleVar_.window_padding, (em(1.4), em(1.2)))
    flags = (
        imgui.WindowFlags_.no_title_bar
        | imgui.WindowFlags_.no_resize
        | imgui.WindowFlags_.no_move
        | imgui.WindowFlags_.always_auto_resize
        | imgui.WindowFlags_.no_saved_settings
    )
    shown = imgui.begin_popup_modal(name, None, flags)[0]
    imgui.pop_style_var()
    return shown


def _title(context: EditorContext, text: str) -> None:
    imgui.push_font(context.fonts.bold, 0.0)
    imgui.text_unformatted(text)
    imgui.pop_font()
    imgui.dummy((0.0, em(0.2)))


def _label(text: str) -> None:
    left = imgui.get_cursor_pos_x()
    imgui.align_text_to_frame_padding()
    imgui.text_unformatted(text)
    imgui.same_line(left + em(_LABEL))
    imgui.align_text_to_frame_padding()


def _foot(context: EditorContext, buttons: tuple[tuple[str, str], ...], lit: bool = True) -> str:
    """Draw buttons at the right, the first one lit, and return the name of the one that was pressed, or ""."""
    width, gap = em(6), imgui.get_style().item_spacing.x
    imgui.dummy((0.0, em(0.3)))
    room = imgui.get_content_region_avail().x - len(buttons) * width - (len(buttons) - 1) * gap
    imgui.set_cursor_pos_x(imgui.get_cursor_pos_x() + max(room, 0.0))
    pressed = ""
    for i, (name, label) in enumerate(buttons):
        if i:
            imgui.same_line()
        if lit and not i:
            imgui.push_style_color(imgui.Col_.button, ACCENT_DARK)
        if imgui.button(f"{label}##foot", (width, 0.0)):
            pressed = name
        if lit and not i:
            imgui.pop_style_color()
        context.widget_rects.record(f"export:{name}")
    return pressed
