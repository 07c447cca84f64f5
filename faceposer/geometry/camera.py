"""The pinhole camera used for drawing, picking and solving, and the orbit view of the window.

Camera space has x to the right, y down and z forward; pixels have their origin at the top left. This is the paper's
projection (Lau et al. 2009, eqs. (4) and (5)) with a single focal length in pixels, so that windows that are not square
do not stretch the image.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from faceposer.geometry.alignment import Similarity

Array = NDArray[np.float64]
ViewName = Literal["front", "back", "left", "right", "three-quarter", "top", "bottom"]

# Yaw, towards the character's left (+x), and pitch, upwards, of the camera in degrees.
VIEW_ANGLES: dict[str, tuple[float, float]] = {
    "front": (0.0, 0.0),
    "back": (180.0, 0.0),
    "left": (90.0, 0.0),
    "right": (-90.0, 0.0),
    "three-quarter": (35.0, 4.0),
    "top": (0.0, 89.0),
    "bottom": (0.0, -89.0),
}
_MAX_PITCH = math.radians(89.0)
_NEAREST = 1e-6


@dataclass(frozen=True, eq=False)
class Camera:
    """A pinhole camera: u = focal x / z + width / 2 + shift in camera space, and v likewise with y and height.

    Attributes:
        rotation: Rotation from world to camera, shape (3, 3).
        translation: Translation after the rotation, in the unit of the mesh, shape (3,).
        focal: Focal length in pixels.
        size: Width and height of the image in pixels.
        shift: Offset of the principal point from the middle of the image, in pixels; not zero in views of a part of a
            photo.
    """

    rotation: Array
    translation: Array
    focal: float
    size: tuple[int, int]
    shift: tuple[float, float] = (0.0, 0.0)

    def __post_init__(self) -> None:
        for name, shape in (("rotation", (3, 3)), ("translation", (3,))):
            value = np.array(getattr(self, name), dtype=np.float64)
            if value.shape != shape or not np.isfinite(value).all():
                raise ValueError(f"{name} must be finite and of shape {shape}")
            value.setflags(write=False)
            object.__setattr__(self, name, value)
        if np.abs(self.rotation @ self.rotation.T - np.eye(3)).max() > 1e-4 or np.linalg.det(self.rotation) < 0:
            raise ValueError("rotation must be a rotation matrix")
        if not (math.isfinite(self.focal) and self.focal > 0):
            raise ValueError("focal must be positive")
        object.__setattr__(self, "size", (int(self.size[0]), int(self.size[1])))
        shift = (float(self.shift[0]), float(self.shift[1]))
        if not (math.isfinite(shift[0]) and math.isfinite(shift[1])):
            raise ValueError("shift must be finite")
        object.__setattr__(self, "shift", shift)

    @cached_property
    def _key(self) -> tuple[object, ...]:
        return (self.rotation.tobytes(), self.translation.tobytes(), float(self.focal), self.size, self.shift)

    def __eq__(self, other: object) -> bool:
        return self is other or (isinstance(other, Camera) and self._key == other._key)

    def __hash__(self) -> int:
        return hash(self._key)

    @cached_property
    def center(self) -> Array:
        """The camera's position in world space, shape (3,)."""
        return -self.rotation.T @ self.translation

    @property
    def principal_point(self) -> Array:
        """The pixel on the optical axis, shape (2,)."""
        return np.array([self.size[0] / 2.0 + self.shift[0], self.size[1] / 2.0 + self.shift[1]])

    def following(self, frame: Similarity) -> "Camera":
        """Return the camera moved along with ``frame``: it projects moved points to the pixels of the unmoved ones."""
        if float(frame.scale) == 1.0 and not frame.translation.any() and np.array_equal(frame.rotation, np.eye(3)):
            return self
        rotation = self.rotation @ frame.rotation.T
        return replace(
            self, rotation=rotation, translation=float(frame.scale) * self.translation - rotation @ frame.translation
        )

    def to_camera(self, points: ArrayLike) -> Array:
        """Return world ``points`` of shape (n, 3) in camera space, shape (n, 3)."""
        return np.asarray(points, dtype=np.float64) @ self.rotation.T + self.translation

    def project(self, points: ArrayLike) -> Array:
        """Return the pixels, shape (n, 2), of world ``points`` of shape (n, 3)."""
        local = self.to_camera(points)
        depth = np.maximum(local[:, 2:], _NEAREST)
        return self.focal * local[:, :2] / depth + self.principal_point

    def project_with_jacobian(self, points: ArrayLike) -> tuple[Array, Array]:
        """Return pixels and their derivatives with respect to the world points (paper, eq. (23)).

        Args:
            points: World positions, shape (n, 3).

        Returns:
            Pixels of shape (n, 2), and derivatives of shape (n, 2, 3).
        """
        local = self.to_camera(points)
        inverse_depth = 1.0 / np.maximum(local[:, 2], _NEAREST)
        normalized = local[:, :2] * inverse_depth[:, None]
        pixels = self.focal * normalized + self.principal_point
        # d(x/z) = (dx - (x/z) dz) / z
        jacobian = self.rotation[None, :2, :] - normalized[:, :, None] * self.rotation[None, None, 2, :]
        jacobian *= (self.focal * inverse_depth)[:, None, None]
        return pixels, jacobian

    def ray(self, pixel: Sequence[float] | Array) -> tuple[Array, Array]:
        """Return the origin and the unit direction, each of shape (3,), of the ray through ``pixel`` in world space."""
        offset = (np.asarray(pixel, dtype=np.float64) - self.principal_point) / self.focal
        direction = self.rotation.T @ np.array([offset[0], offset[1], 1.0])
        return self.center, direction / np.linalg.norm(direction)

    def transferred(self, pixel: Sequence[float] | Array, other: "Camera") -> tuple[float, float] | None:
        """Return the pixel in ``other`` that corresponds to ``pixel``, or None if their viewpoints differ.

        Cameras of the same view in windows of different sizes, or of different parts of a photo, differ only in scale
        and principal point.
        """
        if not self.same_viewpoint(other):
            return None
        offset = np.asarray(pixel, dtype=np.float64) - self.principal_point
        u, v = (offset * (other.focal / self.focal) + other.principal_point).tolist()
        return (u, v)

    def same_viewpoint(self, other: "Camera") -> bool:
        """Return True if both cameras have the same position and orientation, regardless of their image sizes."""
        # A view restored from a file differs in the last digits.
        turned = np.abs(self.rotation - other.rotation).max()
        moved = np.abs(self.translation - other.translation).max()
        return bool(turned <= 1e-9 and moved <= 1e-7)

    def resized(self, size: tuple[int, int]) -> "Camera":
        """Return the camera for another image size with the same vertical framing."""
        scale = size[1] / self.size[1]
        return replace(self, focal=self.focal * scale, size=size, shift=(self.shift[0] * scale, self.shift[1] * scale))


@dataclass(frozen=True)
class OrbitView:
    """A view that orbits a target.

    Attributes:
        target: Point at the centre of the view, in the unit of the mesh.
        yaw: Turn of the camera towards the character's left, in radians.
        pitch: Elevation of the camera, in radians, limited to 89 degrees.
        distance: Distance from the camera to the target, in the unit of the mesh.
        fov_y: Vertical field of view, in radians.
    """

    target: tuple[float, float, float]
    yaw: float = 0.0
    pitch: float = 0.0
    distance: float = 100.0
    fov_y: float = math.radians(20.0)

    @classmethod
    def preset(
        cls, lower: ArrayLike, upper: ArrayLike, name: str = "front", fov_y: float = math.radians(20.0)
    ) -> "OrbitView":
        """Return the view ``name`` that frames the box from ``lower`` to ``upper``, each of shape (3,).

        Raises:
            KeyError: If there is no such view.
        """
        low, high = np.asarray(lower, dtype=np.float64), np.asarray(upper, dtype=np.float64)
        yaw, pitch = (math.radians(angle) for angle in VIEW_ANGLES[name])
        # The nearest face of the box must fit, not just its middle plane.
        distance = 0.56 * (high[1] - low[1]) / math.tan(fov_y / 2.0) + 0.5 * (high[2] - low[2])
        x, y, z = (low + high) / 2.0
        return cls((float(x), float(y), float(z)), yaw, pitch, float(distance), fov_y)

    @classmethod
    def from_camera(cls, camera: Camera, near: ArrayLike) -> "OrbitView":
        """Return the view equal to ``camera`` that orbits the point in front of it at the depth of ``near``, (3,).

        A roll of the camera and a pitch beyond 89 degrees, which orbits do not have, are lost.
        """
        right, _, forward = camera.rotation
        pitch = math.asin(min(max(-forward[1], -1.0), 1.0))
        distance = max(float(camera.rotation[2] @ np.asarray(near) + camera.translation[2]), 5.0)
        x, y, z = (camera.center + distance * forward).tolist()
        return cls(
            (x, y, z),
            math.atan2(-right[2], right[0]),
            min(max(pitch, -_MAX_PITCH), _MAX_PITCH),
            distance,
            2.0 * math.atan(0.5 * camera.size[1] / camera.focal),
        )

    def looking(self, name: str) -> "OrbitView":
        """Return the view from the direction ``name`` with the same target and distance."""
        yaw, pitch = (math.radians(angle) for angle in VIEW_ANGLES[name])
        return replace(self, yaw=yaw, pitch=pitch)

    def _axes(self) -> Array:
        """Return the camera's right, down and forward axes as rows."""
        sin_yaw, cos_yaw, sin_pitch, cos_pitch = (
            math.sin(self.yaw),
            math.cos(self.yaw),
            math.sin(self.pitch),
            math.cos(self.pitch),
        )
        forward = -np.array([sin_yaw * cos_pitch, sin_pitch, cos_yaw * cos_pitch])
        right = np.array([cos_yaw, 0.0, -sin_yaw])
        return np.stack([right, np.cross(forward, right), forward])

    def camera(self, size: tuple[int, int]) -> Camera:
        """Return the pinhole camera of this view for an image of ``size`` pixels."""
        rotation = self._axes()
        center = np.asarray(self.target) - self.distance * rotation[2]
        focal = 0.5 * max(size[1], 1) / math.tan(self.fov_y / 2.0)
        return Camera(rotation, -rotation @ center, focal, size)

    def orbited(self, dx: float, dy: float, size: tuple[int, int]) -> "OrbitView":
        """Return the view after a drag by (dx, dy) pixels; a drag over the image's height turns it by 180 degrees."""
        speed = math.pi / max(size[1], 1)
        pitch = min(max(self.pitch + dy * speed, -_MAX_PITCH), _MAX_PITCH)
        return replace(self, yaw=math.remainder(self.yaw - dx * speed, 2.0 * math.pi), pitch=pitch)

    def panned(self, dx: float, dy: float, size: tuple[int, int]) -> "OrbitView":
        """Return the view after a pan by (dx, dy) pixels, in which points at the target's depth follow the pointer."""
        per_pixel = 2.0 * self.distance * math.tan(self.fov_y / 2.0) / max(size[1], 1)
        right, down, _ = self._axes()
        x, y, z = np.asarray(self.target) - (dx * right + dy * down) * per_pixel
        return replace(self, target=(float(x), float(y), float(z)))

    def zoomed(self, factor: float, limits: tuple[float, float] = (5.0, 1000.0)) -> "OrbitView":
        """Return the view magnified by ``factor`` at the target, with the distance kept within ``limits``."""
        return replace(self, distance=min(max(self.distance / factor, limits[0]), limits[1]))
