"""Overlay of a photo's pins, and of the place of the face to pin next."""

from imgui_bundle import imgui

from faceposer.geometry.picking import SurfacePoints
from faceposer.gui.context import EditorContext
from faceposer.gui.overlays.pins import draw_badge, draw_label
from faceposer.gui.widgets.text import shortened
from faceposer.gui.widgets.theme import ACCENT, EDGE, INK, TARGET, WARNING, em, u32
from faceposer.photo.photo import Place
from faceposer.photo.places import anchor_of
from faceposer.session.jobs import Job

_WHITE = (1.0, 1.0, 1.0, 1.0)
# Pixels at normal density between a pin and its place on the face from which a line connects them.
_LEAST_DISTANCE = 2.0
# Padding, width and height of the bar of work in the background, distance from the top of the view, in font sizes, and
# the period of a bar without a known share in seconds.
_PADDING, _BAR, _TOP, _PERIOD = (0.9, 0.5), (12.0, 0.3), 1.0, 1.6


def place_title(context: EditorContext, place: Place) -> str:
    """Return the title of ``place``."""
    character = context.session.model.character
    if isinstance(place, str):
        return character.feature_titles.get(place, place)
    return context.drawn_constraints.names.name(place)


def face_pixel(context: EditorContext, place: Place) -> tuple[float, float] | None:
    """Return the pixel of ``place`` in the view, or None if the face has no such place."""
    anchor = anchor_of(place, context.session.model.character)
    if anchor is None or isinstance(anchor, str):
        return None
    points = SurfacePoints.of([anchor])
    positions = points.positions(context.scene.vertices, context.scene.triangles)
    u, v = context.viewport.camera.project(positions)[0].tolist()
    return (u, v)


def draw_photo_overlay(context: EditorContext, draw: imgui.ImDrawList) -> None:
    """Draw the pins of the photo while its tool is chosen."""
    tool, viewport = context.toolbox.photo_tool, context.viewport
    photo = tool.photo(viewport)
    if photo is None or context.toolbox.chosen is not tool:
        return
    scale = viewport.ui_scale
    pixels = tool.pixels(viewport)
    hover = context.toolbox.hover
    hovered = tool.pin_at(hover.position, viewport) if hover is not None and not context.toolbox.active else None

    def at(pixel: tuple[float, float]) -> tuple[float, float]:
        return (pixel[0] + viewport.origin[0], pixel[1] + viewport.origin[1])

    for pin, pixel in zip(photo.pins, pixels, strict=True):
        face = face_pixel(context, pin.place)
        if face is not None and max(abs(face[0] - pixel[0]), abs(face[1] - pixel[1])) > _LEAST_DISTANCE * scale:
            draw.add_line(at(face), at(pixel), u32(EDGE, 0.6), 3.4 * scale)
            draw.add_line(at(face), at(pixel), u32(WARNING, 0.95), 1.6 * scale)
    for i, pixel in enumerate(pixels):
        lit = i in (hovered, tool.selected)
        if i == hovered:
            draw.add_circle_filled(at(pixel), 10.0 * scale, u32(_WHITE, 0.22))
        draw.add_circle_filled(at(pixel), 6.0 * scale, u32(EDGE, 0.85))
        draw.add_circle_filled(at(pixel), 4.6 * scale, u32(_WHITE if lit else TARGET, 1.0))
        # The centre is open to show the marked feature.
        draw.add_circle_filled(at(pixel), 1.8 * scale, u32(EDGE, 0.9))
    # The label of a pin that was just set could cover the next place.
    if hovered is not None and not (hovered == tool.selected and tool.place is not None):
        draw_label(draw, viewport, pixels[hovered], place_title(context, photo.pins[hovered].place))
    if tool.place is not None and not context.toolbox.active:
        _draw_next(context, draw, tool.place)


def _draw_next(context: EditorContext, draw: imgui.ImDrawList, place: Place) -> None:
    """Mark ``place`` on the face, and show what to do."""
    viewport = context.viewport
    face = face_pixel(context, place)
    if face is not None:
        center = (face[0] + viewport.origin[0], face[1] + viewport.origin[1])
        for radius, width, colour in ((9.0, 4.2, EDGE), (9.0, 2.2, WARNING)):
            draw.add_circle(center, radius * viewport.ui_scale, u32(colour, 0.95), 0, width * viewport.ui_scale)
        draw.add_circle_filled(center, 2.2 * viewport.ui_scale, u32(WARNING))
    title = place_title(context, place)
    sided = " (the person's left)" if "left" in title else " (the person's right)" if "right" in title else ""
    draw_badge(draw, viewport, f"Press on the photo: {title}{sided}", 0.0, warm=True)


def draw_busy(context: EditorContext, draw: imgui.ImDrawList, job: Job[object], hint: str = "") -> None:
    """Draw what is being done in the background over the view, with a bar of its progress.

    Args:
        context: The editor.
        draw: The list of the view.
        job: The work.
        hint: What the user can do meanwhile, or "".
    """
    viewport = context.viewport
    room = viewport.size[0] - 2.0 * em(_PADDING[0] + 1.0)
    if room < em(4.0):
        return
    text = shortened(f"{job.stage}...{f'  {hint}' if hint else ''}", room)
    size = imgui.calc_text_size(text)
    width = max(size.x, min(em(_BAR[0]), room))
    left = round(viewport.origin[0] + 0.5 * (viewport.size[0] - width))
    top = round(viewport.origin[1] + em(_TOP + _PADDING[1]))
    bar = top + size.y + em(0.35)
    low, high = (left - em(_PADDING[0]), top - em(_PADDING[1])), (left + width + em(_PADDING[0]), bar + em(0.8))
    draw.add_rect_filled(low, high, u32(EDGE, 0.80), em(0.4))
    draw.add_text((left + 0.5 * (width - size.x), top), u32(INK), text)
    context.widget_rects.place("photo-busy", (*low, *high))
    share, begin = min(job.share, 1.0), 0.0
    if share <= 0.0:
        begin = (imgui.get_time() / _PERIOD) % 1.0 * 1.3 - 0.3
        share, begin = min(begin + 0.3, 1.0), max(begin, 0.0)
    draw.add_rect_filled((left, bar), (left + width, bar + em(_BAR[1])), u32(INK, 0.15), em(0.15))
    done = (left + begin * width, bar), (left + share * width, bar + em(_BAR[1]))
    draw.add_rect_filled(*done, u32(ACCENT), em(0.15))
