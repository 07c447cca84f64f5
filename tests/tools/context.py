"""A window's stand-in for tools: a view, a size and picking by brute force."""

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
        vertices = model.subject.vertices
        self.view = OrbitView.preset(vertices.min(axis=0), vertices.max(axis=0))
        self.size = (800, 800)
        self.ui_scale = 1.0
        self.navigation: Navigation = "blender"
        self.toolbox = Toolbox(self)

    @property
    def camera(self) -> Camera:
        return self.view.camera(self.size)

    def pick(self, pixel: Pixel) -> SurfacePoint | None:
        session = self.session
        vertices = session.model.instance(session.coefficients)
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

    def feature(self, name: str) -> Pixel:
        """Return where the view shows a feature point of the current face."""
        session = self.session
        point = SurfacePoint.at_vertex(session.model.triangles, session.model.subject.feature_points[name])
        vertices = session.model.instance(session.coefficients)
        u, v = self.camera.project(surface_positions(vertices, session.model.triangles, [point]))[0].tolist()
        return (u, v)
