"""Range marks: how far the point under the pointer can go, and whether a dragged point has reached its range."""

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
from faceposer.solve.constraints.point import PointConstraint
from faceposer.solve.reach import HARDLY_MOVES, Reach, reach_of
from faceposer.tools.tool import Hover

Array = NDArray[np.float64]
Pixel = tuple[float, float]

#: What the status bar and the mark at the pointer say.
HARDLY_MOVES_TEXT = "This part of the face hardly moves"
BEYOND_TEXT = "This is as far as the point goes"
# A range of fewer pixels at normal density is too small to be seen around the pointer.
_SMALLEST = 6.0
_DIRECTIONS = 36
# Of a point that is dragged beyond its range, the border is drawn so far to both sides of the pull, in radians.
_SECTOR = 0.65
# A pull counts as beyond the range from this multiple of it on: below, nearly all of it is met.
_BEYOND = 1.1


@dataclass(frozen=True, eq=False)
class PointRange:
    """How far one point of the face can go.

    Attributes:
        reach: In the picture of ``camera``.
        camera: Where it is seen.
        origin: Pixel of the point in the pose that pulls start from.
        outline: Border of its range, pixels of the view, shape (n, 2).
    """

    reach: Reach
    camera: Camera
    origin: Array
    outline: Array

    @property
    def fixed(self) -> bool:
        """Whether the point hardly moves."""
        return float(self.reach.mobility[0]) < HARDLY_MOVES

    def exceeded_by(self, target: Pixel) -> bool:
        """Whether the pixel ``target`` lies beyond the range."""
        pull = np.asarray(target) - self.origin
        length = float(np.hypot(*pull))
        return length > 1e-6 and length > _BEYOND * float(self.reach.pixels((pull / length)[None])[0])


class RangeMarksFeature(Feature):
    """The range of the point under the pointer, worked out only when the pointer comes to another triangle."""

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
        """Whether the outline is drawn around the pointer."""
        return self.context.settings.range_marks

    def actions(self) -> Sequence[Action]:
        """Return the entry of the menu "View"."""
        return [
            Action(
                "range-marks",
                "Show range marks",
                "View",
                self._toggle,
                checked=lambda: self.shown,
                separated=True,
                help="Outline how far the point under the pointer can go",
            )
        ]

    def _toggle(self) -> None:
        self.context.settings.range_marks = not self.shown

    def session_changed(self) -> None:
        """Forget the range of a point of another face."""
        self._key, self._range, self._start = (), None, None

    # What it knows

    @property
    def _pulled(self) -> PointConstraint | None:
        """The point that is dragged now; None where none or several are."""
        toolbox = self.context.toolbox
        constraints = self.context.session.document.constraints
        if not toolbox.drags_points:
            return None
        found = [constraints[i] for i in toolbox.selection]
        points = [c for c in found if isinstance(c, PointConstraint)]
        return points[0] if len(points) == 1 else None

    @property
    def looks_at_something(self) -> bool:
        """Whether a point lies under the pointer or is dragged."""
        return self._range is not None

    def update(self) -> None:
        """Look at what lies under the pointer, or is dragged, if that has changed."""
        point, camera = self._looked_at()
        if point is None:
            self._key, self._range = (), None
            return
        pulled = self._pulled is not None
        # Under the pointer the range hardly differs within a triangle.
        place = point.face if isinstance(point, SurfacePoint) and not pulled else point
        key = (place, camera, pulled, *self._start_key())
        if key == self._key:
            return
        self._key, self._range = key, self._range_of(point, camera)
        hover = self.context.toolbox.hover
        if hover is not None:
            self._picked_at = hover.position

    def _looked_at(self) -> tuple[SurfacePoint | int | None, Camera]:
        """Return the point that is dragged or lies under the pointer, and where it is seen."""
        context, toolbox = self.context, self.context.toolbox
        pulled, hover = self._pulled, self.context.toolbox.hover
        if pulled is not None:
            return pulled.anchor, pulled.camera
        quiet = toolbox.active or context.comparing or context.is_modal
        if hover is None or quiet or toolbox.chosen is not toolbox.point_tool:
            return None, context.viewport.camera
        return self._under_pointer(hover, context.viewport.camera)

    def _under_pointer(self, hover: Hover, camera: Camera) -> tuple[SurfacePoint | int | None, Camera]:
        """Return the point whose range is shown, and where it is seen: that of the face, or of a pin of this view."""
        if hover.pin is None:
            return hover.point, camera
        constraints = self.context.session.document.constraints
        # Undo may have taken it away since the pointer last moved.
        constraint = constraints[hover.pin] if hover.pin < len(constraints) else None
        if isinstance(constraint, PointConstraint) and constraint.camera == camera:
            return constraint.anchor, camera
        return None, camera

    def _start_key(self) -> tuple[object, ...]:
        document = self.context.session.document
        gazes = tuple(c for c in document.constraints if c.kind == "gaze")
        return (self.context.session.model, id(document.start), gazes)

    def _start_pose(self) -> Array:
        """Return the pose that pulls start from, shape (r,), with the eyes where they look."""
        key = self._start_key()
        if self._start is None or self._start[0] != key:
            session = self.context.session
            pose = session.model.neutral() if session.document.start is None else session.document.start
            for constraint in session.document.constraints:
                if constraint.enabled:
                    pose = constraint.moved_start(session.model, pose)
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
        """What is worth knowing of the point before and while it is pulled."""
        found, pulled = self._range, self._pulled
        if found is None:
            return ""
        if found.fixed:
            return HARDLY_MOVES_TEXT
        if pulled is not None and found.exceeded_by(pulled.target):
            return f"{BEYOND_TEXT}   ·   release: keep   ·   Esc: take back"
        return ""

    # What it draws

    def draw_over(self, draw: imgui.ImDrawList) -> None:
        """Draw the range of the point under the pointer, or the border that a dragged point has come to."""
        found, viewport = self._range, self.context.viewport
        if found is None or self.context.comparing:
            return
        pulled, hover = self._pulled, self.context.toolbox.hover
        if pulled is not None:
            if found.fixed:
                draw_label(draw, viewport, self._in_view(pulled), HARDLY_MOVES_TEXT)
            elif found.exceeded_by(pulled.target) and found.camera == viewport.camera:
                self._draw_border(draw, found, pulled.target)
        elif hover is not None and self.shown:
            # Within its triangle the pointer takes the outline along.
            shift = np.subtract(hover.position, self._picked_at) if hover.surface else np.zeros(2)
            self._draw_outline(draw, found, shift)

    def _in_view(self, pulled: PointConstraint) -> Pixel:
        target = pulled.camera.transferred(pulled.target, self.context.viewport.camera)
        return pulled.target if target is None else target

    def _draw_outline(self, draw: imgui.ImDrawList, found: PointRange, shift: Array) -> None:
        scale = self.context.viewport.ui_scale
        size = float(np.hypot(*(found.outline - found.origin).T).max())
        if found.fixed or size < _SMALLEST * scale:
            return
        corners = self._placed(found.outline + shift)
        closed = imgui.ImDrawFlags_.closed.value
        draw.add_convex_poly_filled(corners, u32(INK, 0.05))
        draw.add_polyline(corners, u32(EDGE, 0.28), 3.0 * scale, closed)
        draw.add_polyline(corners, u32(INK, 0.55), 1.2 * scale, closed)

    def _draw_border(self, draw: imgui.ImDrawList, found: PointRange, target: Pixel) -> None:
        """Draw the border of the range where the pull towards ``target`` leaves it."""
        scale = self.context.viewport.ui_scale
        angle = np.arctan2(*(np.asarray(target) - found.origin)[::-1])
        fan = angle + np.linspace(-1.0, 1.0, 15) * _SECTOR
        border = found.reach.border(0, np.stack([np.cos(fan), np.sin(fan)], axis=1))
        corners = self._placed(found.origin + border)
        draw.add_polyline(corners, u32(EDGE, 0.5), 4.0 * scale, 0)
        draw.add_polyline(corners, u32(WARNING, 0.9), 2.0 * scale, 0)

    def _placed(self, pixels: Array) -> list[ImVec2 | tuple[int | float, int | float] | list[int | float]]:
        left, top = self.context.viewport.origin
        return [ImVec2(u + left, v + top) for u, v in pixels.tolist()]
