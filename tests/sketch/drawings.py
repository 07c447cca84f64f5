"""Strokes along features of a posed face, as someone would draw them, for tests."""

from typing import Any

import numpy as np

from faceposer.geometry.camera import Camera
from faceposer.model.face_model import FaceModel
from faceposer.model.feature_curves import feature_curves


def drawn(model: FaceModel, feature: str, p: Any, camera: Camera) -> list[list[float]]:
    """Return pixels along ``feature`` of the face ``p``, about 6 pixels apart."""
    points = feature_curves(model.character)[feature][0].points
    pixels = camera.project(model.positions_at(points, p))
    along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(pixels, axis=0).T))])
    at = np.linspace(0.0, along[-1], max(4, round(along[-1] / 6.0)))
    places = np.stack([np.interp(at, along, axis) for axis in pixels.T], axis=1)
    rounded: list[list[float]] = np.round(places, 2).tolist()
    return rounded


def scribble(camera: Camera) -> list[list[float]]:
    """Return pixels of a zigzag over most of the image."""
    width, height = camera.size
    rows = np.linspace(0.2, 0.8, 12) * height
    return [[(0.25 if i % 2 else 0.75) * width, float(v)] for i, v in enumerate(rows)]
