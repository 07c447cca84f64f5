"""Strokes along features of a face, for tests."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from faceposer.geometry.camera import Camera, OrbitView
from faceposer.geometry.picking import SurfacePoints
from faceposer.model.face_model import FaceModel, build_face_model
from faceposer.model.feature_curves import FEATURES
from faceposer.sketch.recognition import DrawnStroke


@dataclass(frozen=True, eq=False)
class Matched:
    """A stroke with its matched feature points."""

    camera: Camera
    matched: tuple[tuple[str, tuple[float, float]], ...]


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


def moved_world(model: FaceModel, linear: np.ndarray, names: Mapping[str, str]) -> FaceModel:
    """Return the model of the character moved by ``linear``, shape (3, 3), with renamed feature points."""
    character = model.character
    turned = linear.astype(np.float32)
    flipped = bool(np.linalg.det(linear) < 0)
    polygons = character.polygons.copy()
    if flipped:
        # Counter-clockwise polygons are clockwise in a mirror.
        last = np.where(polygons[:, 3] >= 0, 3, 2)
        for row, k in zip(polygons, last, strict=True):
            row[1], row[k] = row[k], row[1]
    points = {names.get(name, name): vertex for name, vertex in character.feature_points.items()}
    moved = replace(
        character,
        vertices=character.vertices @ turned.T,
        shapes=character.shapes @ turned.T,
        polygons=polygons,
        feature_points={name: points[name] for name in character.feature_points},
    )
    return build_face_model(moved)


def mirrored_camera(camera: Camera) -> Camera:
    """Return the camera on the other side of x = 0, in which u becomes width - u."""
    mirror = np.diag([-1.0, 1.0, 1.0])
    return Camera(mirror @ camera.rotation @ mirror, mirror @ camera.translation, camera.focal, camera.size)
