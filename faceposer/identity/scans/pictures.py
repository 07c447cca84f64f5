"""Pictures of a scan, the head on it, and the distance between them."""

import numpy as np
from numpy.typing import NDArray

from faceposer.geometry.camera import Camera
from faceposer.geometry.nearest_surface import NearestSurface
from faceposer.identity.scans.basis import HeadBasis
from faceposer.identity.scans.head_from_scans import FittedScan
from faceposer.landmarks.drawing import PaintedMesh, draw

Array = NDArray[np.float64]
Picture = NDArray[np.uint8]

# Side of each picture in pixels, width that it shows, distance of the camera, and the point looked at, in centimetres.
_SIDE, _WIDTH, _DISTANCE = 640, 27.0, 90.0
_TARGET = np.array([0.0, -1.0, 2.0])
# Angles of the views to the left of the front, in radians.
_YAWS = (0.0, 0.7)
# Distance at the end of the scale of colours, in centimetres.
_END = 0.2
_GREY = np.array([190.0, 186.0, 180.0])
#: Colours of distances from 0 to the end of the scale.
_SCALE = np.array(
    [[38.0, 70.0, 140.0], [60.0, 160.0, 170.0], [120.0, 200.0, 90.0], [240.0, 200.0, 60.0], [210.0, 50.0, 40.0]]
)
_BAR = 18


def distance_map(basis: HeadBasis, fitted: FittedScan) -> Picture:
    """Return a picture: a row for each view with the scan, the head, and the scan coloured by its distance.

    Blue is on the head, red 2 mm and farther away; grey where the head has no skin nearby. The bar below is the scale.
    """
    vertices = np.asarray(fitted.mesh.vertices, dtype=np.float64)
    head = PaintedMesh(fitted.posed, basis.triangles, _GREY)
    plain = PaintedMesh(vertices, fitted.mesh.triangles, _GREY)
    nearest = NearestSurface(fitted.posed, basis.triangles, np.arange(len(basis.triangles)), 12)
    _, distances = nearest.points(vertices)
    coloured = PaintedMesh(vertices, fitted.mesh.triangles, _colours(distances))
    rows = [np.hstack([draw(mesh, _camera(yaw)).image for mesh in (plain, head, coloured)]) for yaw in _YAWS]
    width = rows[0].shape[1]
    bar = np.tile(_colours(np.linspace(0.0, _END, width))[None], (_BAR, 1, 1)).astype(np.uint8)
    return np.vstack([*rows, bar])


def _colours(distances: Array) -> Array:
    """Return the colours, 0 to 255, of ``distances`` in centimetres, shape (n, 3)."""
    at = np.clip(distances / _END, 0.0, 1.0) * (len(_SCALE) - 1)
    steps = np.arange(len(_SCALE))
    colours = np.stack([np.interp(at, steps, channel) for channel in _SCALE.T], axis=1)
    colours[distances > 5.0 * _END] = _GREY
    return colours


def _camera(yaw: float) -> Camera:
    forward = -np.array([np.sin(yaw), 0.0, np.cos(yaw)])
    right = np.cross(forward, [0.0, 1.0, 0.0])
    rotation = np.stack([right, np.cross(forward, right), forward])
    centre = _TARGET - _DISTANCE * forward
    return Camera(rotation, -rotation @ centre, _SIDE * _DISTANCE / _WIDTH, (_SIDE, _SIDE))
