"""The camera of a photo in unknowns that hardly depend on each other, with derivatives.

With the middle c of the face, a point is at y = R (x - c) and in pixels at

    u = s d (y_1 + a) / (y_3 + d) + u_0,     v = s d (y_2 + b) / (y_3 + d) + v_0.

The scale s, in pixels per centimetre at the depth d, the offsets a and b and the rotation R are determined well by a
face; d, and with it the focal length s d, only by its perspective: as d grows, weak perspective is approached.
"""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from faceposer.geometry.camera import Camera

Array = NDArray[np.float64]

#: Number of unknowns: a rotation vector, a, b, ln s, ln d.
N_CAMERA = 7
_NEAREST = 0.2


@dataclass(frozen=True, eq=False)
class FaceCamera:
    """A camera about the middle of a face.

    Attributes:
        rotation: R from world to camera, shape (3, 3).
        offset: (a, b) in centimetres.
        log_scale: ln s, s in pixels per centimetre.
        log_depth: ln d, d in centimetres.
        middle: c, shape (3,).
        principal: (u_0, v_0) in pixels.
        size: Width and height of the image.
    """

    rotation: Array
    offset: tuple[float, float]
    log_scale: float
    log_depth: float
    middle: Array
    principal: tuple[float, float]
    size: tuple[int, int]

    @classmethod
    def of(cls, camera: Camera, middle: Array) -> "FaceCamera":
        """Return ``camera`` about ``middle``, (3,), in front of it."""
        x, y, depth = camera.to_camera(middle[None])[0].tolist()
        u, v = camera.principal_point.tolist()
        return cls(
            camera.rotation, (x, y), math.log(camera.focal / depth), math.log(depth), middle, (u, v), camera.size
        )

    @property
    def camera(self) -> Camera:
        """The camera in the usual form."""
        depth = math.exp(self.log_depth)
        left, _, right = np.linalg.svd(self.rotation)
        rotation = left @ right
        place = np.array([*self.offset, depth]) - rotation @ self.middle
        width, height = self.size
        shift = (self.principal[0] - width / 2.0, self.principal[1] - height / 2.0)
        return Camera(rotation, place, math.exp(self.log_scale + self.log_depth), self.size, shift)

    @property
    def log_focal(self) -> float:
        """Logarithm of the focal length in pixels."""
        return self.log_scale + self.log_depth

    def moved(self, step: Array) -> "FaceCamera":
        """Return the camera after a ``step`` of its unknowns, shape (7,)."""
        step = np.clip(step, -0.5, 0.5) if np.abs(step[:3]).max() > 0.5 else step
        return replace(
            self,
            rotation=rotation_of(step[:3]) @ self.rotation,
            offset=(self.offset[0] + float(step[3]), self.offset[1] + float(step[4])),
            log_scale=self.log_scale + float(np.clip(step[5], -0.5, 0.5)),
            log_depth=self.log_depth + float(np.clip(step[6], -0.5, 0.5)),
        )

    def scaled(self, factor: float, corner: tuple[float, float], size: tuple[int, int]) -> "FaceCamera":
        """Return the camera of a crop from ``corner`` of the image, enlarged by ``factor`` to ``size``."""
        u, v = ((value - start) * factor for value, start in zip(self.principal, corner, strict=True))
        return replace(self, log_scale=self.log_scale + math.log(factor), principal=(u, v), size=size)

    def local(self, points: Array) -> Array:
        """Return y of ``points``, (n, 3), shape (n, 3)."""
        result: Array = (points - self.middle) @ self.rotation.T
        return result

    def project(self, points: Array) -> Array:
        """Return the pixels of ``points``, (n, 3), shape (n, 2)."""
        return self.pixels(self.local(points))

    def pixels(self, local: Array) -> Array:
        """Return the pixels of points at y, (n, 3)."""
        depth = math.exp(self.log_depth)
        factor = math.exp(self.log_scale) * depth / np.maximum(local[:, 2:] + depth, _NEAREST * depth)
        result: Array = factor * (local[:, :2] + self.offset) + self.principal
        return result

    def derivatives(self, local: Array) -> tuple[Array, Array]:
        """Return the derivatives of `pixels` by y, (n, 2, 3), and by the unknowns, (n, 2, 7), at y, (n, 3)."""
        depth, scale = math.exp(self.log_depth), math.exp(self.log_scale)
        behind = np.maximum(local[:, 2] + depth, _NEAREST * depth)
        factor = scale * depth / behind
        aside = local[:, :2] + self.offset
        by_place = np.zeros((len(local), 2, 3))
        by_place[:, 0, 0] = by_place[:, 1, 1] = factor
        by_place[:, :, 2] = -(factor / behind)[:, None] * aside
        by_camera = np.empty((len(local), 2, N_CAMERA))
        by_camera[:, :, :3] = by_place @ turning(local)
        by_camera[:, :, 3:5] = by_place[:, :, :2]
        relative = factor[:, None] * aside
        by_camera[:, :, 5] = relative
        by_camera[:, :, 6] = relative * (local[:, 2] / behind)[:, None]
        return by_place, by_camera


def turning(vectors: Array) -> Array:
    """Return the derivatives of ``vectors`` y, (n, 3), by a small rotation w, which moves them by w x y, (n, 3, 3)."""
    result = np.zeros((len(vectors), 3, 3))
    result[:, 0, 1], result[:, 0, 2] = vectors[:, 2], -vectors[:, 1]
    result[:, 1, 0], result[:, 1, 2] = -vectors[:, 2], vectors[:, 0]
    result[:, 2, 0], result[:, 2, 1] = vectors[:, 1], -vectors[:, 0]
    return result


def rotation_of(vector: Array) -> Array:
    """Return the rotation matrix of a rotation ``vector``, (3,), in radians (Rodrigues' formula)."""
    angle = float(np.linalg.norm(vector))
    x, y, z = vector
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    one = math.sin(angle) / angle if angle > 1e-9 else 1.0
    two = (1.0 - math.cos(angle)) / angle**2 if angle > 1e-6 else 0.5
    result: Array = np.eye(3) + one * cross + two * cross @ cross
    return result
