"""A window's stand-in for tools: a view, a size and picking by brute force."""

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from faceposer.geometry.camera import Camera, OrbitView
from faceposer.geometry.picking import SurfacePoint, SurfacePoints, pick, surface_positions
from faceposer.model.face_model import FaceModel
from faceposer.session.document import Document
from faceposer.session.session import Session
from faceposer.tools.tool import Navigation, PointerEvent
from faceposer.tools.toolbox import Toolbox

Pixel = tuple[float, float]


class HeadlessContext:
    """What the window gives to tools, without a window."""

    def __init__(self, model: FaceModel, document: Document | None = None) -> None:
        self.session = Session(model, document or Document("man"))
        vertices = model.character.vertices
        self.view = OrbitView.preset(vertices.min(axis=0), vertices.max(axis=0))
        self.size = (800, 800)
        self.ui_scale = 1.0
        self.navigation: Navigation = "blender"
        self.unmarked: frozenset[int] = frozenset()
        self.notices: list[str] = []
        self.toolbox = Toolbox(self)

    @property
    def camera(self) -> Camera:
        return self.view.camera(self.size)

    def pick(self, pixel: Pixel) -> SurfacePoint | None:
        session = self.session
        vertices = session.vertices
        return pick(vertices, session.model.triangles, self.camera, pixel)

    def pick_many(self, pixels: ArrayLike) -> tuple[SurfacePoints, NDArray[np.bool_]]:
        return self.session.model.pick(self.session.coefficients, self.camera, pixels)

    def hidden(self, points: SurfacePoints) -> NDArray[np.bool_]:
        model, pose = self.session.model, self.session.coefficients
        positions = model.positions_at(points, pose)
        found, met = self.pick_many(self.camera.project(positions))
        depths = self.camera.to_camera(positions)[:, 2]
        hidden = np.zeros(len(points), dtype=bool)
        hidden[met] = self.camera.to_camera(model.positions_at(found, pose))[:, 2] < depths[met] - 0.4
        return hidden

    def notify(self, text: str) -> None:
        self.notices.append(text)

    def send(
        self, kind: str, position: Pixel, button: str | None = "left", *modifiers: str, wheel: float = 0.0
    ) -> None:
        """Send one event and take what was solved, as a frame does."""
        event = PointerEvent(kind, position, button, frozenset(modifiers), wheel=wheel)  # type: ignore[arg-type]
        self.toolbox.dispatch(event)
        self.session.poll()

    def drag(self, begin: Pixel, end: Pixel, button: str = "left", *modifiers: str, steps: int = 8) -> None:
        self.send("press", begin, button, *modifiers)
        for step in range(1, steps + 1):
            share = step / steps
            between = (begin[0] + share * (end[0] - begin[0]), begin[1] + share * (end[1] - begin[1]))
            self.send("move", between, button, *modifiers)
        self.send("release", end, button, *modifiers)

    def click(self, position: Pixel, button: str = "left", *modifiers: str) -> None:
        self.send("press", position, button, *modifiers)
        self.send("release", position, button, *modifiers)

    def follow(self, way: list[Pixel], *modifiers: str) -> None:
        """Press at the first pixel of ``way``, move along it and release at its end."""
        for event in along(way, *modifiers):
            self.send(*event)

    def undo(self) -> None:
        """Undo as the window does: first what the tool has begun."""
        self.toolbox.undo()
        self.session.poll()

    def redo(self) -> None:
        """Redo as the window does."""
        if not self.toolbox.step_forward():
            self.session.redo()
        self.session.poll()

    @property
    def constraints(self) -> tuple[Any, ...]:
        """The constraints of the session."""
        return self.session.document.constraints

    @property
    def vertices(self) -> NDArray[np.float64]:
        """The vertices of the current face."""
        return self.session.model.instance(self.session.coefficients)

    def change(self, index: int, **values: Any) -> None:
        """Set attributes of a constraint, as the panel does."""
        constraint: Any = self.constraints[index]
        self.session.change_constraint(index, replace(constraint, **values), "Change")
        self.session.poll()

    def feature(self, name: str) -> Pixel:
        """Return where the view shows a feature point of the current face."""
        session = self.session
        point = SurfacePoint.at_vertex(session.model.triangles, session.model.character.feature_points[name])
        vertices = session.vertices
        u, v = self.camera.project(surface_positions(vertices, session.model.triangles, [point]))[0].tolist()
        return (u, v)


def shifted(pixel: Pixel, dx: float, dy: float) -> Pixel:
    """Return ``pixel`` moved by (dx, dy)."""
    return (pixel[0] + dx, pixel[1] + dy)


def straight(begin: Pixel, end: Pixel, count: int = 8) -> list[Pixel]:
    """Return ``count`` pixels from ``begin`` to ``end``."""
    return [(u, v) for u, v in np.linspace(begin, end, count).tolist()]


def along(way: list[Pixel], *modifiers: str) -> list[tuple[Any, ...]]:
    """Return the events of a press at the begin of ``way``, moves along it and the release."""
    moves = [("move", position, "left", *modifiers) for position in way[1:]]
    return [("press", way[0], "left", *modifiers), *moves, ("release", way[-1], "left", *modifiers)]


def check_stages(context: HeadlessContext, events: list[tuple[Any, ...]]) -> None:
    """Check undo, redo and Esc at each stage of the gesture ``events``, which leaves one step in the history.

    While it is under way, undo and redo wait and Esc takes everything back; after the release, undo takes everything
    back and redo brings it all again. The gesture is left done.
    """
    session, toolbox = context.session, context.toolbox
    before, pose, revisable = session.document, session.coefficients.copy(), session.can_undo
    for count in range(1, len(events)):
        for event in events[:count]:
            context.send(*event)
        assert toolbox.active
        during = session.document
        context.undo()
        context.redo()
        assert session.document is during, "undo and redo wait for the gesture to end"
        assert toolbox.cancel()
        assert not toolbox.active
        assert not session.editing
        assert session.document.same_input(before), f"Esc after {count} events"
        assert session.can_undo == revisable
        session.poll()
        np.testing.assert_array_equal(session.coefficients, pose)
        context.send(*events[-1])
        assert session.document.same_input(before), "a release after Esc means nothing"
    for event in events:
        context.send(*event)
    assert not toolbox.active
    after, posed = session.document, session.coefficients.copy()
    assert not after.same_input(before), "the gesture does something"
    context.undo()
    assert session.document.same_input(before)
    np.testing.assert_array_equal(session.coefficients, pose)
    context.redo()
    assert session.document.same_input(after)
    np.testing.assert_array_equal(session.coefficients, posed)
