"""Pins: points of the face, dragged to their target pixels (Lau et al. 2009, section 4.1)."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from faceposer.geometry.picking import SurfacePoint, SurfacePoints
from faceposer.session.document import Document
from faceposer.solve.constraints.point import PointConstraint
from faceposer.tools.symmetry import Mirroring
from faceposer.tools.tool import Gesture, PointerEvent, PosingTool, ToolContext, ToolSettings

# In pixels of a display at normal density; a pen is less steady than a mouse.
CLICK_THRESHOLD = 3.0
PEN_THRESHOLD = 10.0
PIN_RADIUS = 11.0
Pixel = tuple[float, float]


def pins(context: ToolContext) -> dict[int, PointConstraint]:
    """Return the point constraints of the session by index."""
    constraints = context.session.document.constraints
    return {i: c for i, c in enumerate(constraints) if isinstance(c, PointConstraint)}


def handle_pixels(context: ToolContext) -> dict[int, Pixel]:
    """Return the pixel of each pin's handle, by the index of its constraint.

    In the view in which it was made, a pin is drawn at its target; in other views, where the target has no meaning, at
    its point on the face.
    """
    session, camera = context.session, context.camera
    handles: dict[int, Pixel] = {}
    for i, constraint in pins(context).items():
        target = constraint.camera.transferred(constraint.target, camera)
        if target is None:
            position = session.model.positions_at(constraint.points, session.coefficients)
            u, v = camera.project(position)[0].tolist()
            target = (u, v)
        handles[i] = target
    return handles


class PointTool(PosingTool):
    """Places pins on the face and drags them."""

    name = "point"
    label = "Points"
    key = "Q"
    help = "Drag points of the face and the handles of all constraints"
    empty_text = "Drag a point of the face: it is pinned where you release it, and the face follows."
    cursor = "press"
    drag_cursor = "grab"
    handle_order = 1

    def __init__(self, tool_settings: ToolSettings, threshold: float = CLICK_THRESHOLD) -> None:
        """Use the shared ``tool_settings``; a gesture shorter than ``threshold`` pixels is a click."""
        super().__init__(tool_settings)
        self.threshold = threshold

    def pin_at(self, position: Pixel, context: ToolContext) -> int | None:
        """Return the index of the pin within reach of ``position``, the nearest and then the newest, or None.

        A pin at a hidden point is out of reach, unless it was made in this view.
        """
        handles = handle_pixels(context)
        if not handles:
            return None
        order = sorted(handles, reverse=True)
        distances = np.hypot(*(np.array([handles[i] for i in order]) - position).T)
        nearest = order[int(np.argmin(distances))]
        if distances.min() > PIN_RADIUS * context.ui_scale:
            return None
        constraint = pins(context)[nearest]
        if constraint.camera.transferred(constraint.target, context.camera) is None:
            points = SurfacePoints.of([constraint.anchor])
            return None if context.hidden(points)[0] else nearest
        return nearest

    def hits_handle(self, event: PointerEvent, context: ToolContext) -> bool:
        """Return True if the press ``event`` hits a pin."""
        return self._accepts(event) and self.pin_at(event.position, context) is not None

    def begins(self, event: PointerEvent, context: ToolContext) -> bool:
        """Return True if the press ``event`` hits a pin or the face."""
        if not self._accepts(event):
            return False
        return self.pin_at(event.position, context) is not None or context.pick(event.position) is not None

    def _accepts(self, event: PointerEvent) -> bool:
        return event.button == "left" and not event.modifiers - {"shift"}

    def handle_under(self, position: Pixel, context: ToolContext) -> int | None:
        """Return the pin that would be grabbed by a press at ``position``, or None."""
        return self.pin_at(position, context)

    def gesture(self, event: PointerEvent, context: ToolContext) -> Gesture:
        """Place or select a pin, and drag it with the rest of the selection."""
        # on press
        session, selection, press = context.session, self._settings.selection, event.position
        pin = self.pin_at(press, context)
        if pin is not None and "shift" in event.modifiers:
            selection.toggle(pin)
            return
        selected_before = selection.indices
        is_new = pin is None
        try:
            with session.edit("Place a point" if is_new else "Move a point"):
                mirroring = Mirroring(self._settings.symmetry, session)
                if pin is None:
                    pin = self._place(press, context)
                    if pin is None:
                        return
                    keep = selection.indices if "shift" in event.modifiers else frozenset()
                    selection.set(*keep, pin)
                elif pin not in selection.indices:
                    selection.set(pin)
                if session.document.constraints[pin].locked:
                    return
                moved = self._movable(session.document)
                session.replace(mirroring.with_images(session.document, moved))
                placed = session.document
                begun = self._with_view_camera(placed, moved, context)
                farthest = 0.0
                while True:
                    event = yield
                    # on release
                    if event.kind == "release":
                        break
                    # on move, from the first pixel: only the release distinguishes a click from a short drag
                    offset = np.subtract(event.position, press)
                    farthest = max(farthest, float(np.hypot(*offset)))
                    session.replace(mirroring.with_images(shifted(begun, moved, offset), moved))
                if 0.0 < farthest < self.threshold * context.ui_scale:
                    if is_new:
                        session.replace(placed)
                    else:
                        session.restore()
        except GeneratorExit:
            selection.indices = selected_before
            raise

    def _movable(self, document: Document) -> list[int]:
        """Return the selected pins that are not locked."""
        chosen = sorted(self._settings.selection.within(len(document.constraints)))
        found = [(i, document.constraints[i]) for i in chosen]
        return [i for i, c in found if isinstance(c, PointConstraint) and not c.locked]

    def _place(self, position: Pixel, context: ToolContext) -> int | None:
        """Pin the point under ``position`` at its solved position, and return the index of the constraint."""
        point = context.pick(position)
        if point is None:
            return None
        document = context.session.document
        u, v = (np.asarray(position) + _contact_offset(point, context)).tolist()
        constraint = PointConstraint(point, (u, v), context.camera)
        context.session.replace(replace(document, constraints=(*document.constraints, constraint)))
        return len(document.constraints)

    def _with_view_camera(self, document: Document, chosen: list[int], context: ToolContext) -> Document:
        """Return the document with the ``chosen`` pins under the camera of the view, at their present pixels there."""
        handles = handle_pixels(context)
        for i in chosen:
            constraint = document.constraints[i]
            if isinstance(constraint, PointConstraint):
                document = document.with_constraint(i, replace(constraint, target=handles[i], camera=context.camera))
        return document

    def remove_at(self, position: Pixel, context: ToolContext) -> bool:
        """Remove the pin within reach of ``position``; return True if there was one."""
        pin = self.pin_at(position, context)
        if pin is None or context.session.document.constraints[pin].locked:
            return False
        self._remove(pin, "Remove a point", context)
        return True

    def hint(self, context: ToolContext) -> str:
        """Return the effect of a press on the face, for the status bar."""
        return "Drag: pull the face here   ·   click: pin it here"


def shifted(document: Document, chosen: list[int], offset: "NDArray[np.float64] | Pixel") -> Document:
    """Return ``document`` with the targets of the ``chosen`` pins moved by ``offset`` pixels, shape (2,)."""
    for i in chosen:
        constraint = document.constraints[i]
        if isinstance(constraint, PointConstraint):
            u, v = np.add(constraint.target, offset).tolist()
            document = document.with_constraint(i, replace(constraint, target=(u, v)))
    return document


def _contact_offset(point: SurfacePoint, context: ToolContext) -> NDArray[np.float64]:
    """Return the pixels, shape (2,), from the displayed position of ``point``, after contact, to the solved one.

    Constraints apply to the solved pose: pinned at its displayed position, the point would move at once.
    """
    session, points = context.session, SurfacePoints.of([point])
    solved = session.model.instance(session.coefficients)
    displayed = session.vertices
    corners = points.corners(session.model.triangles)
    if np.array_equal(solved[corners], displayed[corners]):
        return np.zeros(2)
    target, start = (
        context.camera.project(points.positions(vertices, session.model.triangles))[0]
        for vertices in (solved, displayed)
    )
    offset: NDArray[np.float64] = target - start
    return offset
