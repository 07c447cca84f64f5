"""Distances between two points of the face, closed or opened by dragging (Lau et al. 2009, section 4.2)."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from faceposer.geometry.picking import SurfacePoint
from faceposer.session.document import Document
from faceposer.solve.constraints.distance import DistanceConstraint
from faceposer.tools.dragging import drag_constraint
from faceposer.tools.symmetry import Mirroring
from faceposer.tools.tool import Gesture, PointerEvent, PosingTool, ToolContext, ToolSettings

_REACH = 9.0
_CLICK = 4.0
Pixel = tuple[float, float]


@dataclass(frozen=True)
class PairMark:
    """A distance as drawn in the view: its two points and its target length.

    Attributes:
        index: Index of the constraint.
        ends: Pixels of the two points, shape (2, 2).
        goal: Ends of a line of the target's length with the same centre, shape (2, 2); None in other views.
    """

    index: int
    ends: NDArray[np.float64]
    goal: NDArray[np.float64] | None


def pair_mark(index: int, constraint: DistanceConstraint, context: ToolContext) -> PairMark:
    """Return the mark of a distance constraint in the view."""
    session, camera = context.session, context.camera
    ends = camera.project(session.model.positions_at(constraint.points, session.coefficients))
    goal = None
    # Distances match between windows that show the same view at the same size.
    if constraint.camera.transferred((0.0, 0.0), camera) is not None:
        along = ends[1] - ends[0]
        length = float(np.hypot(*along))
        unit = along / length if length > 1e-6 else np.array([0.0, 1.0])
        half = 0.5 * constraint.target * camera.focal / constraint.camera.focal * unit
        middle = ends.mean(axis=0)
        goal = np.stack([middle - half, middle + half])
    return PairMark(index, ends, goal)


def pair_marks(context: ToolContext) -> list[PairMark]:
    """Return the marks of all distance constraints of the session."""
    constraints = enumerate(context.session.document.constraints)
    return [pair_mark(i, c, context) for i, c in constraints if isinstance(c, DistanceConstraint)]


def with_view_camera(constraint: DistanceConstraint, context: ToolContext) -> DistanceConstraint:
    """Return ``constraint`` under the camera of the view; from another viewpoint, with the distance measured there."""
    camera = context.camera
    if constraint.camera == camera:
        return constraint
    if constraint.camera.transferred((0.0, 0.0), camera) is not None:
        return replace(constraint, target=constraint.target * camera.focal / constraint.camera.focal, camera=camera)
    seen = replace(constraint, camera=camera)
    return replace(seen, target=seen.measured(context.session.model, context.session.coefficients))


class DistanceTool(PosingTool):
    """Connects two points of the face and sets their distance in the view.

    Attributes:
        first: First point of a new distance, or None.
        pointer: Position of the pointer while a line is drawn, or None.
    """

    name = "distance"
    label = "Distance"
    key = "D"
    help = "Set the distance between two points in the view, such as the height of the mouth"
    empty_text = "Drag from one point of the face to another, or choose a distance above, then set it with its slider."
    drag_hint = "Move: choose the second point, or change the distance   ·   release: confirm   ·   Esc: cancel"
    cursor = "pick"
    handle_order = 2

    def __init__(self, tool_settings: ToolSettings) -> None:
        """Use the shared ``tool_settings``."""
        super().__init__(tool_settings)
        self.first: SurfacePoint | None = None
        self.pointer: Pixel | None = None

    def handle_at(self, position: Pixel, context: ToolContext) -> tuple[int, int] | None:
        """Return the constraint and its end within reach of ``position``, or None.

        An end hidden by the face is out of reach, unless the constraint was made in this view.
        """
        best, found = _REACH * context.ui_scale, None
        for mark in pair_marks(context):
            constraint = context.session.document.constraints[mark.index]
            if constraint.locked or mark.index in context.unmarked:
                continue
            distances = np.hypot(*(mark.ends - position).T)
            end = int(np.argmin(distances))
            if distances[end] <= best:
                if mark.goal is None and context.hidden(constraint.points.subset(np.array([end])))[0]:
                    continue
                best, found = float(distances[end]), (mark.index, end)
        return found

    def hits_handle(self, event: PointerEvent, context: ToolContext) -> bool:
        """Return True if the press ``event`` hits an end of a distance."""
        return event.button == "left" and not event.modifiers and self.handle_at(event.position, context) is not None

    def begins(self, event: PointerEvent, context: ToolContext) -> bool:
        """Return True if the press ``event`` hits a handle or the face."""
        if event.button != "left" or event.modifiers:
            return False
        return self.handle_at(event.position, context) is not None or context.pick(event.position) is not None

    def handle_under(self, position: Pixel, context: ToolContext) -> int | None:
        """Return the distance whose end would be grabbed by a press at ``position``, or None."""
        found = self.handle_at(position, context) if self.first is None else None
        return None if found is None else found[0]

    def gesture(self, event: PointerEvent, context: ToolContext) -> Gesture:
        """Drag a handle, or connect two points with a drag or two clicks."""
        handle = self.handle_at(event.position, context) if self.first is None else None
        if handle is not None:
            yield from self._drag(handle, event, context)
            return
        # on press
        press, before = event.position, self.first
        begin = context.pick(press)
        if begin is None:
            return
        if before is not None:
            self._join(before, begin, context)
            self.first = self.pointer = None
            return
        self.first = begin
        try:
            while True:
                event = yield
                # on release
                if event.kind == "release":
                    break
                # on move
                self.pointer = event.position
        except GeneratorExit:
            self.first = self.pointer = None
            raise
        self.pointer = None
        if np.hypot(*np.subtract(event.position, press)) <= _CLICK * context.ui_scale:
            return
        end = context.pick(event.position)
        self.first = None
        if end is not None:
            self._join(begin, end, context)

    def _join(self, first: SurfacePoint, second: SurfacePoint, context: ToolContext) -> None:
        if first != second:
            add_distance((first, second), context, self._settings)

    def _drag(self, handle: tuple[int, int], event: PointerEvent, context: ToolContext) -> Gesture:
        """Drag one end along the line; the other end is fixed, and the distance changes by the same amount."""
        index, end = handle
        session = context.session
        constraint = session.document.constraints[index]
        if not isinstance(constraint, DistanceConstraint):
            return
        begun = with_view_camera(constraint, context)
        pixels = begun.pixels(session.model, session.coefficients)
        along = pixels[end] - pixels[1 - end]
        length = float(np.hypot(*along))
        unit = along / length if length > 1e-6 else np.array([0.0, 1.0 if end else -1.0])

        def changed(offset: NDArray[np.float64]) -> DistanceConstraint:
            return replace(begun, target=max(begun.target + float(offset @ unit), 0.0))

        yield from drag_constraint(index, changed, "Change a distance", event, context, self._settings)

    def remove_at(self, position: Pixel, context: ToolContext) -> bool:
        """Remove the distance with an end within reach of ``position``; return True if there was one."""
        handle = self.handle_at(position, context)
        if handle is None:
            return False
        self._remove(handle[0], "Remove a distance", context)
        return True

    @property
    def can_step_back(self) -> bool:
        """True if the first end is set and the second is not."""
        return self.first is not None

    def step_back(self) -> bool:
        """Discard the first point; return True if there was one."""
        return self.discard()

    def discard(self) -> bool:
        """Discard the first point; return True if there was one."""
        had = self.first is not None
        self.first = self.pointer = None
        return had

    def hint(self, context: ToolContext) -> str:
        """Return the effect of a press, for the status bar."""
        if self.first is not None:
            return "Click: set the second point   ·   Esc: discard the first"
        return "Drag from one point to another, or click both   ·   drag an end: change the distance"


def add_distance(
    anchors: tuple[SurfacePoint | int, SurfacePoint | int], context: ToolContext, tool_settings: ToolSettings
) -> None:
    """Add the distance between two places as it appears now, as one step, and select it; an existing one is kept."""
    session = context.session
    for i, constraint in enumerate(session.document.constraints):
        if isinstance(constraint, DistanceConstraint) and set(constraint.anchors) == set(anchors):
            tool_settings.selection.set(i)
            return
    pair = DistanceConstraint(anchors, 0.0, context.camera)
    pair = replace(pair, target=pair.measured(session.model, session.coefficients))
    with session.edit("Add a distance"):
        document: Document = session.document
        index = len(document.constraints)
        document = replace(document, constraints=(*document.constraints, pair))
        session.replace(Mirroring(tool_settings.symmetry, session).with_images(document, [index]))
        tool_settings.selection.set(index)
