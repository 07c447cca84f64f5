"""Heads, expressions and cameras from landmarks, by Gauss-Newton steps to the maximum a posteriori.

This is the first stage of the fit of V. Blanz and T. Vetter, "A morphable model for the synthesis of 3D faces"
(SIGGRAPH 1999), section 4, in which a user gives the pose of the head.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from faceposer.geometry.camera import Camera
from faceposer.identity.photos.face_camera import FaceCamera
from faceposer.identity.photos.face_places import OVAL, FacePlaces
from faceposer.identity.photos.head_basis import ExpressionPrior, FacePoints, HeadBasis
from faceposer.identity.photos.terms import LandmarkTerm, Priors
from faceposer.identity.photos.unknowns import FitState, Layout, NormalEquations, ViewState
from faceposer.landmarks.points import Landmarks
from faceposer.progress import Progress
from faceposer.solve.camera_fit import fit_camera

Array = NDArray[np.float64]

#: Number of texture coefficients before a texture is fitted.
_NO_TEXTURE = np.zeros(0)
_MOST_STEPS, _SLOW = 20, 1e-4
_FIRST_DAMPING, _LEAST_DAMPING, _MOST_DAMPING = 1e-3, 1e-6, 1e6
# Standard deviation of a landmark about the average face, as a share of the distance between the eyes.
_UNKNOWN_FACE = 0.08
# Spread of the sine of the angle between face and camera.
_USUAL_TURN = 0.6


@dataclass(frozen=True, eq=False)
class PhotoFace:
    """A face in a photo.

    Attributes:
        landmarks: Its landmarks.
        size: Width and height of the photo in pixels.
        focal: Expected focal length in pixels.
        focal_spread: Standard deviation of its logarithm.
        principal: Pixel on the optical axis; the middle of the photo if None.
    """

    landmarks: Landmarks
    size: tuple[int, int]
    focal: float
    focal_spread: float
    principal: tuple[float, float] | None = None

    @property
    def centre(self) -> tuple[float, float]:
        """The pixel on the optical axis."""
        return self.principal or (self.size[0] / 2.0, self.size[1] / 2.0)


@dataclass(frozen=True, eq=False)
class LandmarkFit:
    """A head in photos, from landmarks.

    Attributes:
        state: Head, poses and cameras.
        terms: The landmarks of each photo.
        priors: The priors.
        cost: -ln p up to a constant.
    """

    state: FitState
    terms: tuple[LandmarkTerm, ...]
    priors: Priors
    cost: float

    def landmark_px(self, number: int) -> float:
        """Return the mean distance of the landmarks of photo ``number`` from the face, without the oval, in pixels."""
        misses = self.terms[number].misses(self.state, self.state.views[number])
        return float(np.delete(misses, OVAL).mean())


def fit_landmarks(
    faces: Sequence[PhotoFace],
    basis: HeadBasis,
    places: FacePlaces,
    strength: float = 1.0,
    progress: Progress | None = None,
    alike: float = 0.0,
) -> LandmarkFit:
    """Return the head that the ``faces`` of one person show, with the pose and the camera of each photo.

    Args:
        faces: One face for each photo.
        basis: The linear model of heads.
        places: Places of the landmarks.
        strength: Weight of the density of heads.
        progress: Progress to update.
        alike: Correlation of the expressions of two photos.
    """
    return fit_points(faces, basis.landmarks(places), basis.prior, places, strength, progress, alike)


def fit_points(
    faces: Sequence[PhotoFace],
    points: FacePoints,
    prior: ExpressionPrior,
    places: FacePlaces,
    strength: float = 1.0,
    progress: Progress | None = None,
    alike: float = 0.0,
) -> LandmarkFit:
    """Return the fit of ``points`` of heads; other arguments as for `fit_landmarks`."""
    views = tuple(
        ViewState(np.zeros(len(points.expression)), first_camera(face, points.mean), np.zeros(len(places.errors.modes)))
        for face in faces
    )
    state = FitState(np.zeros(len(points.identity)), _NO_TEXTURE, views)
    terms = tuple(
        LandmarkTerm.of(face.landmarks, points, places.errors, math.exp(view.camera.log_scale), view.camera.rotation)
        for face, view in zip(faces, views, strict=True)
    )
    priors = Priors(prior, tuple((math.log(face.focal), face.focal_spread) for face in faces), strength, alike)
    return minimised(state, terms, priors, progress)


def minimised(
    state: FitState, terms: tuple[LandmarkTerm, ...], priors: Priors, progress: Progress | None = None
) -> LandmarkFit:
    """Return the minimum of the sum of ``terms`` and ``priors`` near ``state``, by Levenberg and Marquardt's steps."""
    progress = progress or Progress()
    cost, damping = _cost(state, terms, priors), _FIRST_DAMPING
    for number in range(_MOST_STEPS):
        progress.at("Fitting the head to landmarks", number / _MOST_STEPS)
        equations = NormalEquations(Layout.of(state))
        for view, term in enumerate(terms):
            term.add(state, view, equations)
        priors.add(state, equations)
        before = cost
        while damping <= _MOST_DAMPING:
            tried = state.moved(equations.layout, equations.step(damping))
            value = _cost(tried, terms, priors)
            if value < cost:
                state, cost, damping = tried, value, max(damping * 0.1, _LEAST_DAMPING)
                break
            damping *= 10.0
        if before - cost <= _SLOW * (1.0 + abs(cost)):
            break
    return LandmarkFit(state, terms, priors, cost)


def first_camera(face: PhotoFace, mean: Array) -> FaceCamera:
    """Return the camera of ``face`` if it were the average one with landmarks ``mean``, shape (470, 3)."""
    rigid = np.setdiff1d(np.arange(len(mean) - 2), OVAL)
    pixels = face.landmarks.points[rigid, :2]
    extent = float(np.ptp(pixels, axis=0).max())
    middle = mean[rigid].mean(axis=0)
    facing = np.diag([1.0, -1.0, -1.0])
    depth = face.focal * float(np.ptp(mean[rigid], axis=0).max()) / max(extent, 1.0)
    shift = (face.centre[0] - face.size[0] / 2.0, face.centre[1] - face.size[1] / 2.0)
    start = Camera(facing, np.array([0.0, 0.0, depth]) - facing @ middle, face.focal, face.size, shift)
    sigma = _UNKNOWN_FACE * 0.5 * extent
    fit = fit_camera(mean[rigid], pixels, start, None, 0.5 * face.focal_spread, max(sigma, 1.0), _USUAL_TURN)
    return FaceCamera.of(fit.camera, middle)


def _cost(state: FitState, terms: tuple[LandmarkTerm, ...], priors: Priors) -> float:
    return priors.cost(state) + sum(term.cost(state, view) for term, view in zip(terms, state.views, strict=True))
