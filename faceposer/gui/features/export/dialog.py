"""Export dialog: format, options of images and videos, and progress."""

from collections.abc import Callable
from pathlib import Path

from imgui_bundle import imgui

from faceposer.gui.context import EditorContext
from faceposer.gui.features.export.form import ExportForm
from faceposer.gui.widgets.basic import caption
from faceposer.gui.widgets.modal import (
    draw_job,
    modal,
    modal_body,
    modal_buttons,
    modal_entered,
    modal_escaped,
    modal_title,
)
from faceposer.gui.widgets.sliders import row_label
from faceposer.gui.widgets.theme import em
from faceposer.gui.widgets.tooltips import tooltip
from faceposer.gui.widgets.widget_rects import WidgetRects
from faceposer.interchange.formats import FORMATS
from faceposer.render.shots import usual_rate
from faceposer.session.jobs import Job

_WIDTH, _LABEL = 36.0, 7.0
_SMALLEST, _LARGEST = 16, 4096
_FASTEST, _LONGEST = 50, 60.0
# Largest number of option rows of any format.
_MOST_OPTIONS = 4
_BUTTONS = (("accept", "Export..."), ("cancel", "Cancel"))


def draw_form(
    context: EditorContext,
    form: ExportForm,
    animated: bool,
    choose_file: Callable[[], object],
    close: Callable[[], object],
) -> None:
    """Draw the formats and their options.

    Args:
        context: The editor.
        form: The choices.
        animated: True if there is an animation.
        choose_file: Called to go on with the name of the file.
        close: Called to close the dialog.
    """
    pressed = ""
    with modal("##export", _WIDTH) as shown:
        if shown:
            pressed = _draw_form(context, form, animated)
            if pressed:
                imgui.close_current_popup()
    if pressed == "accept":
        choose_file()
    elif pressed == "cancel":
        close()


def _draw_form(context: EditorContext, form: ExportForm, animated: bool) -> str:
    """Draw the form and return the name of the button that was pressed, by pointer or key, or ""."""
    rects = context.widget_rects
    modal_title(context.fonts, "Export as")
    with modal_body(_BUTTONS):
        _draw_body(context, form, animated)
    pressed = modal_buttons(rects, "export", _BUTTONS)
    if modal_escaped():
        pressed = "cancel"
    elif modal_entered() and not imgui.get_io().want_text_input:
        pressed = "accept"
    return pressed


def _draw_body(context: EditorContext, form: ExportForm, animated: bool) -> None:
    rects = context.widget_rects
    for suffix, format_ in FORMATS.items():
        missing = format_.missing()
        left = imgui.get_cursor_pos_x()
        imgui.begin_disabled(bool(missing))
        if imgui.radio_button(f"{format_.name}##format", form.suffix == suffix):
            form.suffix = suffix
        imgui.end_disabled()
        rects.record(f"export:{suffix[1:]}")
        imgui.same_line(left + em(_LABEL))
        imgui.align_text_to_frame_padding()
        caption(missing or format_.purpose)
    imgui.dummy((0.0, em(0.1)))
    imgui.separator()
    imgui.dummy((0.0, em(0.1)))
    # The height is the same for all formats, so that nothing jumps when another one is chosen.
    top, reserved = imgui.get_cursor_pos_y(), _MOST_OPTIONS * imgui.get_frame_height_with_spacing()
    _draw_options(context, form, animated)
    unused = top + reserved - imgui.get_cursor_pos_y() - imgui.get_style().item_spacing.y
    if unused > 0.0:
        imgui.dummy((0.0, unused))


def _draw_options(context: EditorContext, form: ExportForm, animated: bool) -> None:
    rects, chosen = context.widget_rects, FORMATS[form.suffix]
    _draw_content_options(rects, form, animated)
    if not chosen.contact:
        caption("Without contact: lids, eyes, lips and teeth may intersect, because weights cannot express it.")
    if chosen.materials:
        row_label("Materials", "Materials and textures written next to the mesh", _LABEL)
        settings = context.settings
        _, settings.materials = imgui.checkbox("Write materials and textures##materials", settings.materials)
        rects.record("export:materials")
        tooltip("Write them next to the mesh and name them after it: smile.mtl, smile_skin.jpg")
    if chosen.drawn:
        _draw_image_options(rects, form)
    if chosen.holds == "film":
        keyed = animated and form.animated
        rate = context.session.animation.keyframes.rate if keyed else None
        _draw_video_options(rects, form, keyed, round(usual_rate(form.suffix, rate)))


def _draw_content_options(rects: WidgetRects, form: ExportForm, animated: bool) -> None:
    chosen = FORMATS[form.suffix]
    row_label("Content", "What the file contains", _LABEL)
    imgui.align_text_to_frame_padding()
    if not animated:
        imgui.text_unformatted("Turntable of the pose" if chosen.holds == "film" else "Current pose")
        return
    folder = " (folder of files)" if chosen.sequence is not None else ""
    if imgui.radio_button(f"Animation{folder}##animation", form.animated):
        form.animated = True
    rects.record("export:animation")
    imgui.same_line()
    if imgui.radio_button("Current pose##pose", not form.animated):
        form.animated = False
    rects.record("export:pose")


def _draw_image_options(rects: WidgetRects, form: ExportForm) -> None:
    row_label("Size", "Width and height of the image in pixels", _LABEL)
    imgui.set_next_item_width(em(9))
    _, (width, height) = imgui.input_int2("##size", [form.width, form.height])
    rects.record("export:size")
    tooltip("Width and height of the image in pixels")
    form.width, form.height = (min(max(side, _SMALLEST), _LARGEST) for side in (width, height))
    imgui.same_line()
    imgui.text_disabled("pixels")
    if FORMATS[form.suffix].transparent:
        row_label("Background", "Background of the image", _LABEL)
        _, form.transparent = imgui.checkbox("Transparent##transparent", form.transparent)
        rects.record("export:transparent")
        tooltip("Write an alpha channel in place of the background")


def _draw_video_options(rects: WidgetRects, form: ExportForm, animated: bool, usual: int) -> None:
    row_label("Turntable", "Turn of the camera around the head", _LABEL)
    if animated:
        _, form.turning = imgui.checkbox("##turning", form.turning)
        tooltip("Rotate the camera around the head while the animation plays")
        imgui.same_line()
    imgui.begin_disabled(animated and not form.turning)
    imgui.set_next_item_width(em(9))
    _, form.seconds = imgui.input_float("##seconds", form.seconds, 0.5, 1.0, "%.1f")
    rects.record("export:seconds")
    imgui.end_disabled()
    tooltip("Duration of one turn of the camera around the head")
    form.seconds = min(max(form.seconds, 0.5), _LONGEST)
    imgui.same_line()
    imgui.text_disabled("seconds")
    row_label("Frame rate", "Frames per second of the video", _LABEL)
    imgui.set_next_item_width(em(9))
    changed, rate = imgui.input_int("##rate", form.rate or usual)
    rects.record("export:rate")
    if changed:
        form.rate = min(max(rate, 1), _FASTEST)
    imgui.same_line()
    imgui.text_disabled("frames per second")


def draw_progress(context: EditorContext, name: str, job: Job[Path]) -> None:
    """Draw the progress of the export to the file ``name``, with a button that cancels it."""
    with modal("##export", _WIDTH) as shown:
        if not shown:
            return
        text = "The file is written when the export is complete."
        draw_job(context.fonts, context.widget_rects, "export", f"Writing {name}", job, text)
        if job.cancelled:
            imgui.close_current_popup()
