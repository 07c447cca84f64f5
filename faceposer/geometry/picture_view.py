"""The view through the camera of a photo, which pans and zooms like a flat image to keep photo and face aligned."""

import math
from dataclasses import dataclass, replace

import numpy as np

from faceposer.geometry.camera import Array, Camera, OrbitView

_ZOOMS = (0.2, 40.0)
_MAX_PITCH = math.radians(89.0)


@dataclass(frozen=True)
class PictureView:
    """A view of a photo or a part of it through the photo's camera, which can be orbited unless it is locked.

    It has the navigation methods of ``OrbitView``, so that both respond to the same input.

    Attributes:
        photo: Camera of the whole photo, in the photo's pixels.
        target: Centre of the orbit, in the unit of the mesh.
        zoom: Magnification relative to the view in which the whole photo fits.
        middle: Pixel of the photo in the middle of the view.
        yaw: Turn away from the photo's camera, towards the right of the photo, in radians.
        pitch: Elevation above the photo's camera, in radians.
        locked: True if the view cannot be orbited.
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
        """Return the view of the whole photo."""
        return cls(photo, target, middle=(photo.size[0] / 2.0, photo.size[1] / 2.0))

    @property
    def aligned(self) -> bool:
        """True if the view has the orientation of the photo's camera, so that photo and face are aligned."""
        return self.yaw == 0.0 and self.pitch == 0.0

    @property
    def distance(self) -> float:
        """Inverse of the zoom, the counterpart of the distance of an orbit view."""
        return 1.0 / self.zoom

    def scale(self, size: tuple[int, int]) -> float:
        """Return the size of a pixel of the photo in pixels of a view of ``size``."""
        return self.zoom * min(size[0] / self.photo.size[0], size[1] / self.photo.size[1])

    def camera(self, size: tuple[int, int]) -> Camera:
        """Return the pinhole camera of this view for an image of ``size`` pixels."""
        scale = self.scale(size)
        rotation, translation = self.photo.rotation, self.photo.translation
        if not self.aligned:
            turn = self._turn()
            # Rotate about the target, which does not move in the image.
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
        """Return the view of the same part of the photo with another camera of the photo."""
        return replace(self, photo=photo)

    def back(self) -> "PictureView":
        """Return the view with the orientation of the photo's camera."""
        return replace(self, yaw=0.0, pitch=0.0)

    def showing(self, lower: Array, upper: Array, size: tuple[int, int]) -> "PictureView":
        """Return the view that fits the photo from pixel ``lower`` to ``upper``, shape (2,) each."""
        across, down = np.maximum(np.asarray(upper) - lower, 1.0)
        zoom = min(size[0] / across, size[1] / down) / replace(self, zoom=1.0).scale(size)
        x, y = ((np.asarray(lower) + upper) / 2.0).tolist()
        return replace(self, zoom=min(max(zoom, _ZOOMS[0]), _ZOOMS[1]), middle=(x, y))

    # The navigation methods of OrbitView

    def looking(self, name: str) -> OrbitView:
        """Return the orbit view from the direction ``name``, independent of the photo."""
        return OrbitView.from_camera(self.photo, self.target).looking(name)

    def orbited(self, dx: float, dy: float, size: tuple[int, int]) -> "PictureView":
        """Return the view after a drag by (dx, dy) pixels; a locked view does not turn."""
        if self.locked:
            return self
        speed = math.pi / max(size[1], 1)
        pitch = min(max(self.pitch + dy * speed, -_MAX_PITCH), _MAX_PITCH)
        return replace(self, yaw=math.remainder(self.yaw + dx * speed, 2.0 * math.pi), pitch=pitch)

    def panned(self, dx: float, dy: float, size: tuple[int, int]) -> "PictureView":
        """Return the view after a pan by (dx, dy) pixels."""
        scale = self.scale(size)
        return replace(self, middle=(self.middle[0] - dx / scale, self.middle[1] - dy / scale))

    def zoomed(self, factor: float, limits: tuple[float, float] = _ZOOMS) -> "PictureView":
        """Return the view magnified by ``factor``, with the zoom kept within ``limits``."""
        return replace(self, zoom=min(max(self.zoom * factor, limits[0]), limits[1]))


View = OrbitView | PictureView
