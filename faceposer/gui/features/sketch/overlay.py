"""Names beside the strokes of sketches, the stroke being drawn, and strokes that are not recognised yet."""

from collections.abc import Collection, Iterable, Sequence

import numpy as np
from imgui_bundle import ImVec2, imgui
from numpy.typing import NDArray

from faceposer.gui.context import EditorContext
from faceposer.gui.features.sketch.name_places import box_of_name, distance_to_box, leader, outer_end
from faceposer.gui.overlays.marks.sketch import SketchMark
from faceposer.gui.overlays.painter import Painter
from faceposer.gui.widgets.theme import EDGE, FAINT, INK, RAISED_MORE, TARGET, WARNING, Colour, Icon, u32
from faceposer.model.feature_curves import feature_curves
from faceposer.solve.constraints.stroke import as_pixels
from faceposer.tools.sketch_edits import drawable_points, inside
from faceposer.tools.sketch_tool import UNNAMED, Box, SketchTool
from faceposer.tools.stroke_tool import pixels_in_view

Array = NDArray[np.float64]

# Index, name, line, colour and opacity.
_Named = tuple[int, str, Array, Colour, float]
#: Name of the stroke that depicts no feature.
NO_FEATURE = "no feature"
# Index under which the name of an unfinished stroke is placed; it cannot be clicked.
_PREVIEW = -(2**31)
# At normal density: margins of a name, and its distance from the stroke.
_PAD_X, _PAD_Y, _GAP = 5.0, 2.0, 9.0
# Distance at normal density from which a line connects a name with its stroke.
_LEADER = 16.0
# Of the points along features, one in so many is an obstacle; strokes have one in so many pixels.
_EVERY, _STEP = 4, 5.0
# Height at normal density above and below a feature that its name keeps off.
_ROOM = 24.0
# Distance from the pointer, at normal density, from which names fade while a stroke is drawn, and the least opacity.
_NEAR, _FADED = 70.0, 0.1


class SketchOverlay:
    """Overlay of the sketches while their tool is chosen, and of the highlighted ones otherwise."""

    def __init__(self, context: EditorContext) -> None:
        """Draw over the view of ``context``."""
        self._context = context
        self._placed: tuple[object, object, list[Box | None]] = (None, None, [])

    def draw(self, draw: imgui.ImDrawList, tool: SketchTool, chosen: bool) -> None:
        """Draw names and unfinished strokes of ``tool``, all of them if it is ``chosen``; record where they are."""
        painter = Painter(draw, self._context.viewport, frozenset())
        labels: dict[int, Box] = {}
        lists: dict[int, Box] = {}
        if chosen:
            self._draw_unfinished(painter, tool)
        named = self._named(tool, chosen)
        boxes = self._boxes(named, chosen)
        shown = [(*item, box) for item, box in zip(named, boxes, strict=True) if box is not None]
        for index, _, line, colour, strength, box in shown:
            self._draw_leader(draw, box, line, colour, strength * self._fading(tool, box, index))
        for index, name, _, colour, strength, box in shown:
            self._draw_name(draw, box, name, colour, strength * self._fading(tool, box, index), chosen)
            labels[index] = box
            if chosen:
                lists[index] = (box[2] - self._list_width, *box[1:])
        tool.labels, tool.lists = (labels, lists) if chosen else ({}, {})
        self._record(labels, lists)

    def _fading(self, tool: SketchTool, box: Box, index: int) -> float:
        """Return the opacity of the name in ``box`` while a stroke is drawn, less near the pointer."""
        if not tool.drawing or index == _PREVIEW:
            return 1.0
        near = distance_to_box(box, tool.drawing[-1]) / (_NEAR * self._context.viewport.ui_scale)
        return _FADED + (1.0 - _FADED) * min(near, 1.0)

    def _named(self, tool: SketchTool, chosen: bool) -> Sequence[_Named]:
        """Return index, name, line, colour and opacity of what gets a name: unfinished strokes, then from the top."""
        context, found = self._context, []
        if chosen and tool.preview is not None and tool.drawing is not None and tool.drawn_in is not None:
            seen = pixels_in_view(as_pixels(tool.drawing), tool.drawn_in, context.viewport.camera)
            if seen is not None:
                found.append((_PREVIEW, tool.preview.feature, seen, TARGET, 1.0))
        for index in range(-1, -len(tool.unnamed) - 1, -1) if chosen else ():
            stroke = tool.unnamed[index].stroke
            seen = pixels_in_view(as_pixels(stroke.pixels), stroke.camera, context.viewport.camera)
            if seen is not None:
                found.append((index, NO_FEATURE, seen, WARNING, 1.0))
        constraints = context.session.document.constraints
        hidden = context.drawn_constraints.hidden.indices(constraints)
        pointed = context.highlighted
        hover = context.toolbox.hover
        if hover is not None and hover.pin is not None:
            pointed = hover.pin
        marks = [mark for mark in context.drawn_constraints.marks.values() if isinstance(mark, SketchMark)]
        selection = context.toolbox.selection
        # Pieces of one feature have one name, which belongs to the pointed or selected one, or else to the first.
        marks.sort(key=lambda mark: (mark.index != pointed, mark.index not in selection, mark.index))
        found_names: set[str] = set()
        shown: list[SketchMark] = []
        for mark in marks:
            if mark.feature not in found_names and (mark.index == pointed or mark.index not in hidden):
                found_names.add(mark.feature)
                shown.append(mark)
        for mark in sorted(shown, key=lambda mark: float(mark.line[:, 1].mean())):
            index = mark.index
            lit = index == pointed or (context.points_shown and index in selection)
            if lit or (chosen and context.points_shown and index not in hidden):
                strength = (1.0 if lit else 0.7) * (1.0 if mark.own_view else 0.6)
                pieces = [m.line for m in marks if m.feature == mark.feature and m.index not in hidden]
                line = np.vstack(pieces) if len(pieces) > 1 else mark.line
                found.append((index, mark.feature, line, INK, strength))
        return found

    def _draw_unfinished(self, painter: Painter, tool: SketchTool) -> None:
        """Draw the stroke in progress with the points that it matches, and a stroke that is not recognised."""
        camera = self._context.viewport.camera
        if tool.drawing is not None and tool.drawn_in is not None:
            seen = pixels_in_view(as_pixels(tool.drawing), tool.drawn_in, camera)
            if seen is not None:
                painter.line(seen, TARGET, 2.4, 1.0)
            if tool.preview is not None:
                places = as_pixels([point.pixel for point in tool.preview.points])
                knobs = pixels_in_view(places, tool.drawn_in, camera)
                for x, y in [] if knobs is None else knobs.tolist():
                    painter.knob((x, y), 2.6, INK, 1.0, False)
        for stroke, colour in (
            *((waiting, TARGET) for waiting in tool.waiting),
            *((unnamed.stroke, WARNING) for unnamed in tool.unnamed),
        ):
            seen = pixels_in_view(as_pixels(stroke.pixels), stroke.camera, camera)
            if seen is not None:
                painter.line(seen, colour, 2.0, 0.85)

    @property
    def _list_width(self) -> float:
        return imgui.calc_text_size(Icon.LIST).x + _PAD_X * self._context.viewport.ui_scale

    def _place(self, line: Array, name: str, listed: bool, obstacles: Array, taken: Collection[Box]) -> Box | None:
        """Return the box of ``name`` beside the outer end of ``line``, off ``obstacles``, (m, 2), and ``taken`` boxes.

        None if the end is outside the view.
        """
        viewport = self._context.viewport
        scale = viewport.ui_scale
        size = imgui.calc_text_size(name)
        width = size.x + 2.0 * _PAD_X * scale + (self._list_width if listed else 0.0)
        height = size.y + 2.0 * _PAD_Y * scale
        gap = _GAP * scale
        return box_of_name(line, (width, height), viewport.size, self._leftwards(line), obstacles, gap, taken)

    def _leftwards(self, line: Array) -> bool:
        """Return True if the name of ``line`` is at its left: outwards from the face, where it hides least."""
        return float(line[:, 0].mean()) < self._middle - 0.02 * self._context.viewport.size[0]

    def _room(self, name: str) -> list[Array]:
        """Return points above and below the feature ``name``, where its other pieces may be drawn."""
        context = self._context
        curves = feature_curves(context.session.model.character).get(name, ())
        gap = _ROOM * context.viewport.ui_scale
        return [
            context.viewport.camera.project(
                curve.points.positions(context.scene.vertices, context.session.model.triangles)[::_EVERY]
            )
            + (0.0, share * gap)
            for curve in curves
            for share in (-1.0, -0.5, 0.5, 1.0)
        ]

    def _boxes(self, named: Sequence[_Named], chosen: bool) -> list[Box | None]:
        """Return the boxes of what is ``named``; they are searched only if strokes, face or view have changed."""
        viewport, vertices = self._context.viewport, self._context.scene.vertices
        strokes = tuple((index, name, line.tobytes()) for index, name, line, _, _ in named)
        key = (strokes, chosen, viewport.view, viewport.size, viewport.ui_scale)
        if key != self._placed[0] or vertices is not self._placed[1]:
            obstacles = self._obstacles(line for _, _, line, _, _ in named) if named else np.empty((0, 2))
            boxes: list[Box | None] = []
            for _, name, line, _, _ in named:
                taken = [box for box in boxes if box is not None]
                boxes.append(self._place(line, name, chosen, np.vstack([obstacles, *self._room(name)]), taken))
            self._placed = (key, vertices, boxes)
        return self._placed[2]

    def _obstacles(self, lines: Iterable[Array]) -> Array:
        """Return points of ``lines`` and of all features on the face in the view, which names keep off, (m, 2)."""
        model = self._context.session.model
        features = drawable_points(model.character).positions(self._context.scene.vertices, model.triangles)[::_EVERY]
        return np.vstack([self._context.viewport.camera.project(features), *(_dense(line) for line in lines)])

    @property
    def _middle(self) -> float:
        """Column of the middle of the features in the view."""
        vertices = self._context.scene.vertices
        ids = list(self._context.session.model.character.feature_points.values())
        return float(self._context.viewport.camera.project(vertices[ids])[:, 0].mean()) if ids else 0.0

    def _draw_leader(self, draw: imgui.ImDrawList, box: Box, line: Array, colour: Colour, strength: float) -> None:
        """Draw a thin line from a name to its stroke, unless they are close."""
        viewport = self._context.viewport
        scale, (x, y) = viewport.ui_scale, viewport.origin
        found = leader(box, outer_end(line, self._leftwards(line)), _LEADER * scale)
        if found is not None:
            (u, v), (to_u, to_v) = found
            draw.add_line((u + x, v + y), (to_u + x, to_v + y), u32(EDGE, 0.6 * strength), 3.0 * scale)
            draw.add_line((u + x, v + y), (to_u + x, to_v + y), u32(colour, 0.6 * strength), 1.0 * scale)

    def _draw_name(
        self, draw: imgui.ImDrawList, box: Box, name: str, colour: Colour, strength: float, listed: bool
    ) -> None:
        viewport, hover = self._context.viewport, self._context.toolbox.hover
        scale, (x, y) = viewport.ui_scale, viewport.origin
        left, top, right, bottom = box[0] + x, box[1] + y, box[2] + x, box[3] + y
        under = hover is not None and inside(box, hover.position)
        ground, opacity = (RAISED_MORE, 1.0) if under and listed else (EDGE, 0.72 * strength)
        draw.add_rect_filled((left, top), (right, bottom), u32(ground, opacity), 4.0 * scale)
        draw.add_text(ImVec2(left + _PAD_X * scale, top + _PAD_Y * scale), u32(colour, strength), name)
        if listed:
            at = ImVec2(right - self._list_width + 0.5 * _PAD_X * scale, top + _PAD_Y * scale)
            draw.add_text(at, u32(FAINT, strength), Icon.LIST)

    def _record(self, labels: dict[int, Box], lists: dict[int, Box]) -> None:
        """Record the rectangles of names and lists in the window, for tests and tooltips."""
        x, y = self._context.viewport.origin
        for kind, boxes in (("label", labels), ("list", lists)):
            for index, (left, top, right, bottom) in boxes.items():
                # The last unnamed stroke has no number, those before it -2, -3 and so on.
                name = f"sketch:{index if index >= 0 else 'unnamed' + str(index).removeprefix(str(UNNAMED))}:{kind}"
                if index != _PREVIEW:
                    right_of_name = right - (self._list_width if kind == "label" and lists else 0.0)
                    self._context.widget_rects.place(name, (left + x, top + y, right_of_name + x, bottom + y))


def _dense(line: Array) -> Array:
    """Return points of ``line``, shape (m, 2), a few pixels apart."""
    along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(line, axis=0).T))])
    at = np.arange(0.0, along[-1] + _STEP, _STEP)
    return np.stack([np.interp(at, along, line[:, 0]), np.interp(at, along, line[:, 1])], axis=1)
