"""Trajectories: paths of points in the image, drawn in real time (Lau et al. 2009, section 7)."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from faceposer.geometry.camera import Camera
from faceposer.geometry.picking import SurfacePoint, SurfacePoints
from faceposer.tools.symmetry import surface_mirror
from faceposer.tools.tool import Gesture, PointerEvent, PosingTool, ToolContext, ToolSettings

Array = NDArray[np.float64]
Pixel = tuple[float, float]

# Pixels at normal density: reach of feature points, reach of trajectories, and minimum length of a trajectory.
_SNAP, _REACH, _SHORTEST = 12.0, 9.0, 6.0
# Share of the head's height: a point closer to its mirror image is in the middle.
_MIDDLE = 0.04


@dataclass(frozen=True, eq=False)
class DrawnTrajectory:
    """The drawn path of one point.

    Attributes:
        anchor: The point of the face.
        times: Increasing seconds since the press, shape (n,).
        pixels: Positions of the point at these times in ``camera``, shape (n, 2), starting at its present position.
        camera: Camera of the view in which it was drawn.
    """

    anchor: SurfacePoint | int
    times: Array
    pixels: Array
    camera: Camera

    def seen_in(self, camera: Camera) -> Array | None:
        """Return the trajectory in pixels of ``camera``, (n, 2), or None unless both share a viewpoint."""
        shift = self.camera.transferred((0.0, 0.0), camera)
        if shift is None:
            return None
        return self.pixels * (camera.focal / self.camera.focal) + np.array(shift)

    def timed(self, rate: float) -> Array:
        """Return the positions at ``rate`` frames per second with the timing of the pen, shape (F, 2), F at least 2."""
        n_frames = max(round(float(self.times[-1]) * rate) + 1, 2)
        return _interpolate(self.times, self.pixels, np.minimum(np.arange(n_frames) / rate, self.times[-1]))

    def spread(self, n_frames: int) -> Array:
        """Return the positions in ``n_frames`` frames at constant speed, shape (F, 2)."""
        lengths = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(self.pixels, axis=0).T))])
        return _interpolate(lengths, self.pixels, np.linspace(0.0, lengths[-1], n_frames))


def _interpolate(knots: Array, pixels: Array, queries: Array) -> Array:
    return np.stack([np.interp(queries, knots, pixels[:, axis]) for axis in range(2)], axis=1)


@dataclass(frozen=True, eq=False)
class _Step:
    """A change of the drawn trajectories, with the depth of the session's history at that time."""

    depth: int
    before: tuple[DrawnTrajectory, ...]
    after: tuple[DrawnTrajectory, ...]


class TrajectoryTool(PosingTool):
    """Draws trajectories of points, which the animation features read.

    Attributes:
        drawn: Trajectories of one view, at most one for each point of the face.
        drawing: Pixels of the trajectory being drawn.
        accepted: True if the user has requested to solve for them (Enter).
    """

    name = "trajectory"
    label = "Trajectories"
    key = "J"
    help = "Draw the paths of points over time; the face follows them"
    empty_text = "Draw the paths of points. Solving turns them into keys of the timeline, not into constraints."
    cursor = "draw"

    def __init__(self, tool_settings: ToolSettings) -> None:
        """Use the shared ``tool_settings``."""
        super().__init__(tool_settings)
        self.drawn: tuple[DrawnTrajectory, ...] = ()
        self.drawing: list[Pixel] = []
        self.accepted = False
        # Changes that can be undone, and changes that were undone.
        self._steps: list[_Step] = []
        self._undone: list[_Step] = []
        self._depth = 0

    def candidates(self, context: ToolContext) -> dict[str, Pixel]:
        """Return the pixels of the visible feature points in the view, by name."""
        session = context.session
        features = session.model.character.feature_points
        if not features:
            return {}
        points = SurfacePoints.at_vertices(list(features.values()))
        pixels = context.camera.project(session.model.positions_at(points, session.coefficients)).tolist()
        hidden = context.hidden(points).tolist()
        return {name: (u, v) for name, (u, v), is_hidden in zip(features, pixels, hidden, strict=True) if not is_hidden}

    def fits(self, context: ToolContext) -> bool:
        """Return True if a trajectory can be drawn in this view: all must share its viewpoint."""
        return not self.drawn or self.drawn[0].seen_in(context.camera) is not None

    def _anchor_at(self, position: Pixel, context: ToolContext) -> SurfacePoint | int | None:
        """Return the point of the face that a press at ``position`` selects, or None."""
        best, found = _SNAP * context.ui_scale, None
        for name, pixel in self.candidates(context).items():
            distance = float(np.hypot(pixel[0] - position[0], pixel[1] - position[1]))
            if distance < best:
                best, found = distance, name
        if found is not None:
            return int(context.session.model.character.feature_points[found])
        return context.pick(position)

    def begins(self, event: PointerEvent, context: ToolContext) -> bool:
        """Return True if the press ``event`` starts a trajectory."""
        if event.button != "left" or event.modifiers or not self.fits(context):
            return False
        return self._anchor_at(event.position, context) is not None

    def gesture(self, event: PointerEvent, context: ToolContext) -> Gesture:
        """Draw the trajectory of a point, replacing an older one of the same point."""
        # on press
        anchor = self._anchor_at(event.position, context)
        if anchor is None:
            return
        session, camera = context.session, context.camera
        begin = camera.project(session.model.positions_at(SurfacePoints.of([anchor]), session.coefficients))[0]
        offset = begin - event.position
        times, path = [event.time], [event.position]
        try:
            while event.kind != "release":
                self.drawing = [(u + offset[0], v + offset[1]) for u, v in path]
                event = yield
                # on move, and on release
                if context.camera.transferred(event.position, camera) is None:
                    # The view was zoomed meanwhile: the position is not one of the view in which the path began.
                    continue
                if event.time > times[-1]:
                    times.append(event.time)
                    path.append(event.position)
                elif len(path) > 1:
                    path[-1] = event.position
        finally:
            self.drawing = []
        pixels = np.array(path) + offset
        if float(np.hypot(*np.diff(pixels, axis=0).T).sum()) < _SHORTEST * context.ui_scale:
            return
        drawn = DrawnTrajectory(anchor, np.array(times) - times[0], pixels, camera)
        image = self._mirrored(drawn, context) if self._settings.symmetry.on else None
        new = (drawn,) if image is None else (drawn, image)
        anchors = {trajectory.anchor for trajectory in new}
        self.follow_history(session.depth)
        self._change((*(other for other in self.drawn if other.anchor not in anchors), *new))

    def _mirrored(self, drawn: DrawnTrajectory, context: ToolContext) -> DrawnTrajectory | None:
        """Return the trajectory of the mirror point, or None for a point in the middle.

        The path in the image is lifted to space at the depth of its point.
        """
        model, pose, camera = context.session.model, context.session.coefficients, drawn.camera
        own = SurfacePoints.of([drawn.anchor])
        image = surface_mirror(model).points(own)
        if image is None:
            return None
        rest = own.joined(image).positions(model.character.vertices, model.triangles)
        if np.linalg.norm(rest[1] - rest[0]) < _MIDDLE * model.character.height:
            return None
        place, image_place = model.positions_at(own.joined(image), pose)
        scale = camera.to_camera(place[None])[0, 2] / camera.focal
        moves = np.zeros((len(drawn.pixels), 3))
        moves[:, :2] = (drawn.pixels - drawn.pixels[0]) * scale
        moves = moves @ camera.rotation * (-1.0, 1.0, 1.0)
        return DrawnTrajectory(image[0], drawn.times, camera.project(image_place + moves), camera)

    def _change(self, drawn: tuple[DrawnTrajectory, ...]) -> None:
        self._steps.append(_Step(self._depth, self.drawn, drawn))
        self._undone = []
        self.drawn = drawn

    def at(self, position: Pixel, context: ToolContext) -> int | None:
        """Return the index of the trajectory that passes within reach of ``position``, or None."""
        best, found = _REACH * context.ui_scale, None
        for i, drawn in enumerate(self.drawn):
            seen = drawn.seen_in(context.camera)
            if seen is None:
                continue
            distance = float(np.hypot(*(seen - position).T).min())
            if distance <= best:
                best, found = distance, i
        return found

    def remove_at(self, position: Pixel, context: ToolContext) -> bool:
        """Remove the trajectory at ``position``; return True if there was one."""
        index = self.at(position, context)
        if index is None:
            return False
        self.follow_history(context.session.depth)
        self._change((*self.drawn[:index], *self.drawn[index + 1 :]))
        return True

    def clear(self) -> None:
        """Remove all trajectories, which undo restores."""
        if self.drawn:
            self._change(())

    @property
    def can_accept(self) -> bool:
        """True if trajectories are drawn."""
        return bool(self.drawn)

    def accept(self, context: ToolContext) -> bool:
        """Request to solve for the trajectories; return True if there are any."""
        self.accepted = bool(self.drawn)
        return self.accepted

    def follow_history(self, depth: int) -> None:
        """Undo changes made after a step of the session that is now undone, and redo those made before one.

        Args:
            depth: Depth of the session's history.
        """
        self._depth = depth
        while self._steps and self._steps[-1].depth > depth:
            self._undo_step()
        while self._undone and self._undone[-1].depth < depth:
            self._redo_step()

    @property
    def can_step_back(self) -> bool:
        """True if the last step, of the session and of the tool, is one of the tool."""
        return bool(self._steps) and self._steps[-1].depth == self._depth

    @property
    def can_step_forward(self) -> bool:
        """True if the next step to redo, of the session and of the tool, is one of the tool."""
        return bool(self._undone) and self._undone[-1].depth == self._depth

    def step_back(self) -> bool:
        """Undo the last change of the trajectories unless the session has changed since; return True if undone."""
        if not self.can_step_back:
            return False
        self._undo_step()
        return True

    def step_forward(self) -> bool:
        """Redo the last undone change if it is next; return True if redone."""
        if not self.can_step_forward:
            return False
        self._redo_step()
        return True

    def _undo_step(self) -> None:
        step = self._steps.pop()
        self._undone.append(step)
        self.drawn = step.before

    def _redo_step(self) -> None:
        step = self._undone.pop()
        self._steps.append(step)
        self.drawn = step.after

    def hint(self, context: ToolContext) -> str:
        """Return the effect of a press, for the status bar."""
        if not self.fits(context):
            return "The trajectories belong to another view: solve or clear them to draw new ones"
        if not self.drawn:
            return "Drag a point of the face along its path: the animation takes as long as the drag"
        return "Drag another point along its path   ·   Enter: solve   ·   right click: remove a trajectory"
