"""Interface of constraint marks, and the view in which they are drawn."""

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
from faceposer.tools.stroke_tool import pixels_in_view

Array = NDArray[np.float64]


@dataclass(frozen=True)
class MarkView:
    """The view in which marks appear.

    Attributes:
        viewport: The view.
        scene: The drawn face.
        moving: True while the face or the view moves; only points facing away then count as hidden.
    """

    viewport: Viewport
    scene: Scene
    moving: bool

    @property
    def camera(self) -> Camera:
        """The camera of the view."""
        return self.viewport.camera

    def hidden(self, points: SurfacePoints) -> NDArray[np.bool_]:
        """Return a mask of the ``points`` hidden by the face, shape (n,)."""
        if self.moving:
            return self.scene.facing_away(self.camera, points)
        return self.viewport.hidden(points)

    def positions(self, points: SurfacePoints) -> Array:
        """Return the positions of ``points`` of the face, shape (n, 3)."""
        return points.positions(self.scene.vertices, self.scene.triangles)

    def shown(self, pixels: Pixels, camera: Camera, positions: Array) -> tuple[Array, bool]:
        """Convert ``pixels`` of ``camera`` to the view, and return them with True if ``camera`` is that of the view.

        For another camera, the pixels are placed in space at the mean depth of ``positions``, (n, 3), on the face.
        """
        seen = pixels_in_view(pixels, camera, self.camera)
        if seen is not None:
            return seen, True
        depth = float(camera.to_camera(positions)[:, 2].mean())
        offsets = (np.asarray(pixels, dtype=np.float64) - camera.principal_point) / camera.focal
        local = np.column_stack([offsets * depth, np.full(len(offsets), depth)])
        return self.camera.project((local - camera.translation) @ camera.rotation), False


class Mark(Protocol):
    """A constraint as drawn in the view."""

    def paint(self, painter: Painter, alpha: float) -> None:
        """Draw the mark with opacity ``alpha``."""

    @property
    def anchor(self) -> Pixel | None:
        """Pixel next to which a label is drawn, or None."""
        ...


#: Returns the mark of the constraint with an index, or None.
MarkMaker = Callable[[int, Any, MarkView], Mark | None]


def as_pixel(pixel: Array) -> Pixel:
    """Convert ``pixel``, shape (2,), to a tuple."""
    u, v = pixel.tolist()
    return (u, v)
