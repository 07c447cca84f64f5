"""Errors of the networks on photos whose truth is known."""

from faceposer.geometry.picking import SurfacePoints
from faceposer.identity.photos.face_places import LandmarkErrors


def learn_errors(points: SurfacePoints, n_photos: int) -> LandmarkErrors:
    raise NotImplementedError
