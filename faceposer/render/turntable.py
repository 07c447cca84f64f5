"""Cameras that turn around the head."""

import math
from collections.abc import Iterable
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from faceposer.geometry.camera import Camera, OrbitView

# Share of the image that the head may fill.
_FILL = 0.92


def orbit_framing(poses: Iterable[ArrayLike], size: tuple[int, int]) -> OrbitView:
    """Return the front view at the distance from which the whole head is visible all around.

    Args:
        poses: Vertices that must be visible, (N, 3) each, at least one pose.
        size: Width and height of the image, in pixels.
    """
    vertices = [np.asarray(pose, dtype=np.float64) for pose in poses]
    low = np.min([pose.min(axis=0) for pose in vertices], axis=0)
    high = np.max([pose.max(axis=0) for pose in vertices], axis=0)
    middle = (low + high) / 2.0
    view = OrbitView.preset(low, high)
    up = _FILL * math.tan(view.fov_y / 2.0)
    across = up * size[0] / max(size[1], 1)
    distance = max(_distance(pose - middle, up, across) for pose in vertices)
    x, y, z = middle.tolist()
    return replace(view, target=(x, y, z), distance=distance)


def _distance(points: NDArray[np.float64], up: float, across: float) -> float:
    """Return the distance from the vertical axis at which a camera sees all of ``points`` during a whole turn.

    A point at the radius r is at most r closer than the axis, where |y| <= up (d - r) must hold. At the angle a from
    the line of sight, |r sin a| <= across (d - r cos a) must hold; the required d is greatest at tan a = 1 / across.
    """
    radius = np.hypot(points[:, 0], points[:, 2])
    vertical = np.abs(points[:, 1]) / up + radius
    horizontal = radius * math.hypot(1.0, 1.0 / across)
    return float(max(vertical.max(), horizontal.max()))


def turned(view: OrbitView, share: float, size: tuple[int, int]) -> Camera:
    """Return the camera after ``share`` of a turn, 0 to 1, in which the face appears to turn to its right."""
    yaw = math.remainder(view.yaw + 2.0 * math.pi * share, 2.0 * math.pi)
    return replace(view, yaw=yaw).camera(size)
