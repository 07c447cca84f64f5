"""Tab of the photos: the list, the layers, the camera and the pins."""

from dataclasses import replace
from pathlib import Path

import numpy as np
from imgui_bundle import ImVec2, ImVec4, imgui

from faceposer.errors import counted
from faceposer.geometry.picture_view import PictureView
from faceposer.gui.context import EditorContext
from faceposer.gui.features.photo.overlay import place_title
from faceposer.gui.features.photo.photos import Photos
from faceposer.gui.widgets.basic import (
    action_button,
    button_width,
    caption,
    choice,
    disabled,
    fitted_button,
    heading,
    wrapped_text,
)
from faceposer.gui.widgets.sliders import slider
from faceposer.gui.widgets.text import shortened, widget_id, wrapped
from faceposer.gui.widgets.theme import FAINT, INK, WARNING, Icon, em, u32
from faceposer.gui.widgets.tooltips import tooltip
from faceposer.photo.aligning import residuals_px
from faceposer.photo.photo import Photo, Place
from faceposer.photo.places import ALIGNING, guided
from faceposer.photo.reading import focal_in_mm, focal_in_pixels
from faceposer.solve.camera_fit import LEAST_POINTS

_FOCALS_MM = (12.0, 400.0)


def draw_photo_tab(photos: Photos) -> None:
    """Draw the tab."""
    context = photos.context
    if not photos.photos:
        _draw_ways(photos)
        return
    action_button(context.widget_rects, context.actions["photo-open"], -1.0)
    for i in range(len(photos.photos)):
        imgui.push_id(i)
        removed = _draw_row(photos, i)
        imgui.pop_id()
        if removed:
            return
    photo = photos.photo
    if photo is None:
        return
    if not photos.readable:
        imgui.push_style_color(imgui.Col_.text, ImVec4(*WARNING))
        wrapped_text(f"{Icon.WARNING} The file cannot be read: {photo.path}")
        imgui.pop_style_color()
    action = context.actions["photo-expression"]
    unknown = not photo.pins and photo.expression is None
    strong = photos.takes_expressions and unknown
    action_button(context.widget_rects, action, -1.0, strong=strong, reason=_takes_problem(photos))
    if _way(photos, "photo-to-head", "Head from photos...", "Make a new character of the person in these photos"):
        photos.make_head([Path(one.path) for one in photos.photos])
    _draw_layers(photos, photo)
    _draw_camera(photos, photo)
    _draw_pins(photos, photo)


def _takes_problem(photos: Photos) -> str:
    return "" if photos.takes_expressions else "This character has none of ARKit's shapes; set pins and pose from them."


def _way(photos: Photos, name: str, label: str, tip: str, usable: bool = True) -> bool:
    """Draw a button that takes a photo to a face; return True if it was pressed."""
    context = photos.context
    with disabled(not usable or context.busy):
        return fitted_button(context.widget_rects, label, name, imgui.get_content_region_avail().x, tip)


def _draw_ways(photos: Photos) -> None:
    """Draw what can be done with a photo, while there is none."""
    context = photos.context
    title = context.session.model.character.title
    caption("Open a photo in one of three ways, or drop it onto the window.")
    imgui.spacing()
    if _way(photos, "photo-to-head", "Head from photos...", "Make a new character of photos of a person"):
        photos.make_head()
    caption("The person becomes a character.")
    imgui.spacing()
    takes, problem = photos.takes_expressions, _takes_problem(photos)
    tip = "Open a photo behind the face, find the face in it, and pose the character after it"
    if _way(photos, "photo-to-expression", "Take the expression...", f"{tip}\n{problem}".strip(), takes):
        photos.ask_and_take_expression()
    caption(f"{title} gets it, without pins." if takes else problem)
    imgui.spacing()
    if _way(photos, "photo-to-pins", "Set pins...", "Open a photo behind the face and mark features of the face on it"):
        photos.ask_and_pin()
    caption("By hand: for any character, and for drawings.")


def _draw_row(photos: Photos, index: int) -> bool:
    """Draw a photo of the list; return True if it was removed."""
    context, photo = photos.context, photos.photos[index]
    row = imgui.get_frame_height()
    begin, width = imgui.get_cursor_pos(), imgui.get_content_region_avail().x
    imgui.set_next_item_allow_overlap()
    corner = imgui.get_cursor_screen_pos()
    pressed, _ = imgui.selectable("##row", index == photos.active, 0, ImVec2(width, row))
    baseline = corner.y + (row - imgui.get_font_size()) / 2.0
    draw = imgui.get_window_draw_list()
    draw.add_text((corner.x + em(0.3), baseline), u32(INK, 0.75), Icon.PHOTO)
    draw.add_text((corner.x + em(1.8), baseline), u32(INK), shortened(photo.name, width - row - em(2.0)))
    context.widget_rects.record(f"photo:{index}")
    tooltip(f"{photo.path}\n{photo.size[0]} x {photo.size[1]} pixels, {counted(len(photo.pins), 'pin')}")
    if pressed and not context.busy:
        photos.choose(index)
    imgui.set_cursor_pos(ImVec2(begin.x + width - row, begin.y))
    imgui.push_style_color(imgui.Col_.button, ImVec4(0.0, 0.0, 0.0, 0.0))
    removed = imgui.button(Icon.CLOSE, ImVec2(row, row)) and not context.busy
    imgui.pop_style_color()
    context.widget_rects.record(f"photo:{index}:delete")
    tooltip("Remove the photo from the session; the file is kept")
    if removed:
        photos.remove(index)
    return removed


def _draw_layers(photos: Photos, photo: Photo) -> None:
    context = photos.context
    heading(context.fonts, "In the view")
    tips = ("Draw the photo behind the face", "Draw the photo in front of the face")
    front = choice(context.widget_rects, "photo-layer", ("Photo behind", "Photo in front"), int(photo.front), tips) == 1
    if front != photo.front and not context.busy:
        photos.change(replace(photo, front=front), "Order of photo and face")
        photo = photos.photo or photo
    imgui.set_next_item_width(em(9.0))
    label = "Photo opacity" if photo.front else "Face opacity"
    changed, opacity = slider(f"{label}##photo-opacity", photo.opacity, 0.0, 1.0, "%.2f")
    context.widget_rects.record("photo-opacity")

    def apply() -> None:
        photos.change(replace(photo, opacity=min(max(opacity, 0.0), 1.0)), "Opacity of the photo")

    context.slider_edit.update(context.session, "photo-opacity", "Opacity of the photo", changed, apply)
    _draw_wipe(photos)
    imgui.same_line()
    _draw_putting_back(photos)
    shown = context.actions["photo-shown"]
    pressed, _ = imgui.checkbox("Show the photo", photo.visible)
    context.widget_rects.record("photo-shown")
    tooltip(shown.tooltip)
    if pressed and shown.enabled():
        shown.run()
    view = context.viewport.view
    if isinstance(view, PictureView):
        imgui.same_line()
        pressed, locked = imgui.checkbox("Lock the view", view.locked)
        context.widget_rects.record("photo-lock")
        tooltip("Keep the view at the photo's camera: dragging next to the face does not orbit")
        if pressed:
            context.viewport.view = replace(view if not locked else view.back(), locked=locked)
    if not photos.aligned:
        action_button(context.widget_rects, context.actions["photo-look"], -1.0, strong=True)
    action_button(context.widget_rects, context.actions["photo-save"], -1.0, reason=photos.put_back_problem)


def _draw_wipe(photos: Photos) -> None:
    """Draw the switch of the line between photo and face."""
    context, wipe = photos.context, photos.wipe
    action = context.actions["photo-wipe"]
    pressed, _ = imgui.checkbox("Wipe", wipe.on)
    context.widget_rects.record("photo-wipe")
    keys = " and ".join(key for side in ("left", "right") if (key := context.actions[f"photo-wipe-{side}"].shortcut))
    tooltip(f"{action.tooltip}\n{f'{keys} move it.' if keys else ''}".strip())
    if pressed and action.enabled():
        action.run()


def _draw_putting_back(photos: Photos) -> None:
    context = photos.context
    action, problem = context.actions["photo-put-back"], photos.put_back_problem
    with disabled(bool(problem)):
        pressed, _ = imgui.checkbox("Put the face back", photos.putting_back.on and not problem)
    context.widget_rects.record("photo-put-back")
    tooltip(f"{action.tooltip}\n{problem}".strip())
    if pressed and action.enabled():
        action.run()


def _draw_camera(photos: Photos, photo: Photo) -> None:
    context = photos.context
    heading(context.fonts, "Camera")
    residuals = residuals_px(photo, context.session.model, context.session.coefficients)
    count = len(residuals)
    if count < LEAST_POINTS:
        more = LEAST_POINTS - count
        way = "Take the expression, or set" if photos.takes_expressions and not count else "Set"
        caption(f"{way} {counted(more, 'more pin')} to align the rotation of the head.")
    else:
        height = _projected_height(context, photo)
        mean = float(np.mean(list(residuals.values())))
        caption(f"{counted(count, 'pin')}, mean error {mean:.1f} px. The head is {height:.0f} px high.")
    fixed = photo.focal is not None
    focal = photo.focal or (photo.camera.focal if photo.camera is not None else 1.0)
    pressed, fixed = imgui.checkbox("Focal length", fixed)
    context.widget_rects.record("photo-focal-known")
    tooltip("Use this focal length, initially that of the photo's file. If off, it is estimated from 6 pins or more.")
    if pressed and not context.busy:
        photos.realign(focal if fixed else None)
    imgui.same_line()
    imgui.set_next_item_width(-1.0)
    imgui.begin_disabled(photo.focal is None)
    millimetres = focal_in_mm(focal, photo.size)
    flags = imgui.SliderFlags_.logarithmic.value | imgui.SliderFlags_.clamp_on_input.value
    changed, value = slider("##photo-focal", millimetres, *_FOCALS_MM, "%.0f mm", flags)
    imgui.end_disabled()
    context.widget_rects.record("photo-focal")
    tooltip("35 mm equivalent. Portraits are taken at 50 to 135 mm, phones have about 26 mm.")

    def apply() -> None:
        photos.realign(focal_in_pixels(value, photo.size))

    context.slider_edit.update(context.session, "photo-focal", "Focal length of the photo", changed, apply)


def _projected_height(context: EditorContext, photo: Photo) -> float:
    """Return the height of the head in pixels of the photo."""
    character = context.session.model.character
    if photo.camera is None:
        return 0.0
    middle = character.vertices.mean(axis=0)
    depth = float((photo.camera.rotation @ middle + photo.camera.translation)[2])
    return photo.camera.focal / depth * character.height


def _draw_pins(photos: Photos, photo: Photo) -> None:
    context, tool = photos.context, photos.tool
    heading(context.fonts, "Pins")
    width = button_width(2)
    only_way = not photos.takes_expressions and not photo.pins
    action_button(context.widget_rects, context.actions["photo-pin"], width, "Set pins", strong=only_way)
    imgui.same_line()
    action_button(context.widget_rects, context.actions["photo-skip"], width, "Skip")
    ready = photos.has_enough_pins and tool.next_place(context.viewport) is None and not _posed(context, photo)
    action_button(context.widget_rects, context.actions["photo-pose"], -1.0, strong=ready)
    imgui.spacing()
    residuals = residuals_px(photo, context.session.model, context.session.coefficients)
    order = guided(context.session.model.character)
    others = [pin.place for pin in photo.pins if pin.place not in order]
    imgui.push_style_var(imgui.StyleVar_.item_spacing, ImVec2(imgui.get_style().item_spacing.x, 0.0))
    for title, places in (
        ("For the camera", [place for place in order if place in ALIGNING]),
        ("For the expression", [place for place in order if place not in ALIGNING]),
        ("Other", others),
    ):
        if not places:
            continue
        caption(title)
        for place in places:
            index = photo.pin_of(place)
            _draw_pin(photos, photo, place, None if index is None else residuals.get(index))
        imgui.dummy((0.0, em(0.3)))
    imgui.pop_style_var()
    caption("To pin another place, choose Set pins, Shift+press on the face, then press on the photo.")


def _posed(context: EditorContext, photo: Photo) -> bool:
    """Return True if a constraint was drawn from the photo's camera."""
    cameras = (constraint.camera for constraint in context.session.document.constraints)
    return any(
        photo.camera is not None and camera is not None and camera.same_viewpoint(photo.camera) for camera in cameras
    )


def _draw_pin(photos: Photos, photo: Photo, place: Place, residual: float | None) -> None:
    """Draw a place of the face in the list: pinned, next, or without a pin."""
    context, tool = photos.context, photos.tool
    index = photo.pin_of(place)
    begin, corner, width = imgui.get_cursor_pos(), imgui.get_cursor_screen_pos(), imgui.get_content_region_avail().x
    lines = wrapped(place_title(context, place), width - em(1.4 + 1.9 + 4.0 * (index is not None)))
    row = round(len(lines) * imgui.get_text_line_height() + em(0.4))
    imgui.push_id(widget_id(str(place)))
    imgui.set_next_item_allow_overlap()
    choosing = context.toolbox.chosen is tool
    lit = choosing and (tool.place == place or (index is not None and tool.selected == index))
    pressed, _ = imgui.selectable("##pin", lit, 0, ImVec2(width, row))
    context.widget_rects.record(f"pin:{place}")
    draw = imgui.get_window_draw_list()
    state = Icon.CHECK if index is not None else Icon.POINT if choosing and tool.place == place else ""
    baseline = corner.y + (row - imgui.get_font_size()) / 2.0
    draw.add_text((corner.x + em(0.1), baseline), u32(FAINT), state)
    tint = imgui.get_color_u32(imgui.Col_.text) if index is not None or lit else u32(FAINT)
    for n, text in enumerate(lines):
        draw.add_text((corner.x + em(1.4), corner.y + em(0.2) + n * imgui.get_text_line_height()), tint, text)
    if pressed and not context.busy:
        if index is None:
            photos.pin_place(place)
        else:
            tool.selected = index
    if index is not None:
        text = "" if residual is None else f"{residual:.1f} px"
        at = corner.x + width - em(1.6) - imgui.calc_text_size(text).x
        draw.add_text((at, baseline), u32(FAINT), text)
        imgui.set_cursor_pos(ImVec2(begin.x + width - em(1.3), begin.y))
        imgui.push_style_color(imgui.Col_.button, ImVec4(0.0, 0.0, 0.0, 0.0))
        imgui.push_style_var(imgui.StyleVar_.frame_padding, ImVec2(0.0, 0.0))
        if imgui.button(Icon.CLOSE, ImVec2(em(1.3), row)) and not context.busy:
            photos.look_through()
            tool.remove(index, context.viewport)
        imgui.pop_style_var()
        imgui.pop_style_color()
        context.widget_rects.record(f"pin:{place}:delete")
        tooltip("Remove the pin")
    imgui.set_cursor_pos(ImVec2(begin.x, begin.y + row))
    imgui.pop_id()
