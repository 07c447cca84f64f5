"""Strokes: a source painted on the face, then its target (Lau et al. 2009, section 4.3)."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from faceposer.geometry.camera import Camera
from faceposer.geometry.picking import SurfacePoints
from faceposer.geometry.strokes import MOST_PIXELS, smoothed, stroke_pixels
from faceposer.session.document import Document
from faceposer.solve.constraints.stroke import WIDEST, Pixels, StrokeConstraint, as_pixels
from faceposer.tools.dragging import drag_drawn
from faceposer.tools.symmetry import Mirroring
from faceposer.tools.tool import Gesture, PointerEvent, PosingTool, ToolContext, ToolSettings

_REACH = 9.0
# Maximum number of pixels that are picked; more are thinned out.
_MOST_PIXELS = 4000
Pixel = tuple[float, float]


@dataclass(frozen=True)
class SourceStroke:
    """A painted part of the face without a target."""

    points: SurfacePoints
    width: float


class StrokeTool(PosingTool):
    """Paints a source on the face, then a target anywhere, which the face then follows.

    Attributes:
        source: Source of the next target, or None.
        redrawn: Source of the constraint that gets a new target, or None.
        drawing: Pixels and width of the stroke being drawn, or None.
    """

    name = "stroke"
    label = "Stroke"
    key = "S"
    help = "Draw a stroke on the face, then draw its target"
    empty_text = "Draw a stroke on the face, then draw its target."
    drag_hint = "Move: draw   ·   release: end the stroke   ·   Esc: cancel"
    cursor = "draw"
    edited_by_points = False

    def __init__(self, tool_settings: ToolSettings) -> None:
        """Use the shared ``tool_settings``."""
        super().__init__(tool_settings)
        self.source: SourceStroke | None = None
        self.redrawn: SurfacePoints | None = None
        self.drawing: tuple[list[Pixel], float] | None = None

    @property
    def draws_target(self) -> bool:
        """True if the next stroke is a target."""
        return self.source is not None or self.redrawn is not None

    def redraw(self, stroke: StrokeConstraint) -> None:
        """Make the next stroke the new target of ``stroke``, at whatever index it then has."""
        self.source, self.redrawn = None, stroke.placed

    def _target_at(self, position: Pixel, context: ToolContext) -> int | None:
        """Return the stroke of this view whose target passes within reach of ``position``, or None."""
        for i, constraint in reversed(list(enumerate(context.session.document.constraints))):
            if isinstance(constraint, StrokeConstraint) and not constraint.locked and i not in context.unmarked:
                seen = pixels_in_view(constraint.target, constraint.camera, context.camera)
                reach = _REACH * context.ui_scale + constraint.width / 2.0
                if seen is not None and distance_to_line(position, seen) <= reach:
                    return i
        return None

    def begins(self, event: PointerEvent, context: ToolContext) -> bool:
        """Return True if the press ``event`` starts a stroke, or with Shift moves a target."""
        if event.button != "left" or event.modifiers - {"shift"}:
            return False
        if "shift" in event.modifiers:
            return self._target_at(event.position, context) is not None
        return self.draws_target or context.pick(event.position) is not None

    @property
    def works_off_face(self) -> bool:
        """True if a target is drawn, which may be off the face."""
        return self.draws_target

    def gesture(self, event: PointerEvent, context: ToolContext) -> Gesture:
        """Draw a source or a target, or move a target."""
        if "shift" in event.modifiers:
            yield from self._move(event, context)
            return
        # on press
        path, pressures = [event.position], [event.pressure]
        try:
            while True:
                self.drawing = (path, self._width(pressures, context))
                event = yield
                # on release
                if event.kind == "release":
                    break
                # on move
                path.append(event.position)
                pressures.append(event.pressure)
            width = self._width(pressures, context)
        finally:
            self.drawing = None
        shape = self._settings.options.shape
        line = smoothed(path, closed=shape != "line")
        target = as_pixels(line) if self.draws_target else None
        try:
            pixels = stroke_pixels(line if target is None else target, width, shape)
        except ValueError:
            context.notify(f"The stroke is not kept: it covers more than {MOST_PIXELS / 1e6:g} million pixels")
            return
        if target is not None:
            self._finish(target, width, context)
            return
        points, met = context.pick_many(pixels[:: len(pixels) // _MOST_PIXELS + 1])
        if met.any():
            self.source = SourceStroke(points, width)

    def _width(self, pressures: list[float], context: ToolContext) -> float:
        """Return the width of the brush, scaled by the mean pressure of the pen; that of a mouse is 1."""
        width = self._settings.options.brush * context.ui_scale * float(np.mean(pressures))
        return min(max(width, 1.0), WIDEST)

    def _finish(self, target: Pixels, width: float, context: ToolContext) -> None:
        """Create the constraint, or set its new target."""
        session, options = context.session, self._settings.options
        document = session.document
        redrawn, source = self.redrawn, self.source
        self.redrawn = self.source = None
        if redrawn is not None:
            found = [
                (i, c)
                for i, c in enumerate(document.constraints)
                if isinstance(c, StrokeConstraint) and not c.locked and c.placed == redrawn
            ]
            if not found:
                return
            index, old = found[0]
            stroke = replace(old, target=target, width=width, camera=context.camera, shape=options.shape)
            self._keep(document.with_constraint(index, stroke), index, "Redraw a target", context)
        elif source is not None:
            stroke = StrokeConstraint(source.points, target, width, context.camera, options.shape, options.energy)
            index = len(document.constraints)
            document = replace(document, constraints=(*document.constraints, stroke))
            self._keep(document, index, "Draw a stroke", context)

    def _keep(self, document: Document, index: int, label: str, context: ToolContext) -> None:
        """Make ``document``, with the new stroke ``index`` and its mirror image, one step; or say why it cannot be."""
        session = context.session
        document = Mirroring(self._settings.symmetry, session).with_images(document, [index])
        if not self._has_room(document, "stroke", context):
            return
        with session.edit(label):
            session.replace(document)
        self._settings.selection.set(index)

    def _move(self, event: PointerEvent, context: ToolContext) -> Gesture:
        """Move a target by the motion of the pointer."""
        index = self._target_at(event.position, context)
        if index is not None:
            yield from drag_drawn(index, "Move a target", event, context, self._settings)

    def remove_at(self, position: Pixel, context: ToolContext) -> bool:
        """Remove the stroke whose target passes within reach of ``position``; return True if there was one."""
        index = self._target_at(position, context)
        if index is None:
            return False
        self._remove(index, "Remove a stroke", context)
        return True

    @property
    def can_step_back(self) -> bool:
        """True if the source is drawn and the target is not."""
        return self.draws_target

    def step_back(self) -> bool:
        """Discard the source; return True if there was one."""
        return self.discard()

    def discard(self) -> bool:
        """Discard the source, or the request to redraw a target; return True if there was either."""
        had = self.draws_target
        self.source = self.redrawn = None
        return had

    def hint(self, context: ToolContext) -> str:
        """Return the effect of a press, for the status bar."""
        if self.draws_target:
            return "Draw the target, anywhere   ·   Esc: discard the source"
        return "Draw on the part of the face to move   ·   Shift+drag a target: move it   ·   [ ]: brush width"


def pixels_in_view(pixels: Pixels, camera: Camera, view: Camera) -> NDArray[np.float64] | None:
    """Return ``pixels`` of ``camera`` in ``view``, shape (n, 2), or None unless both share a viewpoint."""
    origin = camera.transferred((0.0, 0.0), view)
    if origin is None:
        return None
    return np.asarray(pixels, dtype=np.float64) * (view.focal / camera.focal) + origin


def distance_to_line(position: Pixel, line: NDArray[np.float64]) -> float:
    """Return the distance of ``position`` from the polyline ``line``, shape (n, 2)."""
    begin, end = line, np.concatenate([line[1:], line[-1:]])
    along = end - begin
    squared = np.maximum(np.einsum("nd,nd->n", along, along), 1e-12)
    share = np.clip(np.einsum("nd,nd->n", np.asarray(position) - begin, along) / squared, 0.0, 1.0)
    return float(np.hypot(*(begin + share[:, None] * along - position).T).min())
