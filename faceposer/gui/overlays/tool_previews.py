"""Previews of unfinished work of the chosen tool, one function per tool in ``PREVIEWS``."""

from collections.abc import Callable

import numpy as np

from faceposer.geometry.picking import SurfacePoints
from faceposer.gui.overlays.marks.curve import curve_line
from faceposer.gui.overlays.painter import Painter
from faceposer.gui.viewport import Viewport
from faceposer.gui.widgets.theme import ACCENT, EDGE, HELD, TARGET, Colour
from faceposer.tools.toolbox import Toolbox


def draw_tool_preview(painter: Painter, viewport: Viewport, toolbox: Toolbox) -> None:
    """Draw the unfinished work of the chosen tool of ``toolbox``, if any."""
    preview = PREVIEWS.get(toolbox.chosen.name)
    if preview is not None:
        preview(painter, viewport, toolbox)


def _stroke(painter: Painter, _viewport: Viewport, toolbox: Toolbox) -> None:
    stroke, options = toolbox.stroke_tool, toolbox.tool_settings.options
    if stroke.source is not None:
        painter.dots(painter.project(stroke.source.points), 1.8, ACCENT, 0.85)
    colour = TARGET if stroke.draws_target else ACCENT
    if stroke.drawing is not None:
        path, width = stroke.drawing
        painter.band(np.array(path), width, options.shape, colour, 0.6)
    _brush(painter, toolbox, options.brush, colour)


def _curve(painter: Painter, viewport: Viewport, toolbox: Toolbox) -> None:
    curve = toolbox.curve_tool
    if not curve.points:
        return
    pixels = curve.pixels(viewport)
    painter.line(curve_line(pixels), ACCENT, 2.2, 1.0)
    for x, y in pixels.tolist():
        painter.knob((x, y), 4.6, ACCENT, 1.0, False)


def _distance(painter: Painter, _viewport: Viewport, toolbox: Toolbox) -> None:
    distance, hover = toolbox.distance_tool, toolbox.hover
    if distance.first is None:
        return
    (begin,) = painter.project(SurfacePoints.of([distance.first]))
    end = distance.pointer or (hover.position if hover is not None else None)
    if end is not None:
        painter.line(np.array([begin, end]), TARGET, 1.8, 0.9)
    painter.knob((float(begin[0]), float(begin[1])), 5.0, TARGET, 1.0, True)


def _fix(painter: Painter, _viewport: Viewport, toolbox: Toolbox) -> None:
    fix, options = toolbox.fix_tool, toolbox.tool_settings.options
    if fix.lasso:
        painter.line(np.array([*fix.lasso, fix.lasso[0]]), HELD, 1.8, 1.0)
    if options.fix_mode == "brush":
        _brush(painter, toolbox, options.fix_brush, HELD)


def _brush(painter: Painter, toolbox: Toolbox, diameter: float, colour: Colour) -> None:
    """Draw the brush around the pointer."""
    if toolbox.hover is None:
        return
    radius = max(0.5 * diameter, 1.5)
    painter.ring(toolbox.hover.position, radius, EDGE, 0.6, 2.6 / painter.scale)
    painter.ring(toolbox.hover.position, radius, colour, 0.95, 1.3 / painter.scale)


#: Previews by the name of the tool.
PREVIEWS: dict[str, Callable[[Painter, Viewport, Toolbox], None]] = {
    "stroke": _stroke,
    "curve": _curve,
    "distance": _distance,
    "fix": _fix,
}
