"""Trajectories: the ways of points across the picture, drawn while time passes (Lau et al. 2009, section 7)."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from faceposer.geometry.camera import Camera
from faceposer.geometry.picking import SurfacePoint, SurfacePoints
from faceposer.tools.symmetry import mirror_of
from faceposer.tools.tool import Gesture, PointerEvent, PosingTool, ToolContext, ToolSettings

Array = NDArray[np.float64]
Pixel = tuple[float, float]

# Pixels at normal density: how near to a feature point a press means it, how near to a trajectory a click means that,
# and how long a trajectory is at least.
_SNAP, _REACH, _SHORTEST = 12.0, 9.0, 6.0
# Share of the head's height: a point that is nearer to its mirror image has no other side.
_MIDDLE = 0.04


@dataclass(frozen=True, eq=False)
class DrawnTrajectory:
    """The way of one point as it was drawn.

    Attributes:
        anchor: The point of the face.
        times: Seconds since the pen came down, rising, shape (n,).
        pixels: Where the point should be then, in ``camera``, shape (n, 2); it begins where the point was.
        camera: The view in which it was drawn.
    """

    anchor: SurfacePoint | int
    times: Array
    pixels: Array
    camera: Camera

    def seen_in(self, camera: Camera) -> Array | None:
        """Return the pixels of ``camera`` that show it, (n, 2), or None unless both look the same way."""
        shift = self.camera.transferred((0.0, 0.0), camera)
        if shift is None:
            return None
        return self.pixels * (camera.focal / self.camera.focal) + np.array(shift)

    def timed(self, rate: float) -> Array:
        """Return where the point is at ``rate`` frames per second as the pen went, shape (F, 2), F at least 2."""
        n_frames = max(round(float(self.times[-1]) * rate) + 1, 2)
        return _along(self.times, self.pixels, np.minimum(np.arange(n_frames) / rate, self.times[-1]))

    def spread(self, n_frames: int) -> Array:
        """Return where the point is in each of ``n_frames`` frames at an even pace, shape (F, 2)."""
        lengths = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(self.pixels, axis=0).T))])
        return _along(lengths, self.pixels, np.linspace(0.0, lengths[-1], n_frames))


def _along(places: Array, pixels: Array, asked: Array) -> Array:
    return np.stack([np.interp(asked, places, pixels[:, axis]) for axis in range(2)], axis=1)


@dataclass(frozen=True, eq=False)
class _Step:
    """A change of what is drawn, and the depth of the session's history at which it was made."""

    depth: int
    before: tuple[DrawnTrajectory, ...]
    after: tuple[DrawnTrajectory, ...]


class TrajectoryTool(PosingTool):
    """Draws trajectories of points; whoever animates takes them from here.

    Attributes:
        drawn: The trajectories, all of one view, at most one for each point of the face.
        drawing: The pixels of the one under way.
        accepted: Whether the user has asked to let the face follow them (Enter).
    """

    name = "trajectory"
    cursor = "draw"

    def __init__(self, tool_settings: ToolSettings) -> None:
        """Share ``tool_settings``."""
        super().__init__(tool_settings)
        self.drawn: tuple[DrawnTrajectory, ...] = ()
        self.drawing: list[Pixel] = []
        self.accepted = False
        # Each change with the depth of the session's history at which it was made; what undo took back, likewise.
        self._steps: list[_Step] = []
        self._undone: list[_Step] = []
        self._depth = 0

    def candidates(self, context: ToolContext) -> dict[str, Pixel]:
        """Return where the view shows the feature points that can be taken, those that the face hides aside."""
        session = context.session
        features = session.model.character.feature_points
        if not features:
            return {}
        points = SurfacePoints.at_vertices(list(features.values()))
        pixels = context.camera.project(session.model.positions_at(points, session.coefficients)).tolist()
        hidden = context.hidden(points).tolist()
        return {name: (u, v) for name, (u, v), away in zip(features, pixels, hidden, strict=True) if not away}

    def fits(self, context: ToolContext) -> bool:
        """Whether another trajectory can be drawn in this view: all must be of one."""
        return not self.drawn or self.drawn[0].seen_in(context.camera) is not None

    def _taken(self, position: Pixel, context: ToolContext) -> SurfacePoint | int | None:
        """Return the point of the face that a press at ``position`` takes, or None."""
        best, found = _SNAP * context.ui_scale, None
        for name, pixel in self.candidates(context).items():
            distance = float(np.hypot(pixel[0] - position[0], pixel[1] - position[1]))
            if distance < best:
                best, found = distance, name
        if found is not None:
            return int(context.session.model.character.feature_points[found])
        return context.pick(position)

    def begins(self, event: PointerEvent, context: ToolContext) -> bool:
        """Whether the press ``event`` begins a trajectory."""
        if event.button != "left" or event.modifiers or not self.fits(context):
            return False
        return self._taken(event.position, context) is not None

    def gesture(self, event: PointerEvent, context: ToolContext) -> Gesture:
        """Draw the trajectory of a point, in place of an older one of the same point."""
        # on press
        anchor = self._taken(event.position, context)
        if anchor is None:
            return
        session, camera = context.session, context.camera
        begin = camera.project(session.model.positions_at(SurfacePoints.of([anchor]), session.coefficients))[0]
        offset = begin - event.position
        times, way = [event.time], [event.position]
        try:
            while event.kind != "release":
                self.drawing = [(u + offset[0], v + offset[1]) for u, v in way]
                event = yield
                # on move, and on release
                if context.camera.transferred(event.position, camera) is None:
                    # The wheel has turned meanwhile: the hand is not where it was in this view.
                    continue
                if event.time > times[-1]:
                    times.append(event.time)
                    way.append(event.position)
                elif len(way) > 1:
                    way[-1] = event.position
        finally:
            self.drawing = []
        pixels = np.array(way) + offset
        if float(np.hypot(*np.diff(pixels, axis=0).T).sum()) < _SHORTEST * context.ui_scale:
            return
        drawn = DrawnTrajectory(anchor, np.array(times) - times[0], pixels, camera)
        image = self._mirrored(drawn, context) if self._settings.symmetry.on else None
        new = (drawn,) if image is None else (drawn, image)
        anchors = {one.anchor for one in new}
        self.follow_history(session.depth)
        self._change((*(other for other in self.drawn if other.anchor not in anchors), *new))

    def _mirrored(self, drawn: DrawnTrajectory, context: ToolContext) -> DrawnTrajectory | None:
        """Return the trajectory of the point across, or None for a point in the middle.

        A way in the picture is taken for one in space, at the distance at which its point is.
        """
        model, pose, camera = context.session.model, context.session.coefficients, drawn.camera
        own = SurfacePoints.of([drawn.anchor])
        across = mirror_of(model).points(own)
        if across is None:
            return None
        rest = own.joined(across).positions(model.character.vertices, model.triangles)
        if np.linalg.norm(rest[1] - rest[0]) < _MIDDLE * model.character.height:
            return None
        place, other = model.positions_at(own.joined(across), pose)
        scale = camera.to_camera(place[None])[0, 2] / camera.focal
        moves = np.zeros((len(drawn.pixels), 3))
        moves[:, :2] = (drawn.pixels - drawn.pixels[0]) * scale
        moves = moves @ camera.rotation * (-1.0, 1.0, 1.0)
        return DrawnTrajectory(across[0], drawn.times, camera.project(other + moves), camera)

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
        """Remove the trajectory at ``position``; return whether there was one."""
        index = self.at(position, context)
        if index is None:
            return False
        self.follow_history(context.session.depth)
        self._change((*self.drawn[:index], *self.drawn[index + 1 :]))
        return True

    def clear(self) -> None:
        """Remove all trajectories; undo brings them back."""
        if self.drawn:
            self._change(())

    def accept(self, context: ToolContext) -> bool:
        """Ask for the face to follow what is drawn; return whether there is anything."""
        self.accepted = bool(self.drawn)
        return self.accepted

    def follow_history(self, depth: int) -> None:
        """Take back what was drawn after a step of the session that is undone now, and redo what was drawn before one.

        Args:
            depth: Of the session's history.
        """
        self._depth = depth
        while self._steps and self._steps[-1].depth > depth:
            self._back()
        while self._undone and self._undone[-1].depth < depth:
            self._forward()

    @property
    def can_step_back(self) -> bool:
        """Whether the last step, of the session's and its own, is its own."""
        return bool(self._steps) and self._steps[-1].depth == self._depth

    @property
    def can_step_forward(self) -> bool:
        """Whether the next step to redo, of the session's and its own, is its own."""
        return bool(self._undone) and self._undone[-1].depth == self._depth

    def step_back(self) -> bool:
        """Take back the last change of what is drawn, if nothing was done since; return whether it did."""
        if not self.can_step_back:
            return False
        self._back()
        return True

    def step_forward(self) -> bool:
        """Do the change again that was taken back last, if it comes next; return whether it did."""
        if not self.can_step_forward:
            return False
        self._forward()
        return True

    def _back(self) -> None:
        step = self._steps.pop()
        self._undone.append(step)
        self.drawn = step.before

    def _forward(self) -> None:
        step = self._undone.pop()
        self._steps.append(step)
        self.drawn = step.after

    def hint(self, context: ToolContext) -> str:
        """Return what a press will do."""
        if not self.fits(context):
            return "The trajectories belong to another view: solve them, or clear them to draw new ones"
        if not self.drawn:
            return "Press on a point of the face and draw its path: the time that you take is the time of the animation"
        return "Draw the path of another point   ·   Enter: let the face follow   ·   right click: remove one"
