"""Lines along features of the face, as an artist would stroke them: their feature points and brush widths."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from faceposer.geometry.camera import Camera
from faceposer.geometry.strokes import resampled, stroke_pixels
from faceposer.model.face_model import FaceModel
from faceposer.solve.term import Array

#: Feature points along each line, from end to end.
FEATURE_LINES: dict[str, tuple[str, ...]] = {
    "brow_left": ("4.1", "4.3", "4.5"),
    "brow_right": ("4.2", "4.4", "4.6"),
    "lip_upper": ("8.4", "8.6", "8.9", "8.1", "8.10", "8.5", "8.3"),
    "lip_lower": ("8.4", "8.8", "8.2", "8.7", "8.3"),
    "cheek_left": ("5.3", "5.1", "8.3"),
    "cheek_right": ("5.4", "5.2", "8.4"),
    "lid_left": ("3.11", "3.1", "3.7"),
    "lid_right": ("3.8", "3.2", "3.12"),
}


def feature_line(model: FaceModel, vertices: ArrayLike, camera: Camera, names: Sequence[str]) -> Array:
    """Return the pixels, shape (n, 2), at which ``camera`` shows the feature points ``names`` of ``vertices``, (N, 3).

    Raises:
        KeyError: If the character has no such feature point.
    """
    ids = [model.character.feature_points[name] for name in names]
    return camera.project(np.asarray(vertices)[ids])


def width_of(line: ArrayLike, pixels: int) -> float:
    """Return the brush diameter, at least 1, with which a stroke along ``line``, (n, 2), covers about ``pixels``."""
    low, high = 1.0, 200.0
    for _ in range(16):
        width = 0.5 * (low + high)
        low, high = (width, high) if len(stroke_pixels(line, width)) < pixels else (low, width)
    return high


def of_length(line: ArrayLike, factor: float) -> Array:
    """Return ``line``, shape (n, 2), with ``factor`` times its length: trimmed or extended straight at both ends."""
    points = resampled(line, 1.0)
    extra = 0.5 * (factor - 1.0) * float(np.hypot(*np.diff(points, axis=0).T).sum())
    if extra < 0.0:
        cut = min(round(-extra), (len(points) - 2) // 2)
        return points[cut : len(points) - cut]
    ends = []
    for end, inner in ((points[0], points[min(8, len(points) - 1)]), (points[-1], points[-min(9, len(points))])):
        direction = (end - inner) / max(float(np.hypot(*(end - inner))), 1e-9)
        ends.append(end + extra * direction)
    return np.concatenate([ends[:1], points, ends[1:]])
