"""Draws strokes, curves, distances, fixed vertices and the gaze over the face, and what a tool has begun.

Blue is what is taken on the face, green where it should be, red what is held.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from imgui_bundle import ImVec2, imgui
from numpy.typing import NDArray

from faceposer.geometry.picking import SurfacePoints
from faceposer.gui.overlays.constraint_marks import AreaMark, CurveMark, GazeMark, ShapeMarks, StrokeMark, curve_line
from faceposer.gui.viewport import Pixel, Viewport
from faceposer.gui.widgets.theme import ACCENT, EDGE, HELD, INK, TARGET, WARNING, Colour, u32
from faceposer.tools.distance_tool import PairMark
from faceposer.tools.toolbox import Toolbox

_WHITE: Colour = (1.0, 1.0, 1.0, 1.0)
# Pixels at normal density from which a distance is visibly not what it should be.
_APART = 1.5
Array = NDArray[np.float64]


class ShapePainter:
    """Draws marks into one view."""

    def __init__(self, draw: imgui.ImDrawList, viewport: Viewport, toolbox: Toolbox, pointed: int | None) -> None:
        """Draw into ``draw``; constraint ``pointed`` and those selected stand out."""
        self._draw, self._toolbox = draw, toolbox
        self._origin = np.asarray(viewport.origin)
        self._viewport = viewport
        self._scale = viewport.ui_scale
        self._lit = toolbox.selection | ({pointed} if pointed is not None else set())

    def paint(self, marks: ShapeMarks, enabled: Sequence[bool]) -> None:
        """Draw ``marks``; constraints that are not ``enabled`` are faint."""
        for area in marks.areas:
            self._area(area, self._alpha(area.index, enabled))
        for stroke in marks.strokes:
            self._stroke(stroke, self._alpha(stroke.index, enabled))
        for curve in marks.curves:
            self._curve(curve, self._alpha(curve.index, enabled))
        for pair in marks.pairs:
            self._pair(pair, self._alpha(pair.index, enabled))
        if marks.gaze is not None:
            alpha = 1.0 if marks.gaze.index is None else self._alpha(marks.gaze.index, enabled)
            self._gaze(marks.gaze, alpha)

    def _alpha(self, index: int, enabled: Sequence[bool]) -> float:
        return (1.0 if enabled[index] else 0.35) * (1.0 if index in self._lit or not self._lit else 0.8)

    # The constraints

    def _area(self, mark: AreaMark, alpha: float) -> None:
        # Where vertices lie densely, smaller dots leave the face to be seen.
        radius = min(max(40.0 / max(len(mark.pixels), 1) ** 0.5, 0.9), 2.2)
        self._dots(mark.pixels, radius * (1.3 if mark.index in self._lit else 1.0) * self._scale, HELD, 0.8 * alpha)

    def _stroke(self, mark: StrokeMark, alpha: float) -> None:
        lit = mark.index in self._lit
        self._dots(mark.source, 1.3 * self._scale, ACCENT, (0.7 if lit else 0.45) * alpha)
        self._band(
            mark.target, mark.width, mark.shape, TARGET, (0.55 if lit else 0.38) * alpha * self._ghost(mark.own_view)
        )

    def _curve(self, mark: CurveMark, alpha: float) -> None:
        lit = mark.index in self._lit
        ghost = self._ghost(mark.own_view)
        self._line(mark.source, ACCENT, 1.6, 0.75 * alpha)
        self._line(mark.line, TARGET, 2.4 if lit else 1.8, alpha * ghost)
        for x, y in mark.handles.tolist():
            self._knob((x, y), 4.6 if mark.own_view else 3.2, TARGET, alpha * ghost, lit)

    def _pair(self, mark: PairMark, alpha: float) -> None:
        lit = mark.index in self._lit
        along = mark.ends[1] - mark.ends[0]
        length = float(np.hypot(*along))
        across = np.array([-along[1], along[0]]) / length if length > 1e-6 else np.array([1.0, 0.0])
        apart = 0.0
        if mark.goal is not None:
            apart = abs(float(np.hypot(*(mark.goal[1] - mark.goal[0]))) - length)
        if mark.goal is not None and apart > _APART * self._scale:
            for tip in mark.goal:
                self._line(
                    np.stack([tip - 7.0 * self._scale * across, tip + 7.0 * self._scale * across]), WARNING, 2.0, alpha
                )
            self._line(mark.goal + 4.0 * self._scale * across, WARNING, 1.4, 0.8 * alpha)
        self._line(mark.ends, TARGET, 2.4 if lit else 1.8, alpha)
        for x, y in mark.ends.tolist():
            self._knob((x, y), 5.0 if mark.goal is not None else 3.6, TARGET, alpha, lit)
        middle = mark.ends.mean(axis=0)
        self._text(middle + (12.0 * self._scale, 0.0), f"{length:.0f} px", alpha)

    def _gaze(self, mark: GazeMark, alpha: float) -> None:
        offered = mark.index is None
        colour = INK if offered else ACCENT
        for eye in mark.eyes:
            self._line(np.stack([eye, np.array(mark.handle)]), colour, 1.2, 0.45 * alpha)
        at = self._at(mark.handle)
        lit = mark.index in self._lit if mark.index is not None else False
        for radius, tint, thickness in ((9.0, EDGE, 4.0), (9.0, _WHITE if lit else colour, 2.2)):
            self._draw.add_circle(at, radius * self._scale, u32(tint, 0.9 * alpha), 0, thickness * self._scale)
        self._draw.add_circle_filled(at, 3.0 * self._scale, u32(colour, alpha))

    # What tools have begun

    def paint_begun(self) -> None:
        """Draw what the chosen tool has begun and not finished."""
        toolbox, hover = self._toolbox, self._toolbox.hover
        stroke, curve, distance, fix = toolbox.stroke_tool, toolbox.curve_tool, toolbox.distance_tool, toolbox.fix_tool
        options = toolbox.bench.options
        if stroke.source is not None:
            self._dots(self._project(stroke.source.points), 1.8 * self._scale, ACCENT, 0.85)
        if stroke.drawing is not None:
            way, width = stroke.drawing
            self._band(np.array(way), width, options.shape, TARGET if stroke.draws_target else ACCENT, 0.6)
        if curve.points:
            pixels = curve.pixels(self._viewport)
            self._line(curve_line(pixels), ACCENT, 2.2, 1.0)
            for x, y in pixels.tolist():
                self._knob((x, y), 4.6, ACCENT, 1.0, False)
        if distance.first is not None:
            (begin,) = self._project(SurfacePoints.of([distance.first]))
            end = distance.pointer or (hover.position if hover is not None else None)
            if end is not None:
                self._line(np.array([begin, end]), TARGET, 1.8, 0.9)
            self._knob((float(begin[0]), float(begin[1])), 5.0, TARGET, 1.0, True)
        if fix.lasso:
            self._line(np.array([*fix.lasso, fix.lasso[0]]), HELD, 1.8, 1.0)
        self._brush_ring()

    def _brush_ring(self) -> None:
        """Show how wide the brush is."""
        toolbox, options = self._toolbox, self._toolbox.bench.options
        hover = toolbox.hover
        if hover is None:
            return
        if toolbox.chosen is toolbox.stroke_tool:
            colour = TARGET if toolbox.stroke_tool.draws_target else ACCENT
            diameter = options.brush
        elif toolbox.chosen is toolbox.fix_tool and options.fix_mode == "brush":
            colour, diameter = HELD, options.fix_brush
        else:
            return
        at = self._at(hover.position)
        radius = max(0.5 * diameter, 1.5) * self._scale
        self._draw.add_circle(at, radius, u32(EDGE, 0.6), 0, 2.6 * self._scale)
        self._draw.add_circle(at, radius, u32(colour, 0.95), 0, 1.3 * self._scale)

    # Pieces

    def _ghost(self, own_view: bool) -> float:
        return 1.0 if own_view else 0.45

    def _project(self, points: SurfacePoints) -> Array:
        session = self._viewport.session
        return self._viewport.camera.project(session.model.positions_at(points, session.coefficients))

    def _at(self, pixel: Pixel) -> ImVec2:
        return ImVec2(pixel[0] + self._origin[0], pixel[1] + self._origin[1])

    def _path(self, pixels: Array) -> list[Any]:
        return [ImVec2(x, y) for x, y in (pixels + self._origin).tolist()]

    def _dots(self, pixels: Array, radius: float, colour: Colour, alpha: float) -> None:
        tint = u32(colour, alpha)
        for x, y in (pixels + self._origin).tolist():
            self._draw.add_circle_filled(ImVec2(x, y), radius, tint, 6)

    def _line(self, pixels: Array, colour: Colour, thickness: float, alpha: float) -> None:
        if len(pixels) < 2:
            return
        path = self._path(pixels)
        self._draw.add_polyline(path, u32(EDGE, 0.55 * alpha), (thickness + 1.8) * self._scale, 0)
        self._draw.add_polyline(path, u32(colour, alpha), thickness * self._scale, 0)

    def _band(self, way: Array, width: float, shape: str, colour: Colour, alpha: float) -> None:
        """Draw what a brush of ``width`` covers along ``way``."""
        if not len(way):
            return
        tint = u32(colour, alpha)
        if len(way) == 1:
            self._draw.add_circle_filled(self._at((way[0, 0], way[0, 1])), max(width / 2.0, 1.5), tint)
            return
        if shape == "filled" and len(way) > 2:
            self._draw.add_concave_poly_filled(self._path(way), u32(colour, 0.55 * alpha))
        closed = imgui.ImDrawFlags_.closed.value if shape != "line" else 0
        self._draw.add_polyline(self._path(way), tint, max(width, 2.0), closed)

    def _knob(self, at: Pixel, radius: float, colour: Colour, alpha: float, lit: bool) -> None:
        place, radius = self._at(at), radius * self._scale
        if lit:
            self._draw.add_circle(place, radius + 2.6 * self._scale, u32(_WHITE, alpha), 0, 1.6 * self._scale)
        self._draw.add_circle_filled(place, radius + 1.4 * self._scale, u32(EDGE, 0.85 * alpha))
        self._draw.add_circle_filled(place, radius, u32(colour, alpha))

    def _text(self, at: Array, text: str, alpha: float) -> None:
        size = imgui.calc_text_size(text)
        x, y = (at + self._origin).tolist()
        pad = 3.0 * self._scale
        top = y - size.y / 2.0
        self._draw.add_rect_filled(
            ImVec2(x - pad, top - 1.0),
            ImVec2(x + size.x + pad, top + size.y + 1.0),
            u32(EDGE, 0.7 * alpha),
            3.0 * self._scale,
        )
        self._draw.add_text(ImVec2(x, top), u32(INK, alpha), text)
