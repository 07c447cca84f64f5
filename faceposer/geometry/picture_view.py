"""The view through the camera of a photo, moved like a flat picture, so that photo and face stay together."""

import math
from dataclasses import dataclass, replace

import numpy as np

from faceposer.geometry.camera import Array, Camera, OrbitView

_ZOOMS = (0.2, 40.0)
_MAX_PITCH = math.radians(89.0)


@dataclass(frozen=True)
class PictureView:
    """What the camera of a photo sees, or a part of it; turned away from the photo only where that is allowed.

    It has the moves of an ``OrbitView``, so that the same hand steers both.

    Attributes:
        photo: The camera of the whole photo, in the photo's pixels.
        target: The point that a turn goes around, in the unit of the mesh.
        zoom: How many times as large as where the whole photo fits.
        middle: The pixel of the photo that lies in the middle of the view.
        yaw: Turn away from the photo's camera, towards the right of its picture, radians.
        pitch: Rise above the photo's camera, radians.
        locked: Whether the view is kept from being turned.
    """

    photo: Camera
    target: tuple[float, float, float]
    zoom: float = 1.0
    middle: tuple[float, float] = (0.0, 0.0)
    yaw: float = 0.0
    pitch: float = 0.0
    locked: bool = True

    @classmethod
    def whole(cls, photo: Camera, target: tuple[float, float, float]) -> "PictureView":
        """Return the view in which all of the photo can be seen."""
        return cls(photo, target, middle=(photo.size[0] / 2.0, photo.size[1] / 2.0))

    @property
    def aligned(self) -> bool:
        """Whether it looks through the photo's camera, so that the photo fits to what is seen."""
        return self.yaw == 0.0 and self.pitch == 0.0

    @property
    def distance(self) -> float:
        """What falls as the picture grows, as the distance of an orbiting view does."""
        return 1.0 / self.zoom

    def scale(self, size: tuple[int, int]) -> float:
        """Return how many pixels of a view of ``size`` a pixel of the photo takes."""
        return self.zoom * min(size[0] / self.photo.size[0], size[1] / self.photo.size[1])

    def camera(self, size: tuple[int, int]) -> Camera:
        """Return the pinhole camera of this view for a picture of ``size`` pixels."""
        scale = self.scale(size)
        rotation, translation = self.photo.rotation, self.photo.translation
        if not self.aligned:
            turn = self._turn()
            # The target stays where it is in the picture.
            near = rotation @ np.asarray(self.target) + translation
            rotation, translation = turn @ rotation, turn @ (translation - near) + near
        axis = self.photo.principal_point
        shift = ((axis[0] - self.middle[0]) * scale, (axis[1] - self.middle[1]) * scale)
        return Camera(rotation, translation, self.photo.focal * scale, size, shift)

    def _turn(self) -> Array:
        cos_yaw, sin_yaw = math.cos(self.yaw), math.sin(self.yaw)
        cos_pitch, sin_pitch = math.cos(self.pitch), math.sin(self.pitch)
        across = np.array([[cos_yaw, 0.0, sin_yaw], [0.0, 1.0, 0.0], [-sin_yaw, 0.0, cos_yaw]])
        up = np.array([[1.0, 0.0, 0.0], [0.0, cos_pitch, -sin_pitch], [0.0, sin_pitch, cos_pitch]])
        turned: Array = up @ across
        return turned

    def through(self, photo: Camera) -> "PictureView":
        """Return the view of the same part of the photo through another camera of it."""
        return replace(self, photo=photo)

    def back(self) -> "PictureView":
        """Return the view that looks through the photo's camera again."""
        return replace(self, yaw=0.0, pitch=0.0)

    def showing(self, lower: Array, upper: Array, size: tuple[int, int]) -> "PictureView":
        """Return the view that shows the photo from pixel ``lower`` to ``upper``, each (2,), as large as it can."""
        across, down = np.maximum(np.asarray(upper) - lower, 1.0)
        zoom = min(size[0] / across, size[1] / down) / replace(self, zoom=1.0).scale(size)
        x, y = ((np.asarray(lower) + upper) / 2.0).tolist()
        return replace(self, zoom=min(max(zoom, _ZOOMS[0]), _ZOOMS[1]), middle=(x, y))

    # The moves of an orbiting view

    def looking(self, name: str) -> OrbitView:
        """Return the orbiting view from the direction ``name``, which has nothing to do with the photo."""
        return OrbitView.of_camera(self.photo, self.target).looking(name)

    def orbited(self, dx: float, dy: float, size: tuple[int, int]) -> "PictureView":
        """Return the view after a drag of (dx, dy) pixels, turned unless it is locked."""
        if self.locked:
            return self
        speed = math.pi / max(size[1], 1)
        pitch = min(max(self.pitch + dy * speed, -_MAX_PITCH), _MAX_PITCH)
        return replace(self, yaw=math.remainder(self.yaw + dx * speed, 2.0 * math.pi), pitch=pitch)

    def panned(self, dx: float, dy: float, size: tuple[int, int]) -> "PictureView":
        """Return the view after the picture was moved by (dx, dy) pixels."""
        scale = self.scale(size)
        return replace(self, middle=(self.middle[0] - dx / scale, self.middle[1] - dy / scale))

    def zoomed(self, factor: float, limits: tuple[float, float] = _ZOOMS) -> "PictureView":
        """Return the view with everything ``factor`` times as large, within ``limits`` of the zoom."""
        return replace(self, zoom=min(max(self.zoom * factor, limits[0]), limits[1]))


View = OrbitView | PictureView
