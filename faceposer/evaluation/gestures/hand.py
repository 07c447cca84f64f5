"""Execution of gestures without a window, through the program's own tools, session and solver."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from faceposer.errors import FacePoserError
from faceposer.evaluation.gestures.gesture import HEAD_HEIGHT, Gesture, Paint, Pull
from faceposer.geometry.camera import Camera, OrbitView, ViewName
from faceposer.geometry.picking import SurfacePoint, SurfacePoints
from faceposer.geometry.picture_view import View
from faceposer.model.character import Character
from faceposer.model.face_model import FaceModel
from faceposer.session.document import Document
from faceposer.session.session import Session
from faceposer.solve.constraints.point import PointConstraint
from faceposer.solve.priors import Prior
from faceposer.solve.problem import SPREAD
from faceposer.tools.tool import Navigation, PointerEvent
from faceposer.tools.toolbox import Toolbox

Array = NDArray[np.float64]
Pixel = tuple[float, float]
#: Width and height of the view in pixels.
SIZE = (960, 960)
# Number of move events of a drag, each of which is solved.
_MOVES = 8
# Distance in centimetres by which a surface in front of a point must be closer to the camera to hide it.
_DEPTH_TOLERANCE = 0.4


@dataclass(frozen=True)
class PriorSettings:
    """Settings of the prior.

    Attributes:
        prior: Evaluation of the prior.
        weight: Weight of the prior.
        spread: Extent of the face that follows a pull, from 0 to 1.
    """

    prior: Prior = "regions"
    weight: float = 1.0
    spread: float = SPREAD

    def under(self, prior: Prior) -> "PriorSettings":
        """Return the same settings with another ``prior``."""
        return replace(self, prior=prior)

    def document(self, character: Character) -> Document:
        """Return the document of the neutral face of ``character`` with these settings."""
        return Document(character.name, prior=self.prior, prior_weight=self.weight, spread=self.spread)


@dataclass(frozen=True, eq=False)
class Drawn:
    """Source and target drawn for one constraint, in pixels of its camera.

    Attributes:
        camera: Camera of the constraint.
        source: Neutral position of the place, or positions along a stroke when it was begun, shape (n, 2).
        target: Target positions, shape (n, 2).
        pulled_px: Distance between source and target, for a stroke its initial residual.
        vertex: The vertex that was pulled; None for strokes and for mirror images.
    """

    camera: Camera
    source: Array
    target: Array
    pulled_px: float
    vertex: int | None = None


@dataclass(frozen=True, eq=False)
class Performed:
    """Result of a gesture.

    Attributes:
        gesture: The gesture.
        model: The face.
        pose: The resulting coefficients, shape (r,).
        drawn: Source and target of each constraint.
        residuals_px: Residual of each constraint, in pixels.
        solve_ms: Time of each solve, in ms.
        prior: The prior of the session.
    """

    gesture: Gesture
    model: FaceModel
    pose: Array
    drawn: tuple[Drawn, ...]
    residuals_px: tuple[float, ...]
    solve_ms: tuple[float, ...]
    prior: Prior

    @cached_property
    def vertices(self) -> NDArray[np.float32]:
        """The posed vertices after the contact step, as they are measured and rendered, shape (N, 3)."""
        return self.model.surface(self.pose)


class Hand:
    """Performer of gestures on one face, and the ``ToolContext`` of its tools.

    Attributes:
        session: The session that is edited.
        view: The current view.
    """

    ui_scale = 1.0
    navigation: Navigation = "blender"
    unmarked: frozenset[int] = frozenset()

    def __init__(self, model: FaceModel, settings: PriorSettings | None = None) -> None:
        """Start at the neutral face of ``model``."""
        self.session = Session(model, (settings or PriorSettings()).document(model.character))
        self.size = SIZE
        self.view: View = self._view_from("front")
        self._toolbox = Toolbox(self)
        self._picked_vertex: int | None = None
        self._solve_ms: list[float] = []

    # Interface of tools
    @property
    def camera(self) -> Camera:
        """The camera of the view."""
        return self.view.camera(self.size)

    def pick(self, pixel: Pixel) -> SurfacePoint | None:
        """Return the vertex that is being dragged, so that presses are exact, or the surface point at ``pixel``."""
        if self._picked_vertex is None:
            points, hit = self.pick_many([pixel])
            point = points[0] if hit[0] else None
            return point if isinstance(point, SurfacePoint) else None
        return SurfacePoint.at_vertex(self.session.model.triangles, self._picked_vertex)

    def pick_many(self, pixels: ArrayLike) -> tuple[SurfacePoints, NDArray[np.bool_]]:
        """Return the visible surface points at ``pixels``, shape (n, 2), and the mask of pixels on the face, (n,)."""
        return self.session.model.pick(self.session.coefficients, self.camera, pixels)

    def hidden(self, points: SurfacePoints) -> NDArray[np.bool_]:
        """Return the mask of ``points`` that the face itself hides, shape (n,)."""
        model, pose = self.session.model, self.session.coefficients
        positions = model.positions_at(points, pose)
        visible, hit = self.pick_many(self.camera.project(positions))
        hidden = np.zeros(len(points), dtype=bool)
        depths = self.camera.to_camera(model.positions_at(visible, pose))[:, 2]
        hidden[hit] = depths < self.camera.to_camera(positions)[hit, 2] - _DEPTH_TOLERANCE
        return hidden

    def notify(self, text: str) -> None:
        """Discard ``text``, which is for users."""

    # Gestures
    def perform(self, gesture: Gesture) -> Performed:
        """Perform ``gesture`` and return the result.

        Raises:
            FacePoserError: If the face lacks a place, or a place cannot be pulled or painted.
        """
        drawn: list[Drawn] = []
        for action in gesture.actions:
            self.view = self._view_from(action.view)
            drawn += self._pull(action) if isinstance(action, Pull) else self._paint(action)
        session = self.session
        return Performed(
            gesture,
            session.model,
            session.coefficients,
            tuple(drawn),
            session.residuals_px,
            tuple(self._solve_ms),
            session.document.prior,
        )

    def _pull(self, pull: Pull) -> list[Drawn]:
        model, camera, pose = self.session.model, self.camera, self.session.coefficients
        vertex = place_vertex(model.character, pull.place)
        points = SurfacePoints.at_vertices([vertex])
        if pull.onto is None:
            origin = model.positions_at(points, model.neutral())
        else:
            origin = model.positions_at(SurfacePoints.at_vertices([place_vertex(model.character, pull.onto)]), pose)
        right, down, _ = camera.rotation
        goal = origin + self._millimetre * (pull.right * right - pull.up * down)
        begin, end = camera.project(np.concatenate([model.positions_at(points, pose), goal]))
        count = len(self.session.document.constraints)
        self._toolbox.choose("point")
        self._toolbox.tool_settings.symmetry.on = pull.both
        self._picked_vertex = vertex
        try:
            self._drag(np.linspace(begin, end, _MOVES + 1))
        finally:
            self._picked_vertex = None
            self._toolbox.tool_settings.symmetry.on = False
        drawn: list[Drawn] = []
        for constraint in self.session.document.constraints[count:]:
            assert isinstance(constraint, PointConstraint)
            source = constraint.camera.project(model.positions_at(constraint.points, model.neutral()))
            target = np.array([constraint.target])
            pulled = float(np.hypot(*(target - source)[0]))
            drawn.append(Drawn(constraint.camera, source, target, pulled, None if drawn else vertex))
        if len(drawn) != 1 + pull.both:
            side = " and its mirror image" if pull.both else ""
            raise FacePoserError(f"'{model.character.title}' cannot be pulled at '{pull.place}'{side}.")
        return drawn

    def _paint(self, paint: Paint) -> list[Drawn]:
        model, camera, pose = self.session.model, self.camera, self.session.coefficients
        ids = [place_vertex(model.character, place) for place in paint.along]
        positions = model.positions_at(SurfacePoints.at_vertices(ids), pose)
        source = camera.project(positions)
        target = camera.project(positions - self._millimetre * paint.up * camera.rotation[1])
        target += (paint.narrower - 1.0) * (target - target.mean(axis=0)) * [1.0, 0.0]
        count = len(self.session.document.constraints)
        self._toolbox.choose("stroke")
        self._drag(source)
        self._drag(target)
        added = self.session.document.constraints[count:]
        if len(added) != 1:
            raise FacePoserError(f"'{model.character.title}' cannot be painted along {', '.join(paint.along)}.")
        return [Drawn(camera, source, target, added[0].residual_px(model, pose))]

    @property
    def _millimetre(self) -> float:
        return 0.1 * self.session.model.character.height / HEAD_HEIGHT

    def _drag(self, path: Array) -> None:
        """Press at the first pixel of ``path``, shape (n, 2), move along the others, and release at the last."""
        pixels = [(u, v) for u, v in path.tolist()]
        self._send("press", pixels[0])
        for pixel in pixels[1:]:
            self._send("move", pixel)
        self._send("release", pixels[-1])

    def _send(self, kind: str, pixel: Pixel) -> None:
        self._toolbox.dispatch(PointerEvent(kind, pixel, "left"))  # type: ignore[arg-type]
        if self.session.poll() and self.session.solution is not None:
            self._solve_ms.append(1e3 * self.session.solution.seconds)

    def _view_from(self, view: ViewName) -> OrbitView:
        vertices = self.session.model.character.vertices
        return OrbitView.preset(vertices.min(axis=0), vertices.max(axis=0), view)


def place_vertex(character: Character, place: str) -> int:
    """Return the vertex of a feature point, or that at the centre of the front of a region.

    Raises:
        FacePoserError: If the character has neither.
    """
    if place in character.feature_points:
        return character.feature_points[place]
    if place not in character.regions:
        raise FacePoserError(f"'{character.title}' has neither a feature point nor a region '{place}'.")
    ids = character.regions[place]
    positions = character.vertices[ids].astype(np.float64)
    middle = 0.5 * (positions.min(axis=0) + positions.max(axis=0))
    middle[2] = positions[:, 2].max()
    return int(ids[np.argmin(np.linalg.norm((positions - middle) * [1.0, 1.0, 0.5], axis=1))])


def has_places(character: Character, gesture: Gesture) -> bool:
    """Return True if ``character`` has all places of ``gesture``."""
    places = {place for action in gesture.actions for place in action.places}
    return all(place in character.feature_points or place in character.regions for place in places)
