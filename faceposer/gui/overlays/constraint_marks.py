"""Where the view shows the constraints that are more than a point: worked out once for a pose and a view."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from faceposer.geometry.camera import Camera
from faceposer.geometry.curves import curve_at, even_parameters, relaxed_bezier
from faceposer.geometry.picking import SurfacePoints
from faceposer.gui.viewport import Pixel, Viewport
from faceposer.render.scene import Scene
from faceposer.solve.constraints.curve import CurveConstraint
from faceposer.solve.constraints.fixed import FixedConstraint
from faceposer.solve.constraints.stroke import Pixels, StrokeConstraint
from faceposer.tools.distance_tool import PairMark, pair_marks
from faceposer.tools.gaze_tool import GazeTool, eyes_of
from faceposer.tools.stroke_tool import seen_pixels

Array = NDArray[np.float64]
# More points of a stroke than these tell the eye nothing more.
_MOST_DOTS = 600
_PER_PIECE = 16


@dataclass(frozen=True)
class StrokeMark:
    """A stroke in the view: its source on the face, (n, 2), and the way of its target, (m, 2)."""

    index: int
    source: Array
    target: Array
    width: float
    shape: str
    own_view: bool


@dataclass(frozen=True)
class CurveMark:
    """A curve in the view: its source on the face, (n, 2), the line of its target, (m, 2), and its control points."""

    index: int
    source: Array
    line: Array
    handles: Array
    own_view: bool


@dataclass(frozen=True)
class AreaMark:
    """The fixed vertices of one constraint that the view shows, (n, 2)."""

    index: int
    pixels: Array


@dataclass(frozen=True)
class GazeMark:
    """The handle that the eyes follow, and the eyes, (2, 2); without an index where it is only offered."""

    index: int | None
    handle: Pixel
    eyes: Array


@dataclass(frozen=True)
class ShapeMarks:
    """Everything that the view shows beside pins."""

    pairs: list[PairMark] = field(default_factory=list)
    strokes: list[StrokeMark] = field(default_factory=list)
    curves: list[CurveMark] = field(default_factory=list)
    areas: list[AreaMark] = field(default_factory=list)
    gaze: GazeMark | None = None

    def anchor(self, index: int) -> Pixel | None:
        """Return a place in the view beside which a label for constraint ``index`` can stand, or None."""
        places: list[Array] = [mark.ends.mean(axis=0) for mark in self.pairs if mark.index == index]
        places += [mark.target[-1] for mark in self.strokes if mark.index == index and len(mark.target)]
        places += [mark.handles[-1] for mark in self.curves if mark.index == index]
        places += [_rightmost(mark.pixels) for mark in self.areas if mark.index == index and len(mark.pixels)]
        if self.gaze is not None and self.gaze.index == index:
            places.append(np.array(self.gaze.handle))
        if not places:
            return None
        u, v = places[0].tolist()
        return (u, v)


def shape_marks(viewport: Viewport, scene: Scene, gaze: GazeTool, offers_gaze: bool, moving: bool) -> ShapeMarks:
    """Return how the constraints of the session appear, pins aside.

    Args:
        viewport: The view.
        scene: The face.
        gaze: Tells where the handle of the eyes is.
        offers_gaze: Whether the handle is shown although the eyes do not follow it yet.
        moving: Whether the face or the view moves: then what the face hides is told only by where it faces away.
    """
    camera = viewport.camera

    def hidden(points: SurfacePoints) -> NDArray[np.bool_]:
        return scene.facing_away(camera, points) if moving else viewport.hidden(points)

    marks = ShapeMarks(pair_marks(viewport))
    for i, constraint in enumerate(viewport.session.document.constraints):
        if isinstance(constraint, StrokeConstraint):
            source = constraint.placed
            if len(source) > _MOST_DOTS:
                source = source.subset(np.linspace(0, len(source) - 1, _MOST_DOTS).astype(np.int64))
            places = source.positions(scene.vertices, scene.triangles)
            target, own = _shown(constraint.target, constraint.camera, camera, places)
            scale = camera.focal / constraint.camera.focal if own else 1.0
            seen = camera.project(places[~hidden(source)])
            marks.strokes.append(StrokeMark(i, seen, target, constraint.width * scale, constraint.shape, own))
        elif isinstance(constraint, CurveConstraint):
            places = constraint.points.positions(scene.vertices, scene.triangles)
            handles, own = _shown(constraint.target, constraint.camera, camera, places)
            seen = camera.project(places[~hidden(constraint.points)])
            marks.curves.append(CurveMark(i, seen, curve_line(handles), handles, own))
        elif isinstance(constraint, FixedConstraint):
            points = constraint.points
            marks.areas.append(AreaMark(i, camera.project(_places(points.subset(~hidden(points)), scene))))
    eyes, found, handle = eyes_of(viewport.session.model.subject), gaze.constraint(viewport), gaze.handle(viewport)
    if eyes is None or handle is None or (found is None and not offers_gaze):
        return marks
    mark = GazeMark(None if found is None else found[0], handle, camera.project(eyes))
    return ShapeMarks(marks.pairs, marks.strokes, marks.curves, marks.areas, mark)


def curve_line(control: Array) -> Array:
    """Return points along the relaxed curve through ``control``, shape (n, 2), for drawing; one point stays alone."""
    if len(control) < 2:
        return control
    return curve_at(relaxed_bezier(control), even_parameters(len(control) - 1, _PER_PIECE))[0]


def _places(points: SurfacePoints, scene: Scene) -> Array:
    return points.positions(scene.vertices, scene.triangles)


def _shown(pixels: Pixels, camera: Camera, view: Camera, places: Array) -> tuple[Array, bool]:
    """Return where ``view`` shows what was drawn at ``pixels`` of ``camera``, and whether it is the same view.

    From elsewhere, a drawing is shown as if it stood in space as far away as ``places``, (n, 3), on the face do.
    """
    seen = seen_pixels(pixels, camera, view)
    if seen is not None:
        return seen, True
    depth = float(camera.to_camera(places)[:, 2].mean())
    offsets = (np.asarray(pixels, dtype=np.float64) - camera.principal_point) / camera.focal
    local = np.column_stack([offsets * depth, np.full(len(offsets), depth)])
    return view.project((local - camera.translation) @ camera.rotation), False


def _rightmost(pixels: Array) -> Array:
    row: Array = pixels[int(np.argmax(pixels[:, 0]))]
    return row
