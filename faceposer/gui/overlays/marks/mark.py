"""What all marks of constraints have in common."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from faceposer.geometry.camera import Camera
from faceposer.geometry.picking import SurfacePoints
from faceposer.gui.overlays.painter import Painter
from faceposer.gui.viewport import Pixel, Viewport
from faceposer.render.scene import Scene
from faceposer.solve.constraints.stroke import Pixels
from faceposer.tools.stroke_tool import seen_pixels

Array = NDArray[np.float64]


@dataclass(frozen=True)
class MarkView:
    """The view in which marks appear.

    Attributes:
        viewport: The view.
        scene: The face.
        moving: Whether the face or the view moves: then what the face hides is judged only by where it faces away.
    """

    viewport: Viewport
    scene: Scene
    moving: bool

    @property
    def camera(self) -> Camera:
        """The camera of the view."""
        return self.viewport.camera

    def hidden(self, points: SurfacePoints) -> NDArray[np.bool_]:
        """Return which of ``points`` the face hides, shape (n,)."""
        if self.moving:
            return self.scene.facing_away(self.camera, points)
        return self.viewport.hidden(points)

    def places(self, points: SurfacePoints) -> Array:
        """Return where ``points`` of the face are in space, shape (n, 3)."""
        return points.positions(self.scene.vertices, self.scene.triangles)

    def shown(self, pixels: Pixels, camera: Camera, places: Array) -> tuple[Array, bool]:
        """Return where the view shows what was drawn at ``pixels`` of ``camera``, and whether it is the same view.

        From elsewhere, a drawing is shown as if it stood in space as far away as ``places``, (n, 3), on the face do.
        """
        seen = seen_pixels(pixels, camera, self.camera)
        if seen is not None:
            return seen, True
        depth = float(camera.to_camera(places)[:, 2].mean())
        offsets = (np.asarray(pixels, dtype=np.float64) - camera.principal_point) / camera.focal
        local = np.column_stack([offsets * depth, np.full(len(offsets), depth)])
        return self.camera.project((local - camera.translation) @ camera.rotation), False


class Mark(Protocol):
    """How one constraint appears in the view."""

    def paint(self, painter: Painter, alpha: float) -> None:
        """Draw it with the opacity ``alpha``."""

    @property
    def anchor(self) -> Pixel | None:
        """A place in the view beside which a label can stand, or None."""
        ...


#: Makes the mark of the constraint with an index; None where it has none.
MarkMaker = Callable[[int, Any, MarkView], Mark | None]


def as_pixel(place: Array) -> Pixel:
    """Return the pixel ``place``, shape (2,)."""
    u, v = place.tolist()
    return (u, v)
