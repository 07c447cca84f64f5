"""The camera of a photo from its pins, and how far the pins are from being met."""

from dataclasses import replace
from typing import cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from faceposer.geometry.camera import Camera
from faceposer.geometry.picking import SurfacePoint, SurfacePoints
from faceposer.model.face_model import FaceModel
from faceposer.photo.photo import Photo
from faceposer.photo.places import anchor_of, rigidity
from faceposer.photo.reading import FOCAL_SPREAD, LIKELY_FOCAL_MM, focal_in_pixels
from faceposer.solve.camera_fit import fit_camera

Array = NDArray[np.float64]

# Share of the head's height by which a feature of one person lies elsewhere than on another's head.
_MISFIT = 0.015
# Sine of the turn away from the camera that is usual in photos: it decides where the pins lie along a line.
_USUAL_TURN = 0.5
# Share of the picture's height that the head takes before anything is known.
_FIRST_SHARE = 0.45


def first_camera(photo: Photo, model: FaceModel) -> Camera:
    """Return a camera for ``photo`` before it has pins: from the front, the whole head well inside."""
    character = model.character
    width, height = photo.size
    focal = photo.focal or focal_in_pixels(LIKELY_FOCAL_MM, photo.size)
    depth = focal * character.height / (_FIRST_SHARE * min(width, height))
    lower, upper = character.vertices.min(axis=0), character.vertices.max(axis=0)
    centre = np.array([(lower[0] + upper[0]) / 2.0, character.vertices[:, 1].max() - 0.5 * character.height, 0.0])
    rotation = np.diag([1.0, -1.0, -1.0])
    return Camera(rotation, np.array([0.0, 0.0, depth]) - rotation @ centre, focal, photo.size)


def pinned(photo: Photo, model: FaceModel) -> tuple[list[int], SurfacePoints]:
    """Return the indices of the pins whose places the face has, and these places."""
    found = [(i, anchor_of(pin.place, model.character)) for i, pin in enumerate(photo.pins)]
    met = [(i, cast("SurfacePoint | int", anchor)) for i, anchor in found if anchor is not None]
    return [i for i, _ in met], SurfacePoints.of([anchor for _, anchor in met])


def aligned(photo: Photo, model: FaceModel, p: ArrayLike) -> Photo:
    """Return ``photo`` with the camera that its pins ask for on the face ``p``, shape (r,).

    Pins that move with the expression count little as soon as the others suffice.
    """
    indices, points = pinned(photo, model)
    if not indices:
        return replace(photo, camera=first_camera(photo, model))
    start = photo.camera or first_camera(photo, model)
    likely = photo.focal or focal_in_pixels(LIKELY_FOCAL_MM, photo.size)
    # Every fit departs from the likely focal length, at which the head is as large as it was.
    start = replace(start, focal=likely, translation=start.translation * [1.0, 1.0, likely / start.focal])
    pixels = np.array([photo.pins[i].pixel for i in indices])
    places = model.positions_at(points, p)
    weights = np.array([rigidity(photo.pins[i].place, model) for i in indices])
    if (weights >= 0.25).sum() < 4:
        # Too few that keep still: then all must do.
        weights = np.maximum(weights, 0.5)
    spread = FOCAL_SPREAD if photo.focal is None else 0.0
    sigma = _MISFIT * model.character.height * _pixels_per_unit(places, pixels)
    fit = fit_camera(places, pixels, start, weights, spread, max(sigma, 1.0), _USUAL_TURN)
    return replace(photo, camera=fit.camera)


def _pixels_per_unit(places: Array, pixels: Array) -> float:
    """Return about how many pixels a unit of the mesh takes in the photo."""
    extent = float(np.ptp(places[:, :2], axis=0).max()) if len(places) > 1 else 0.0
    return float(np.ptp(pixels, axis=0).max()) / extent if extent > 0.0 else 1.0


def residuals_px(photo: Photo, model: FaceModel, p: ArrayLike) -> dict[int, float]:
    """Return how far the face ``p`` appears from each pin, in pixels of the photo, by the pin's index."""
    indices, points = pinned(photo, model)
    if photo.camera is None or not indices:
        return {}
    off = photo.camera.project(model.positions_at(points, p)) - [photo.pins[i].pixel for i in indices]
    return dict(zip(indices, np.hypot(*off.T).tolist(), strict=True))
