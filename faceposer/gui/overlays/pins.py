"""Overlay of pins: handles, residuals, and the point under the pointer."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from imgui_bundle import imgui

from faceposer.geometry.picking import SurfacePoints
from faceposer.gui.viewport import Pixel, Viewport
from faceposer.gui.widgets.text import shortened
from faceposer.gui.widgets.theme import ACCENT, EDGE, FAINT, INK, WARNING, u32
from faceposer.render.scene import Scene
from faceposer.tools.point_tool import handle_pixels, pins
from faceposer.tools.toolbox import Toolbox

_WHITE = (1.0, 1.0, 1.0, 1.0)
# Distance in pixels at normal density from which the gap between a pin and its point on the face is drawn.
_VISIBLE_GAP = 1.5


@dataclass(frozen=True)
class PinMark:
    """A pin in the view.

    Attributes:
        index: Index of the constraint.
        handle: Pixel of the handle.
        face: Pixel of the pinned point of the face.
        own_view: True if the view is that of the constraint, so that its target can be shown.
        hidden: True if the face hides the pinned point.
        enabled: True if the constraint is enabled.
    """

    index: int
    handle: Pixel
    face: Pixel
    own_view: bool
    hidden: bool
    enabled: bool

    @property
    def gap(self) -> float:
        """Distance in pixels between the handle and the pinned point."""
        return float(np.hypot(self.handle[0] - self.face[0], self.handle[1] - self.face[1]))


def pin_marks(viewport: Viewport, scene: Scene, moving: bool) -> list[PinMark]:
    """Return the marks of all point constraints of the session.

    While the face or the view is ``moving``, only pins on a surface facing away count as hidden: the depth image for
    occlusion costs too much per frame.
    """
    constraints = pins(viewport)
    if not constraints:
        return []
    camera = viewport.camera
    points = SurfacePoints.of([constraint.anchor for constraint in constraints.values()])
    faces = camera.project(points.positions(scene.vertices, scene.triangles)).tolist()
    hidden = scene.facing_away(camera, points) if moving else viewport.hidden(points)
    handles = handle_pixels(viewport)
    return [
        PinMark(
            i,
            handles[i],
            (faces[n][0], faces[n][1]),
            constraint.camera.transferred(constraint.target, camera) is not None,
            bool(hidden[n]),
            constraint.enabled,
        )
        for n, (i, constraint) in enumerate(constraints.items())
    ]


def draw_overlay(
    draw: imgui.ImDrawList, viewport: Viewport, toolbox: Toolbox, marks: Sequence[PinMark], highlighted: int | None
) -> None:
    """Draw ``marks``, with the index ``highlighted`` emphasised, and the point under the pointer."""
    scale = viewport.ui_scale
    hover = toolbox.hover
    hovered = hover.pin if hover is not None and not toolbox.active else None
    shown = [highlighted] if hovered is None else [hovered]
    for mark in marks:
        if mark.own_view and mark.enabled and mark.gap > _VISIBLE_GAP * scale:
            _draw_gap(draw, viewport, mark, scale)
    for mark in marks:
        selected = mark.index in toolbox.selection
        _draw_pin(draw, _in_window(viewport, mark.handle), mark, selected, mark.index in shown, scale)
    if hover is not None and hover.surface and not toolbox.active and toolbox.chosen is toolbox.point_tool:
        center = _in_window(viewport, hover.position)
        draw.add_circle_filled(center, 4.2 * scale, u32(EDGE, 0.55))
        draw.add_circle_filled(center, 2.8 * scale, u32(_WHITE, 0.95))


def draw_label(draw: imgui.ImDrawList, viewport: Viewport, at: Pixel, text: str) -> None:
    """Draw ``text`` next to the pixel ``at``, inside the view."""
    scale = viewport.ui_scale
    pad = 5.0 * scale
    text = shortened(text, viewport.size[0] - 2.0 * pad)
    size = imgui.calc_text_size(text)
    x, y = _in_window(viewport, at)
    right = viewport.origin[0] + viewport.size[0]
    left = x + 14.0 * scale
    if left + size.x + 2.0 * pad > right:
        left = max(x - 14.0 * scale - size.x - 2.0 * pad, viewport.origin[0])
    top = max(y - size.y / 2.0 - pad, viewport.origin[1])
    draw.add_rect_filled(
        (left, top), (left + size.x + 2.0 * pad, top + size.y + 2.0 * pad), u32(EDGE, 0.78), 4.0 * scale
    )
    draw.add_text((left + pad, top + pad), u32(INK), text)


def draw_badge(draw: imgui.ImDrawList, viewport: Viewport, text: str, row: float, warm: bool = False) -> None:
    """Draw ``text`` with a background, centred in the view at height ``row``: 0 for the top, 1 for the bottom."""
    scale = viewport.ui_scale
    size = imgui.calc_text_size(text)
    if size.x + 28.0 * scale > viewport.size[0]:
        return
    pad_x, pad_y, margin = 14.0 * scale, 7.0 * scale, 16.0 * scale
    width, height = size.x + 2.0 * pad_x, size.y + 2.0 * pad_y
    left = round(viewport.origin[0] + (viewport.size[0] - width) / 2.0)
    top = round(viewport.origin[1] + margin + row * (viewport.size[1] - height - 2.0 * margin))
    draw.add_rect_filled((left, top), (left + width, top + height), u32(EDGE, 0.80), height / 2.0)
    draw.add_text((left + pad_x, top + pad_y), u32(WARNING if warm else INK), text)


def _in_window(viewport: Viewport, pixel: Pixel) -> Pixel:
    return (pixel[0] + viewport.origin[0], pixel[1] + viewport.origin[1])


def _draw_gap(draw: imgui.ImDrawList, viewport: Viewport, mark: PinMark, scale: float) -> None:
    """Draw the line from the pinned point to the handle."""
    begin, end = _in_window(viewport, mark.face), _in_window(viewport, mark.handle)
    alpha = 0.45 if mark.hidden else 1.0
    draw.add_line(begin, end, u32(EDGE, 0.6 * alpha), 4.0 * scale)
    draw.add_line(begin, end, u32(WARNING, alpha), 2.0 * scale)
    draw.add_circle_filled(begin, 4.0 * scale, u32(EDGE, 0.7 * alpha))
    draw.add_circle_filled(begin, 2.8 * scale, u32(WARNING, alpha))


def _draw_pin(
    draw: imgui.ImDrawList, center: Pixel, mark: PinMark, selected: bool, hovered: bool, scale: float
) -> None:
    """Draw a pin: full size in the view of its constraint, smaller in others, faint if hidden."""
    alpha = 0.40 if mark.hidden else 1.0 if mark.own_view else 0.75
    radius = (5.5 if mark.own_view else 4.0) * scale
    if hovered:
        draw.add_circle_filled(center, radius + 5.0 * scale, u32(_WHITE, 0.22))
    if selected:
        draw.add_circle(center, radius + 3.2 * scale, u32(EDGE, 0.8 * alpha), 0, 3.6 * scale)
        draw.add_circle(center, radius + 3.2 * scale, u32(_WHITE, alpha), 0, 1.8 * scale)
    draw.add_circle_filled(center, radius + 1.5 * scale, u32(EDGE, 0.85 * alpha))
    draw.add_circle_filled(center, radius, u32(ACCENT if mark.enabled else FAINT, alpha))
    if not mark.own_view:
        draw.add_circle_filled(center, radius * 0.45, u32(EDGE, 0.85 * alpha))
