"""Overlay of a photo's pins, and of the place of the face to pin next."""

from imgui_bundle import imgui

from faceposer.geometry.picking import SurfacePoints
from faceposer.gui.context import EditorContext
from faceposer.gui.overlays.pins import draw_badge, draw_label
from faceposer.gui.widgets.theme import EDGE, TARGET, WARNING, u32
from faceposer.photo.photo import Place
from faceposer.photo.places import anchor_of

_WHITE = (1.0, 1.0, 1.0, 1.0)
# Pixels at normal density between a pin and its place on the face from which a line connects them.
_LEAST_DISTANCE = 2.0


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
