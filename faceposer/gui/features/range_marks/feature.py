"""Range marks: the range of motion of the point under the pointer, and a border where a drag exceeds it."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from imgui_bundle import ImVec2, imgui
from numpy.typing import NDArray

from faceposer.geometry.camera import Camera
from faceposer.geometry.picking import SurfacePoint, SurfacePoints
from faceposer.gui.actions import Action
from faceposer.gui.context import EditorContext
from faceposer.gui.feature import Feature
from faceposer.gui.overlays.pins import draw_label
from faceposer.gui.widgets.theme import EDGE, INK, WARNING, u32
from faceposer.session.sketching import active_sketches, solver_input
from faceposer.solve.constraints.point import PointConstraint
from faceposer.solve.reach import HARDLY_MOVES, Reach, reach_of
from faceposer.tools.tool import Hover

Array = NDArray[np.float64]
Pixel = tuple[float, float]

#: Texts of the status bar and of the label at the pointer.
HARDLY_MOVES_TEXT = "This part of the face hardly moves"
BEYOND_TEXT = "The point cannot move any further"
# Pixels at normal density below which a range is too small to be visible around the pointer.
_SMALLEST = 6.0
_DIRECTIONS = 36
# Half angle of the border that is drawn where a drag exceeds the range, in radians.
_SECTOR = 0.65
# Multiple of the range from which a drag exceeds it; up to there, the point nearly reaches the pointer.
_BEYOND = 1.1


@dataclass(frozen=True, eq=False)
class PointRange:
    """Range of motion of one point of the face.

    Attributes:
        reach: Range in the image of ``camera``.
        camera: Camera of the range.
        origin: Pixel of the point in the starting pose, shape (2,).
        outline: Border of the range in pixels of the view, shape (n, 2).
    """

    reach: Reach
    camera: Camera
    origin: Array
    outline: Array

    @property
    def fixed(self) -> bool:
        """True if the point hardly moves."""
        return float(self.reach.mobility[0]) < HARDLY_MOVES

    def exceeded_by(self, target: Pixel) -> bool:
        """Return True if the pixel ``target`` is beyond the range."""
        pull = np.asarray(target) - self.origin
        length = float(np.hypot(*pull))
        return length > 1e-6 and length > _BEYOND * float(self.reach.pixels((pull / length)[None])[0])


class RangeMarksFeature(Feature):
    """Range of the point under the pointer, computed again when the pointer reaches another triangle.

    Attributes:
        computed: Number of ranges computed so far.
    """

    def __init__(self, context: EditorContext) -> None:
        """Serve ``context``."""
        super().__init__(context)
        self._key: tuple[object, ...] = ()
        self._range: PointRange | None = None
        self._start: tuple[tuple[object, ...], Array] | None = None
        self._picked_at: Pixel = (0.0, 0.0)
        self.computed = 0

    @property
    def shown(self) -> bool:
        """True if the outline is drawn around the pointer."""
        return self.context.settings.range_marks

    def actions(self) -> Sequence[Action]:
        """Return the entry of the View menu."""
        return [
            Action(
                "range-marks",
                "Show range marks",
                "View",
                self._toggle,
                checked=lambda: self.shown,
                separated=True,
                help="Outline how far the point under the pointer can move",
            )
        ]

    def _toggle(self) -> None:
        self.context.settings.range_marks = not self.shown

    def session_changed(self) -> None:
        """Discard the range, which belongs to another face."""
        self._key, self._range, self._start = (), None, None

    # State

    @property
    def _dragged_point(self) -> PointConstraint | None:
        """The point constraint that is dragged, or None if there is none or more than one."""
        toolbox = self.context.toolbox
        constraints = self.context.session.document.constraints
        if not toolbox.drags_points:
            return None
        found = [constraints[i] for i in toolbox.selection]
        points = [c for c in found if isinstance(c, PointConstraint)]
        return points[0] if len(points) == 1 else None

    @property
    def has_range(self) -> bool:
        """True if a point is under the pointer or dragged."""
        return self._range is not None

    def update(self) -> None:
        """Compute the range of the point that is dragged or under the pointer, if it has changed."""
        point, camera = self._current_point()
        if point is None:
            self._key, self._range = (), None
            return
        dragged = self._dragged_point is not None
        # Under the pointer the range hardly differs within a triangle.
        place = point.face if isinstance(point, SurfacePoint) and not dragged else point
        key = (place, camera, dragged, *self._start_key())
        if key == self._key:
            return
        self._key, self._range = key, self._range_of(point, camera)
        hover = self.context.toolbox.hover
        if hover is not None:
            self._picked_at = hover.position

    def _current_point(self) -> tuple[SurfacePoint | int | None, Camera]:
        """Return the point that is dragged or under the pointer, and the camera of its range."""
        context, toolbox = self.context, self.context.toolbox
        dragged, hover = self._dragged_point, self.context.toolbox.hover
        if dragged is not None:
            return dragged.anchor, dragged.camera
        suspended = toolbox.active or context.comparing or context.is_modal
        if hover is None or suspended or toolbox.chosen is not toolbox.point_tool:
            return None, context.viewport.camera
        return self._under_pointer(hover, context.viewport.camera)

    def _under_pointer(self, hover: Hover, camera: Camera) -> tuple[SurfacePoint | int | None, Camera]:
        """Return the point of the surface, or of a point constraint drawn from ``camera``, and ``camera``."""
        if hover.pin is None:
            return hover.point, camera
        constraints = self.context.session.document.constraints
        # Undo may have removed the constraint since the pointer last moved.
        constraint = constraints[hover.pin] if hover.pin < len(constraints) else None
        if isinstance(constraint, PointConstraint) and constraint.camera == camera:
            return constraint.anchor, camera
        return None, camera

    def _start_key(self) -> tuple[object, ...]:
        document = self.context.session.document
        gazes = tuple(c for c in document.constraints if c.kind == "gaze")
        sketches = active_sketches(document) if document.sketch_method == "paper" else ()
        return (self.context.session.model, id(document.start), gazes, sketches)

    def _start_pose(self) -> Array:
        """Return the starting pose of drags, shape (r,), with the eyes at their gaze."""
        key = self._start_key()
        if self._start is None or self._start[0] != key:
            session = self.context.session
            given = solver_input(session.model, session.document)[1]
            pose = session.model.neutral() if given is None else given
            for constraint in session.document.constraints:
                if constraint.enabled:
                    pose = constraint.offset_start(session.model, pose)
            self._start = (key, pose)
        return self._start[1]

    def _range_of(self, point: SurfacePoint | int, camera: Camera) -> PointRange:
        self.computed += 1
        model, points, start = self.context.session.model, SurfacePoints.of([point]), self._start_pose()
        reach = reach_of(model, start, points, camera)
        rows, neutral = model.rows_of(points)
        origin = camera.project(neutral + rows @ start)[0]
        return PointRange(reach, camera, origin, origin + reach.outline(0, _DIRECTIONS))

    @property
    def hint(self) -> str:
        """Note on the range of the point, or ""."""
        current, dragged = self._range, self._dragged_point
        if current is None:
            return ""
        if current.fixed:
            return HARDLY_MOVES_TEXT
        if dragged is not None and current.exceeded_by(dragged.target):
            return f"{BEYOND_TEXT}   ·   release: confirm   ·   Esc: cancel"
        return ""

    # Drawing

    def draw_over(self, draw: imgui.ImDrawList) -> None:
        """Draw the range of the point under the pointer, or its border where a drag exceeds it."""
        current, viewport = self._range, self.context.viewport
        if current is None or self.context.comparing:
            return
        dragged, hover = self._dragged_point, self.context.toolbox.hover
        if dragged is not None:
            if current.fixed:
                draw_label(draw, viewport, self._in_view(dragged), HARDLY_MOVES_TEXT)
            elif current.exceeded_by(dragged.target) and current.camera == viewport.camera:
                self._draw_border(draw, current, dragged.target)
        elif hover is not None and self.shown:
            # Within its triangle, the outline moves with the pointer.
            shift = np.subtract(hover.position, self._picked_at) if hover.surface else np.zeros(2)
            self._draw_outline(draw, current, shift)

    def _in_view(self, dragged: PointConstraint) -> Pixel:
        target = dragged.camera.transferred(dragged.target, self.context.viewport.camera)
        return dragged.target if target is None else target

    def _draw_outline(self, draw: imgui.ImDrawList, current: PointRange, shift: Array) -> None:
        scale = self.context.viewport.ui_scale
        size = float(np.hypot(*(current.outline - current.origin).T).max())
        if current.fixed or size < _SMALLEST * scale:
            return
        corners = self._in_window(current.outline + shift)
        closed = imgui.ImDrawFlags_.closed.value
        draw.add_convex_poly_filled(corners, u32(INK, 0.05))
        draw.add_polyline(corners, u32(EDGE, 0.28), 3.0 * scale, closed)
        draw.add_polyline(corners, u32(INK, 0.55), 1.2 * scale, closed)

    def _draw_border(self, draw: imgui.ImDrawList, current: PointRange, target: Pixel) -> None:
        """Draw the border of the range where the drag towards ``target`` exceeds it."""
        scale = self.context.viewport.ui_scale
        angle = np.arctan2(*(np.asarray(target) - current.origin)[::-1])
        angles = angle + np.linspace(-1.0, 1.0, 15) * _SECTOR
        border = current.reach.border(0, np.stack([np.cos(angles), np.sin(angles)], axis=1))
        corners = self._in_window(current.origin + border)
        draw.add_polyline(corners, u32(EDGE, 0.5), 4.0 * scale, 0)
        draw.add_polyline(corners, u32(WARNING, 0.9), 2.0 * scale, 0)

    def _in_window(self, pixels: Array) -> list[ImVec2 | tuple[int | float, int | float] | list[int | float]]:
        left, top = self.context.viewport.origin
        return [ImVec2(u + left, v + top) for u, v in pixels.tolist()]
