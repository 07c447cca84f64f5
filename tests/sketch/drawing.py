"""Strokes along features of a face, for tests."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from faceposer.geometry.camera import Camera, OrbitView
from faceposer.geometry.picking import SurfacePoints
from faceposer.model.face_model import FaceModel
from faceposer.model.feature_curves import FEATURES
from faceposer.sketch.recognition import DrawnStroke


@dataclass(frozen=True, eq=False)
class Matched:
    """A stroke with its matched feature points."""

    camera: Camera
    points: tuple[tuple[str, tuple[float, float]], ...]


def camera_of(model: FaceModel, view: str = "front") -> Camera:
    """Return a camera that shows the whole head."""
    vertices = model.character.vertices
    return OrbitView.preset(vertices.min(axis=0), vertices.max(axis=0), view).camera((900, 700))


def tilted(camera: Camera, yaw: float, pitch: float, roll: float, about: np.ndarray) -> Camera:
    """Return ``camera`` turned by angles in degrees about a point."""
    turn = Rotation.from_euler("yxz", [yaw, pitch, roll], degrees=True).as_matrix()
    local = camera.to_camera(about[None])[0]
    rotation = turn @ camera.rotation
    return Camera(rotation, local - rotation @ about, camera.focal, camera.size)


def knots(model: FaceModel, p: np.ndarray, names: tuple[str, ...]) -> np.ndarray:
    """Return the positions of feature points on the face ``p``, shape (n, 3)."""
    ids = [model.character.feature_points[name] for name in names]
    return model.positions_at(SurfacePoints.at_vertices(ids), p)


def stroke_along(model: FaceModel, p: np.ndarray, feature: str, camera: Camera) -> DrawnStroke:
    """Return a stroke from feature point to feature point, over the middle of both chains of a mouth line."""
    chains = [knots(model, p, chain) for chain in FEATURES[feature].chains]
    pixels = camera.project(np.mean(chains, axis=0))
    if FEATURES[feature].closed:
        pixels = np.concatenate([pixels, pixels[:1]])
    return DrawnStroke(pixels, camera)


def matched(model: FaceModel, p: np.ndarray, feature: str, camera: Camera) -> Matched:
    """Return the feature points of ``feature`` at their pixels on the face ``p``."""
    names = FEATURES[feature].points
    pixels = camera.project(knots(model, p, names)).tolist()
    return Matched(camera, tuple((name, (u, v)) for name, (u, v) in zip(names, pixels, strict=True)))
