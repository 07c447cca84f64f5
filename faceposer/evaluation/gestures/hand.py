"""An artist's hand without a window: gestures through the program's own tools, session and solver."""

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
# Events of a drag between press and release: so many frames is the face solved for on its way.
_MOVES = 8
# Nearer to the camera by this much, in centimetres, hides what lies behind.
_HIDDEN_BY = 0.4


@dataclass(frozen=True)
class PriorSettings:
    """What a user can set of the prior.

    Attributes:
        prior: How the face is judged.
        weight: Weight of the prior.
        spread: How much of the face follows a pull, from 0 to 1.
    """

    prior: Prior = "regions"
    weight: float = 1.0
    spread: float = SPREAD

    def under(self, prior: Prior) -> "PriorSettings":
        """Return the same settings under another ``prior``."""
        return replace(self, prior=prior)

    def document(self, character: Character) -> Document:
        """Return the document of the untouched face of ``character`` with these settings."""
        return Document(character.name, prior=self.prior, prior_weight=self.weight, spread=self.spread)


@dataclass(frozen=True, eq=False)
class Drawn:
    """What was drawn for one constraint, in pixels of its camera.

    Attributes:
        camera: Under which it was drawn.
        source: Where the place lies at rest, or the places along a stroke when it was begun, shape (n, 2).
        target: Where they should come to lie, shape (n, 2).
        pulled_px: How far that is, of a stroke how far the two lay apart.
        vertex: The place that the hand pulled; None for strokes and for mirror images.
    """

    camera: Camera
    source: Array
    target: Array
    pulled_px: float
    vertex: int | None = None


@dataclass(frozen=True, eq=False)
class Performed:
    """A gesture that was made.

    Attributes:
        gesture: Which.
        model: The face.
        pose: The coefficients it left, shape (r,).
        drawn: What was drawn, by constraint.
        residuals_px: How far each constraint is from being met, in pixels.
        solve_ms: Time of each solve on the way, in ms.
        prior: By which the face was judged.
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
        """The posed vertices that are measured and drawn, after the contact step, shape (N, 3)."""
        return self.model.surface(self.pose)


class Hand:
    """Makes gestures on one face; what tools need of a window (``ToolContext``) it gives itself.

    Attributes:
        session: The document under the hand.
        view: From where the hand's owner looks.
    """

    ui_scale = 1.0
    navigation: Navigation = "blender"

    def __init__(self, model: FaceModel, settings: PriorSettings | None = None) -> None:
        """Begin at the neutral face of ``model``."""
        self.session = Session(model, (settings or PriorSettings()).document(model.character))
        self.size = SIZE
        self.view: View = self._looking("front")
        self._toolbox = Toolbox(self)
        self._held: int | None = None
        self._solve_ms: list[float] = []

    # What tools ask

    @property
    def camera(self) -> Camera:
        """The camera of the view."""
        return self.view.camera(self.size)

    def pick(self, pixel: Pixel) -> SurfacePoint | None:
        """Return the place that the hand has taken aim at: a press is never off by the width of an eyelid's edge."""
        if self._held is None:
            points, met = self.pick_many([pixel])
            found = points[0] if met[0] else None
            return found if isinstance(found, SurfacePoint) else None
        return SurfacePoint.at_vertex(self.session.model.triangles, self._held)

    def pick_many(self, pixels: ArrayLike) -> tuple[SurfacePoints, NDArray[np.bool_]]:
        """Return the points of the visible face under ``pixels``, shape (n, 2), and which of them meet it, (n,)."""
        return self.session.model.pick(self.session.coefficients, self.camera, pixels)

    def hidden(self, points: SurfacePoints) -> NDArray[np.bool_]:
        """Return which of ``points`` the face itself hides, shape (n,)."""
        model, pose = self.session.model, self.session.coefficients
        positions = model.positions_at(points, pose)
        found, met = self.pick_many(self.camera.project(positions))
        hidden = np.zeros(len(points), dtype=bool)
        before = self.camera.to_camera(model.positions_at(found, pose))[:, 2]
        hidden[met] = before < self.camera.to_camera(positions)[met, 2] - _HIDDEN_BY
        return hidden

    # What the hand does

    def perform(self, gesture: Gesture) -> Performed:
        """Make ``gesture`` and return what came of it.

        Raises:
            FacePoserError: If the face lacks a place, or something else was taken hold of.
        """
        drawn: list[Drawn] = []
        for action in gesture.actions:
            self.view = self._looking(action.view)
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
            aim = model.positions_at(points, model.neutral())
        else:
            aim = model.positions_at(SurfacePoints.at_vertices([place_vertex(model.character, pull.onto)]), pose)
        right, down, _ = camera.rotation
        goal = aim + self._millimetre * (pull.right * right - pull.up * down)
        begin, end = camera.project(np.concatenate([model.positions_at(points, pose), goal]))
        before = len(self.session.document.constraints)
        self._toolbox.choose("point")
        self._toolbox.tool_settings.symmetry.on = pull.both
        self._held = vertex
        try:
            self._drag(np.linspace(begin, end, _MOVES + 1))
        finally:
            self._held = None
            self._toolbox.tool_settings.symmetry.on = False
        drawn: list[Drawn] = []
        for constraint in self.session.document.constraints[before:]:
            assert isinstance(constraint, PointConstraint)
            source = constraint.camera.project(model.positions_at(constraint.points, model.neutral()))
            target = np.array([constraint.target])
            pulled = float(np.hypot(*(target - source)[0]))
            drawn.append(Drawn(constraint.camera, source, target, pulled, None if drawn else vertex))
        if len(drawn) != 1 + pull.both:
            side = " and its mirror image" if pull.both else ""
            raise FacePoserError(f"'{model.character.title}' could not be taken hold of at '{pull.place}'{side}.")
        return drawn

    def _paint(self, paint: Paint) -> list[Drawn]:
        model, camera, pose = self.session.model, self.camera, self.session.coefficients
        ids = [place_vertex(model.character, place) for place in paint.along]
        positions = model.positions_at(SurfacePoints.at_vertices(ids), pose)
        source = camera.project(positions)
        target = camera.project(positions - self._millimetre * paint.up * camera.rotation[1])
        target += (paint.narrower - 1.0) * (target - target.mean(axis=0)) * [1.0, 0.0]
        before = len(self.session.document.constraints)
        self._toolbox.choose("stroke")
        self._drag(source)
        self._drag(target)
        made = self.session.document.constraints[before:]
        if len(made) != 1:
            raise FacePoserError(f"'{model.character.title}' could not be painted on along {', '.join(paint.along)}.")
        return [Drawn(camera, source, target, made[0].residual_px(model, pose))]

    @property
    def _millimetre(self) -> float:
        return 0.1 * self.session.model.character.height / HEAD_HEIGHT

    def _drag(self, way: Array) -> None:
        """Press at the first pixel of ``way``, shape (n, 2), move along the others, and release at the last."""
        pixels = [(u, v) for u, v in way.tolist()]
        self._send("press", pixels[0])
        for pixel in pixels[1:]:
            self._send("move", pixel)
        self._send("release", pixels[-1])

    def _send(self, kind: str, pixel: Pixel) -> None:
        self._toolbox.dispatch(PointerEvent(kind, pixel, "left"))  # type: ignore[arg-type]
        if self.session.poll() and self.session.solution is not None:
            self._solve_ms.append(1e3 * self.session.solution.seconds)

    def _looking(self, view: ViewName) -> OrbitView:
        vertices = self.session.model.character.vertices
        return OrbitView.preset(vertices.min(axis=0), vertices.max(axis=0), view)


def place_vertex(character: Character, place: str) -> int:
    """Return the vertex of a feature point, or the one at the front of a region, in its middle.

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
    """Whether ``character`` has all that ``gesture`` takes hold of."""
    places = {place for action in gesture.actions for place in action.places}
    return all(place in character.feature_points or place in character.regions for place in places)
