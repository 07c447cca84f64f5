"""The view of the face, as a rectangle of the window and as the context of tools."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from faceposer.geometry.camera import Camera, OrbitView
from faceposer.geometry.picking import SurfacePoint, SurfacePoints
from faceposer.geometry.picture_view import PictureView, View
from faceposer.model.framing import face_view
from faceposer.render.scene import Scene
from faceposer.session.session import Session
from faceposer.solve.constraints.registry import Constraint
from faceposer.tools.tool import Navigation

Pixel = tuple[float, float]


class Viewport:
    """The rectangle of the window that shows the face; implements ``ToolContext``.

    Positions are in window units from the top left of the rectangle. On some systems a unit is several pixels; images
    are drawn in pixels.

    Attributes:
        origin: Top left corner in the window.
        size: Width and height, at least 1.
        ui_scale: Window units per unit of the interface, which is a pixel at normal density and zoom 1.
        hidden_among: Returns the indices of constraints whose marks the user has hidden.
        on_notice: Shows a text of a tool to the user.
    """

    def __init__(self, scene: Scene, session: Session, navigation: Navigation) -> None:
        """View ``session`` from the front."""
        self.session = session
        self.navigation: Navigation = navigation
        self.origin: Pixel = (0.0, 0.0)
        self.size = (1, 1)
        self.ui_scale = 1.0
        self.hidden_among: Callable[[tuple[Constraint, ...]], frozenset[int]] = lambda _: frozenset()
        self.on_notice: Callable[[str], None] = lambda _: None
        self._scene = scene
        self._camera: tuple[object, Camera] | None = None
        self.view: View = self.framed()

    @property
    def camera(self) -> Camera:
        """The camera of the view, in window units."""
        key = (self.view, self.size)
        if self._camera is None or self._camera[0] != key:
            self._camera = (key, self.view.camera(self.size))
        return self._camera[1]

    @property
    def unmarked(self) -> frozenset[int]:
        """Constraints whose marks the user has hidden; their handles cannot be grabbed."""
        return self.hidden_among(self.session.document.constraints)

    def place(self, origin: Pixel, size: tuple[int, int], ui_scale: float) -> None:
        """Set the rectangle to ``origin`` and ``size``, at least 1 by 1."""
        self.origin, self.ui_scale = origin, ui_scale
        self.size = (max(size[0], 1), max(size[1], 1))

    def local(self, position: Pixel) -> Pixel:
        """Convert a position from the window to the view."""
        return (position[0] - self.origin[0], position[1] - self.origin[1])

    def contains(self, position: Pixel) -> bool:
        """Return True if a position in the window is inside the view."""
        x, y = self.local(position)
        return 0.0 <= x < self.size[0] and 0.0 <= y < self.size[1]

    def pick(self, pixel: Pixel) -> SurfacePoint | None:
        """Return the point of the visible face under ``pixel`` of the view, or None."""
        return self._scene.pick(self.camera, pixel)

    def pick_many(self, pixels: ArrayLike) -> tuple[SurfacePoints, NDArray[np.bool_]]:
        """Return the points of the visible face under ``pixels`` of the view, (n, 2), and a mask of the hits, (n,)."""
        return self._scene.pick_many(self.camera, np.asarray(pixels, dtype=np.float64).reshape(-1, 2))

    def hidden(self, points: SurfacePoints) -> NDArray[np.bool_]:
        """Return a mask of the ``points`` hidden by the face itself, shape (n,)."""
        positions = points.positions(self._scene.vertices, self._scene.triangles)
        away = self._scene.facing_away(self.camera, points)
        return away | self._scene.occluded(self.camera, positions)

    def notify(self, text: str) -> None:
        """Show ``text`` to the user for a few seconds."""
        self.on_notice(text)

    # Views

    def framed(self, name: str = "front") -> OrbitView:
        """Return the view ``name`` in which the face fills the rectangle, whatever its aspect ratio."""
        width, height = self.size
        return face_view(self._scene.character, name, width / height if min(width, height) > 1 else 1.0)

    def look(self, name: str) -> None:
        """Turn to the direction ``name`` around the current target, leaving the view of a photo."""
        if isinstance(self.view, PictureView):
            self.view = self.framed(name)
        else:
            self.view = self.view.looking(name)

    def frame_face(self) -> None:
        """Fill the view with the face, from the present direction."""
        framed = self.framed()
        if isinstance(self.view, PictureView):
            self.view = self._framed_in_picture(self.view)
            return
        self.view = OrbitView(framed.target, self.view.yaw, self.view.pitch, framed.distance, framed.fov_y)

    def _framed_in_picture(self, view: PictureView) -> PictureView:
        pixels = view.photo.project(self._scene.vertices)
        lower, upper = pixels.min(axis=0), pixels.max(axis=0)
        margin = 0.06 * (upper - lower)
        return view.showing(lower - margin, upper + margin, self.size)

    def look_through(self, camera: Camera) -> None:
        """Set the view to ``camera``, as stored in a session file.

        A camera with roll, or with a principal point off the centre, belongs to a photo or a part of one.
        """
        target = self.framed().target
        if camera.shift == (0.0, 0.0) and abs(camera.rotation[0, 1]) < 1e-6:
            self.view = OrbitView.from_camera(camera, target)
        else:
            self.view = replace(PictureView.whole(camera, target), locked=False)
