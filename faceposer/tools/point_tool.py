"""Pins: points of the face that are dragged to where they should appear (Lau et al. 2009, section 4.1)."""

from dataclasses import replace

import numpy as np

from faceposer.geometry.picking import surface_positions
from faceposer.session.document import Document
from faceposer.solve.constraints.point import PointConstraint
from faceposer.tools.tool import Gesture, PointerEvent, Selection, ToolContext

# In pixels of a display at normal density; a pen trembles more than a mouse.
CLICK_THRESHOLD = 3.0
PEN_THRESHOLD = 10.0
PIN_RADIUS = 11.0


def pin_pixels(context: ToolContext) -> np.ndarray:
    """Return where the view shows the anchor of each constraint on the current face, shape (n, 2)."""
    session = context.session
    anchors = [c.points[0] for c in session.document.constraints]
    if not anchors:
        return np.zeros((0, 2))
    vertices = session.model.instance(session.coefficients)
    return context.camera.project(surface_positions(vertices, session.model.triangles, anchors))


def handle_pixels(context: ToolContext) -> np.ndarray:
    """Return where each pin is drawn and grabbed, shape (n, 2).

    In the view that it was made in, a pin is its target; from elsewhere the target's pixel means nothing, and the pin
    sits on the face.
    """
    pixels = pin_pixels(context)
    for i, constraint in enumerate(context.session.document.constraints):
        if isinstance(constraint, PointConstraint):
            target = constraint.camera.transferred(constraint.target, context.camera)
            pixels[i] = pixels[i] if target is None else target
    return pixels


class PointTool:
    """Places pins on the face and drags them."""

    def __init__(self, selection: Selection, threshold: float = CLICK_THRESHOLD) -> None:
        """Share ``selection``; a gesture of less than ``threshold`` pixels is a click."""
        self._selection = selection
        self.threshold = threshold

    def pin_at(self, position: tuple[float, float], context: ToolContext) -> int | None:
        """Return the index of the pin within reach of ``position``, the nearest and then the newest, or None."""
        pixels = handle_pixels(context)
        if len(pixels) == 0:
            return None
        distances = np.hypot(*(pixels - position).T)
        nearest = len(distances) - 1 - int(np.argmin(distances[::-1]))
        return nearest if distances[nearest] <= PIN_RADIUS * context.ui_scale else None

    def begins(self, event: PointerEvent, context: ToolContext) -> bool:
        """Whether the press ``event`` takes hold of a pin or of the face."""
        if event.button != "left" or event.modifiers - {"shift"}:
            return False
        return self.pin_at(event.position, context) is not None or context.pick(event.position) is not None

    def gesture(self, event: PointerEvent, context: ToolContext) -> Gesture:
        """Place or select a pin, and drag it with the rest of the selection."""
        # on press
        session, press = context.session, event.position
        pin = self.pin_at(press, context)
        if pin is not None and "shift" in event.modifiers:
            self._selection.toggle(pin)
            return
        selected_before = self._selection.indices
        is_new = pin is None
        try:
            with session.edit("Place a point" if is_new else "Move a point"):
                if pin is None:
                    pin = self._place(press, context)
                    if pin is None:
                        return
                    keep = self._selection.indices if "shift" in event.modifiers else frozenset()
                    self._selection.set(*keep, pin)
                elif pin not in self._selection.indices:
                    self._selection.set(pin)
                placed = session.document
                moved = sorted(self._selection.within(len(placed.constraints)))
                begun = self._under_this_camera(placed, moved, context)
                farthest = 0.0
                while True:
                    event = yield
                    # on release
                    if event.kind == "release":
                        break
                    # on move, from the first pixel: only the release tells a click from a short drag
                    offset = np.subtract(event.position, press)
                    farthest = max(farthest, float(np.hypot(*offset)))
                    session.replace(_shifted(begun, moved, offset))
                if 0.0 < farthest < self.threshold * context.ui_scale:
                    if is_new:
                        session.replace(placed)
                    else:
                        session.restore()
        except GeneratorExit:
            self._selection.indices = selected_before
            raise

    def _place(self, position: tuple[float, float], context: ToolContext) -> int | None:
        """Pin the point under ``position`` where it is, and return its index."""
        point = context.pick(position)
        if point is None:
            return None
        document = context.session.document
        constraint = PointConstraint(point, position, context.camera)
        context.session.replace(replace(document, constraints=(*document.constraints, constraint)))
        return len(document.constraints)

    def _under_this_camera(self, document: Document, pins: list[int], context: ToolContext) -> Document:
        """Return the document with ``pins`` expressed under the camera of the view, where they are seen there now."""
        pixels = handle_pixels(context)
        for i in pins:
            constraint = document.constraints[i]
            if isinstance(constraint, PointConstraint):
                u, v = pixels[i].tolist()
                document = document.with_constraint(i, replace(constraint, target=(u, v), camera=context.camera))
        return document

    def remove_at(self, position: tuple[float, float], context: ToolContext) -> bool:
        """Remove the pin within reach of ``position``; return whether there was one."""
        pin = self.pin_at(position, context)
        if pin is None:
            return False
        self._selection.set()
        context.session.remove_constraints({pin}, "Remove a point")
        return True


def _shifted(document: Document, pins: list[int], offset: np.ndarray) -> Document:
    """Return ``document`` with the targets of ``pins`` moved by ``offset`` pixels."""
    for i in pins:
        constraint = document.constraints[i]
        if isinstance(constraint, PointConstraint):
            u, v = np.add(constraint.target, offset).tolist()
            document = document.with_constraint(i, replace(constraint, target=(u, v)))
    return document
