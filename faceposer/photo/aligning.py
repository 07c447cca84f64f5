"""Estimation of a photo's camera from its pins, and the errors of the pins."""

from dataclasses import replace
from typing import cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from faceposer.errors import FacePoserError
from faceposer.geometry.camera import Camera
from faceposer.geometry.picking import SurfacePoint, SurfacePoints
from faceposer.model.face_model import FaceModel
from faceposer.photo.photo import Photo
from faceposer.photo.places import anchor_of, rigidity
from faceposer.photo.reading import FOCAL_SPREAD, LIKELY_FOCAL_MM, focal_in_pixels
from faceposer.solve.camera_fit import fit_camera

Array = NDArray[np.float64]

# Standard deviation of feature positions between people, as a share of the head's height.
_MISFIT = 0.015
# Sine of the usual angle between face and camera in photos, which resolves ambiguities of pins along a line.
_USUAL_TURN = 0.5
# Height of the head as a share of the image's shorter side before there are pins.
_FIRST_SHARE = 0.45
# Least and largest height of the head as a share of that side: pins beyond determine no camera.
_LEAST_SHARE, _LARGEST_SHARE = 0.01, 100.0


class DegeneratePinsError(FacePoserError):
    """The pins determine no camera, as when all of them are at the same pixel."""


def first_camera(photo: Photo, model: FaceModel) -> Camera:
    """Return a camera for ``photo`` before it has pins, with a frontal view of the whole head."""
    character = model.character
    width, height = photo.size
    focal = photo.focal or focal_in_pixels(LIKELY_FOCAL_MM, photo.size)
    depth = focal * character.height / (_FIRST_SHARE * min(width, height))
    lower, upper = character.vertices.min(axis=0), character.vertices.max(axis=0)
    centre = np.array([(lower[0] + upper[0]) / 2.0, character.vertices[:, 1].max() - 0.5 * character.height, 0.0])
    rotation = np.diag([1.0, -1.0, -1.0])
    return Camera(rotation, np.array([0.0, 0.0, depth]) - rotation @ centre, focal, photo.size)


def pinned(photo: Photo, model: FaceModel) -> tuple[list[int], SurfacePoints]:
    """Return the indices of the pins with places on the character, and these places."""
    found = [(i, anchor_of(pin.place, model.character)) for i, pin in enumerate(photo.pins)]
    met = [(i, cast("SurfacePoint | int", anchor)) for i, anchor in found if anchor is not None]
    return [i for i, _ in met], SurfacePoints.of([anchor for _, anchor in met])


def aligned(photo: Photo, model: FaceModel, p: ArrayLike) -> Photo:
    """Return ``photo`` with the camera estimated from its pins for the pose ``p``, shape (r,).

    Pins that move with the expression have little weight if there are enough others.

    Raises:
        DegeneratePinsError: If the pins determine no camera; ``unaligned`` then keeps the camera.
    """
    indices, points = pinned(photo, model)
    if not indices:
        return replace(photo, camera=first_camera(photo, model))
    start = photo.camera or first_camera(photo, model)
    likely = photo.focal or focal_in_pixels(LIKELY_FOCAL_MM, photo.size)
    # Every fit starts at the likely focal length, with the size of the head unchanged.
    start = replace(start, focal=likely, translation=start.translation * [1.0, 1.0, likely / start.focal])
    pixels = np.array([photo.pins[i].pixel for i in indices])
    places = model.positions_at(points, p)
    weights = np.array([rigidity(photo.pins[i].place, model) for i in indices])
    if (weights >= 0.25).sum() < 4:
        # Too few rigid points: use all of them.
        weights = np.maximum(weights, 0.5)
    spread = FOCAL_SPREAD if photo.focal is None else 0.0
    sigma = _MISFIT * model.character.height * _pixels_per_unit(places, pixels)
    fit = fit_camera(places, pixels, start, weights, spread, max(sigma, 1.0), _USUAL_TURN)
    share = fit.camera.focal * model.character.height / max(_depth(fit.camera, places), 1e-9) / min(photo.size)
    if not _LEAST_SHARE < share < _LARGEST_SHARE:
        raise DegeneratePinsError(
            "The pins determine no camera, since the head would be "
            f"{'far too small' if share < 1.0 else 'far too large'}; place each pin where the photo shows its point."
        )
    return replace(photo, camera=fit.camera)


def unaligned(photo: Photo, model: FaceModel) -> Photo:
    """Return ``photo``, whose pins determine no camera, with its present camera or else the first one."""
    return replace(photo, camera=photo.camera or first_camera(photo, model))


def _depth(camera: Camera, places: Array) -> float:
    """Return the mean distance of ``places``, shape (n, 3), from ``camera`` along its axis."""
    return float(camera.to_camera(places)[:, 2].mean())


def _pixels_per_unit(places: Array, pixels: Array) -> float:
    """Return the approximate number of pixels per unit of the mesh in the photo."""
    extent = float(np.ptp(places[:, :2], axis=0).max()) if len(places) > 1 else 0.0
    return float(np.ptp(pixels, axis=0).max()) / extent if extent > 0.0 else 1.0


def residuals_px(photo: Photo, model: FaceModel, p: ArrayLike) -> dict[int, float]:
    """Return the distance of the face ``p`` from each pin, in pixels of the photo, by the pin's index."""
    indices, points = pinned(photo, model)
    if photo.camera is None or not indices:
        return {}
    errors = photo.camera.project(model.positions_at(points, p)) - [photo.pins[i].pixel for i in indices]
    return dict(zip(indices, np.hypot(*errors.T).tolist(), strict=True))
