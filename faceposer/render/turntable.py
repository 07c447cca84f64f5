"""Cameras that look at the whole head, from one place or all round it."""

import math
from collections.abc import Iterable
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from faceposer.geometry.camera import Camera, OrbitView

# Share of the half of the picture that the head may fill.
_FILLED = 0.92


def framed_all_round(poses: Iterable[ArrayLike], size: tuple[int, int]) -> OrbitView:
    """Return the view from the front whose circle about the head shows all of it from every side.

    Args:
        poses: Vertices that must be seen, (N, 3) each, at least one.
        size: Of the picture, in pixels.
    """
    vertices = [np.asarray(pose, dtype=np.float64) for pose in poses]
    low = np.min([pose.min(axis=0) for pose in vertices], axis=0)
    high = np.max([pose.max(axis=0) for pose in vertices], axis=0)
    middle = (low + high) / 2.0
    view = OrbitView.preset(low, high)
    up = _FILLED * math.tan(view.fov_y / 2.0)
    across = up * size[0] / max(size[1], 1)
    distance = max(_distance(pose - middle, up, across) for pose in vertices)
    x, y, z = middle.tolist()
    return replace(view, target=(x, y, z), distance=distance)


def _distance(points: NDArray[np.float64], up: float, across: float) -> float:
    """Return how far from the axis a camera sees all of ``points`` wherever on its circle it stands.

    A point at the radius r comes at most r nearer than the axis, where |y| <= up (d - r) must hold. At the angle a from
    the line of sight it must be |r sin a| <= across (d - r cos a), for which d is greatest at tan a = 1 / across.
    """
    radius = np.hypot(points[:, 0], points[:, 2])
    tall = np.abs(points[:, 1]) / up + radius
    wide = radius * math.hypot(1.0, 1.0 / across)
    return float(max(tall.max(), wide.max()))


def turned(view: OrbitView, share: float, size: tuple[int, int]) -> Camera:
    """Return the camera after ``share`` of a turn, 0 to 1: the face turns towards its own right as we walk round it."""
    yaw = math.remainder(view.yaw + 2.0 * math.pi * share, 2.0 * math.pi)
    return replace(view, yaw=yaw).camera(size)
