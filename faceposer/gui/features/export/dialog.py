"""The dialog that exports: which format, how pictures are to be, and how far a film is."""

from pathlib import Path
from typing import TYPE_CHECKING

from imgui_bundle import imgui

from faceposer.gui.context import EditorContext
from faceposer.gui.widgets.basic import WidgetRects, caption, tooltip
from faceposer.gui.widgets.modal import draw_job, modal, modal_buttons, modal_title
from faceposer.gui.widgets.theme import em
from faceposer.interchange.formats import FORMATS
from faceposer.session.jobs import Job

if TYPE_CHECKING:
    from faceposer.gui.features.export.feature import ExportFeature, ExportForm

_WIDTH, _LABEL = 36.0, 7.0
_SMALLEST, _LARGEST = 16, 4096
_FASTEST, _LONGEST = 50, 60.0
# Rows of options that the format with the most has.
_MOST_OPTIONS = 4


def draw_form(context: EditorContext, exchange: "ExportFeature") -> None:
    """Draw what can be exported and how."""
    pressed = ""
    with modal("##export", _WIDTH) as shown:
        if shown:
            pressed = _draw_form(context, exchange)
            if pressed:
                imgui.close_current_popup()
    if pressed == "accept":
        exchange.choose_file()
    elif pressed == "cancel":
        exchange.end()


def _draw_form(context: EditorContext, exchange: "ExportFeature") -> str:
    """Draw the form and return the button that was pressed, by pointer or key, or ""."""
    fresh = imgui.is_window_appearing()
    form, rects = exchange.form, context.widget_rects
    modal_title(context.fonts, "Export as")
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
        caption(missing or offered.purpose)
    imgui.dummy((0.0, em(0.1)))
    imgui.separator()
    imgui.dummy((0.0, em(0.1)))
    # As high with every format, so that nothing jumps when another one is chosen.
    top, most = imgui.get_cursor_pos_y(), _MOST_OPTIONS * imgui.get_frame_height_with_spacing()
    _draw_options(context, exchange)
    left_over = top + most - imgui.get_cursor_pos_y() - imgui.get_style().item_spacing.y
    if left_over > 0.0:
        imgui.dummy((0.0, left_over))
    pressed = modal_buttons(rects, "export", (("accept", "Export..."), ("cancel", "Cancel")))
    if not fresh and not imgui.get_io().want_text_input:
        if imgui.is_key_pressed(imgui.Key.escape, False):
            pressed = "cancel"
        if imgui.is_key_pressed(imgui.Key.enter, False) or imgui.is_key_pressed(imgui.Key.keypad_enter, False):
            pressed = "accept"
    return pressed


def _draw_options(context: EditorContext, exchange: "ExportFeature") -> None:
    rects, chosen = context.widget_rects, FORMATS[exchange.form.suffix]
    animated = exchange.performance() is not None
    _draw_what(rects, exchange.form, animated)
    if chosen.materials:
        _label("Materials")
        settings = context.settings
        _, settings.materials = imgui.checkbox("Write the .mtl and the textures too##materials", settings.materials)
        rects.record("export:materials")
        tooltip("Beside the mesh and named after it: smile.mtl, smile_skin.jpg")
    if chosen.drawn:
        _draw_picture_options(rects, exchange.form)
    if chosen.holds == "film":
        _draw_film_options(rects, exchange.form, animated and exchange.form.animated)


def _draw_what(rects: WidgetRects, form: "ExportForm", animated: bool) -> None:
    chosen = FORMATS[form.suffix]
    _label("What")
    if not animated:
        moving = "turns round once" if chosen.holds == "film" else "as it is now"
        imgui.text_unformatted(f"The pose {moving}")
        return
    folder = ", a folder of files" if chosen.sequence is not None else ""
    if imgui.radio_button(f"The animation{folder}", form.animated):
        form.animated = True
    rects.record("export:animation")
    imgui.same_line()
    if imgui.radio_button("The pose", not form.animated):
        form.animated = False
    rects.record("export:pose")


def _draw_picture_options(rects: WidgetRects, form: "ExportForm") -> None:
    _label("Size")
    imgui.set_next_item_width(em(9))
    _, (width, height) = imgui.input_int2("##size", [form.width, form.height])
    rects.record("export:size")
    tooltip("Width and height of the picture in pixels")
    form.width, form.height = (min(max(side, _SMALLEST), _LARGEST) for side in (width, height))
    imgui.same_line()
    imgui.text_disabled("pixels")
    if FORMATS[form.suffix].transparent:
        _label("Background")
        _, form.transparent = imgui.checkbox("Transparent##transparent", form.transparent)
        rects.record("export:transparent")
        tooltip("Leave the background out: the picture has an alpha channel")


def _draw_film_options(rects: WidgetRects, form: "ExportForm", plays: bool) -> None:
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


def draw_progress(context: EditorContext, exchange: "ExportFeature", job: Job[Path]) -> None:
    """Draw the progress of what is being written, with a button that cancels it."""
    with modal("##export", _WIDTH) as shown:
        if not shown:
            return
        text = "Nothing is written before it is done."
        draw_job(context.fonts, context.widget_rects, "export", f"Writing {exchange.target.name}", job, text)
        if job.cancelled:
            imgui.close_current_popup()


def _label(text: str) -> None:
    left = imgui.get_cursor_pos_x()
    imgui.align_text_to_frame_padding()
    imgui.text_unformatted(text)
    imgui.same_line(left + em(_LABEL))
    imgui.align_text_to_frame_padding()
