"""Curves: control points clicked on the face, then dragged to pose it (Lau et al. 2009, section 4.4)."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from faceposer.geometry.curves import nearest_parameter, relaxed_bezier
from faceposer.geometry.picking import SurfacePoint, SurfacePoints
from faceposer.solve.constraints.curve import MOST_POINTS, CurveConstraint
from faceposer.solve.constraints.stroke import as_pixels
from faceposer.tools.dragging import drag_constraint
from faceposer.tools.stroke_tool import pixels_in_view
from faceposer.tools.symmetry import Mirroring
from faceposer.tools.tool import Gesture, PointerEvent, PosingTool, ToolContext, ToolSettings

_REACH = 9.0
_NEAR_LINE = 6.0
Pixel = tuple[float, float]


class CurveTool(PosingTool):
    """Draws a source curve and edits target curves.

    Attributes:
        points: Control points, fixed to the face, of a source that is not accepted yet.
    """

    name = "curve"
    label = "Curve"
    key = "K"
    help = "Click points of a curve on the face, then drag its control points"
    empty_text = "Click points of a curve on the face and accept it, then drag its control points."
    drag_hint = "Move: shift the point of the curve   ·   release: confirm   ·   Esc: cancel"
    cursor = "pick"
    handle_order = 3

    def __init__(self, tool_settings: ToolSettings) -> None:
        """Use the shared ``tool_settings``."""
        super().__init__(tool_settings)
        self.points: list[SurfacePoint] = []
        self._steps: list[list[SurfacePoint]] = []

    def pixels(self, context: ToolContext) -> NDArray[np.float64]:
        """Return the pixels of the control points of the unaccepted source in the view, shape (n, 2)."""
        if not self.points:
            return np.zeros((0, 2))
        session = context.session
        vertices = session.vertices
        return context.camera.project(SurfacePoints.of(self.points).positions(vertices, session.model.triangles))

    def _source_point_at(self, position: Pixel, context: ToolContext) -> int | None:
        """Return the control point of the unaccepted source within reach of ``position``, or None."""
        pixels = self.pixels(context)
        if not len(pixels):
            return None
        distances = np.hypot(*(pixels - position).T)
        nearest = int(np.argmin(distances))
        return nearest if distances[nearest] <= _REACH * context.ui_scale else None

    def handle_at(self, position: Pixel, context: ToolContext) -> tuple[int, int] | None:
        """Return the constraint and the control point of its target within reach of ``position``, or None."""
        best, found = _REACH * context.ui_scale, None
        for i, constraint in self._curves(context):
            seen = pixels_in_view(constraint.target, constraint.camera, context.camera)
            if seen is not None:
                distances = np.hypot(*(seen - position).T)
                nearest = int(np.argmin(distances))
                if distances[nearest] <= best:
                    best, found = float(distances[nearest]), (i, nearest)
        return found

    def line_at(self, position: Pixel, context: ToolContext) -> tuple[int, float] | None:
        """Return the constraint whose target passes within reach of ``position`` and the parameter there, or None."""
        for i, constraint in self._curves(context):
            seen = pixels_in_view(constraint.target, constraint.camera, context.camera)
            if seen is not None and len(seen) < MOST_POINTS:
                parameter, distance = nearest_parameter(relaxed_bezier(seen), position)
                if distance <= _NEAR_LINE * context.ui_scale:
                    return i, parameter
        return None

    def _curves(self, context: ToolContext) -> list[tuple[int, CurveConstraint]]:
        """Return the editable curves with their indices, the selected one first, then the newest."""
        chosen = self._settings.selection.indices
        found = [
            (i, constraint)
            for i, constraint in enumerate(context.session.document.constraints)
            if isinstance(constraint, CurveConstraint) and not constraint.locked and i not in context.unmarked
        ]
        return sorted(found, key=lambda item: (item[0] not in chosen, -item[0]))

    def hits_handle(self, event: PointerEvent, context: ToolContext) -> bool:
        """Return True if the press ``event`` hits a control point of a target."""
        return event.button == "left" and not event.modifiers and self.handle_at(event.position, context) is not None

    def begins(self, event: PointerEvent, context: ToolContext) -> bool:
        """Return True if the press ``event`` adds, grabs or inserts a control point."""
        if event.button != "left" or event.modifiers:
            return False
        at = event.position
        return (
            self._source_point_at(at, context) is not None
            or context.pick(at) is not None
            or self.handle_at(at, context) is not None
            or self.line_at(at, context) is not None
        )

    def handle_under(self, position: Pixel, context: ToolContext) -> int | None:
        """Return the curve whose control point would be grabbed by a press at ``position``, or None."""
        found = self.handle_at(position, context) if not self.points else None
        return None if found is None else found[0]

    def gesture(self, event: PointerEvent, context: ToolContext) -> Gesture:
        """Add or move a control point of the source, or drag one of a target."""
        if not self.points:
            handle, line = self.handle_at(event.position, context), self.line_at(event.position, context)
            if handle is not None:
                yield from self._drag(handle, event, context)
                return
            if line is not None:
                yield from self._insert(line, event, context)
                return
        # on press
        before = list(self.points)
        index = self._source_point_at(event.position, context)
        if index is None:
            index = self._add(event.position, context)
        try:
            while index is not None:
                event = yield
                # on release
                if event.kind == "release":
                    break
                # on move
                point = context.pick(event.position)
                if point is not None:
                    self.points[index] = point
        except GeneratorExit:
            self.points = before
            raise
        if self.points != before:
            self._steps.append(before)

    def _add(self, position: Pixel, context: ToolContext) -> int | None:
        """Add a control point on the face, inside the curve if it passes nearby, else at its end."""
        point = context.pick(position)
        if point is None or len(self.points) >= MOST_POINTS:
            return None
        index = len(self.points)
        if index >= 2:
            parameter, distance = nearest_parameter(relaxed_bezier(self.pixels(context)), position)
            if distance <= _NEAR_LINE * context.ui_scale:
                index = min(int(parameter) + 1, index)
        self.points.insert(index, point)
        return index

    def _insert(self, line: tuple[int, float], event: PointerEvent, context: ToolContext) -> Gesture:
        """Insert a control point into a target and drag it."""
        index, parameter = line
        constraint = context.session.document.constraints[index]
        assert isinstance(constraint, CurveConstraint)
        yield from self._drag((index, int(parameter) + 1), event, context, constraint.with_point_at(parameter))

    def _drag(
        self, handle: tuple[int, int], event: PointerEvent, context: ToolContext, begun: CurveConstraint | None = None
    ) -> Gesture:
        """Drag a control point of a target; ``begun`` is the curve with a newly inserted point."""
        index, place = handle
        curve = begun or context.session.document.constraints[index]
        assert isinstance(curve, CurveConstraint)
        point = min(place, len(curve.target) - 1)
        scale = curve.camera.focal / context.camera.focal

        def changed(offset: NDArray[np.float64]) -> CurveConstraint:
            u, v = (offset * scale + curve.target[point]).tolist()
            return curve.with_target(point, (u, v))

        label = "Edit a curve" if begun is None else "Add a point to a curve"
        yield from drag_constraint(index, changed, label, event, context, self._settings, begun)

    def accept(self, context: ToolContext) -> bool:
        """Turn the source into a constraint with an equal target; return True if there was a source."""
        if not self.points:
            return False
        pixels = self.pixels(context)
        if len(pixels) < 2:
            return True
        session = context.session
        curve = CurveConstraint(as_pixels(pixels), as_pixels(pixels), context.camera)
        try:
            curve = curve.resolved(session.model, session.coefficients)
        except ValueError:
            return True
        document, index = session.document, len(session.document.constraints)
        document = replace(document, constraints=(*document.constraints, curve))
        document = Mirroring(self._settings.symmetry, session).with_images(document, [index])
        if not self._has_room(document, "curve", context):
            return True
        self.discard()
        with session.edit("Draw a curve"):
            session.replace(document)
        self._settings.selection.set(index)
        return True

    def remove_at(self, position: Pixel, context: ToolContext) -> bool:
        """Remove the control point within reach of ``position``, or its curve if only two are left."""
        source_point = self._source_point_at(position, context)
        if source_point is not None:
            self._steps.append(list(self.points))
            del self.points[source_point]
            return True
        handle = self.handle_at(position, context)
        if handle is None:
            return False
        index, point = handle
        session = context.session
        curve = session.document.constraints[index]
        assert isinstance(curve, CurveConstraint)
        try:
            shorter = curve.without_point(point)
            if not len(shorter.points):
                raise ValueError("the curve has no points left")
        except ValueError:
            self._remove(index, "Remove a curve", context)
            return True
        with session.edit("Remove a curve point"):
            mirroring = Mirroring(self._settings.symmetry, session)
            # The partner must be found while both curves have all their points.
            mirroring.partner(session.document, index)
            document = session.document.with_constraint(index, shorter)
            session.replace(mirroring.with_images(document, [index]))
        return True

    @property
    def can_accept(self) -> bool:
        """True if there is a source."""
        return bool(self.points)

    @property
    def can_step_back(self) -> bool:
        """True if the source can be stepped back."""
        return bool(self._steps)

    def step_back(self) -> bool:
        """Undo the last change of the source; return True if there was one."""
        if not self._steps:
            return False
        self.points = self._steps.pop()
        return True

    def discard(self) -> bool:
        """Discard the unaccepted source; return True if there was one."""
        had = bool(self.points)
        self.points, self._steps = [], []
        return had

    def hint(self, context: ToolContext) -> str:
        """Return the effect of a press, for the status bar."""
        if self.points:
            enough = "   ·   Enter: accept" if len(self.points) > 1 else ""
            return f"Click: add a point   ·   drag a point: move it{enough}   ·   Esc: discard"
        return "Click points of a curve on the face   ·   drag a green point: move it   ·   right click: remove it"
