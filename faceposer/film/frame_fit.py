"""The fit of one frame of a film: expression and place of a known head, from landmarks and colours.

The unknowns of a frame are x = (p, w, a, b, ln s): the pose p, the rotation exp(w) of the head from a reference R, its
place and its scale; see ``FaceCamera``. The focal length is known, so that ln d = ln f - ln s.
"""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from faceposer.film.person import Person
from faceposer.identity.photos.dense_term import DensePhoto
from faceposer.identity.photos.face_camera import N_CAMERA, FaceCamera, rotation_of
from faceposer.identity.photos.face_crop import FaceCrop
from faceposer.identity.photos.head_basis import ExpressionPrior
from faceposer.identity.photos.landmark_fit import PhotoFace
from faceposer.identity.photos.terms import LandmarkTerm
from faceposer.identity.photos.unknowns import FitState, Layout, NormalEquations, ViewState
from faceposer.landmarks.points import Landmarks

Array = NDArray[np.float64]

#: Number of unknowns of the place of the head.
N_PLACE = 6
_MOST_STEPS, _SLOW = 12, 1e-3
_FIRST_DAMPING, _LEAST_DAMPING, _MOST_DAMPING = 1e-3, 1e-6, 1e6
_NONE = np.zeros(0)


@dataclass(frozen=True, eq=False)
class Placing:
    """The unknowns of the place of a head, and the cameras that they stand for.

    Attributes:
        reference: R, shape (3, 3).
        camera: A camera with the focal length of the film, its principal point and size.
    """

    reference: Array
    camera: FaceCamera

    def camera_at(self, place: Array) -> FaceCamera:
        """Return the camera of ``place``, (w, a, b, ln s), shape (6,)."""
        rotation = rotation_of(place[:3]) @ self.reference
        a, b, scale = place[3:].tolist()
        return replace(
            self.camera, rotation=rotation, offset=(a, b), log_scale=scale, log_depth=self.camera.log_focal - scale
        )

    def place_of(self, camera: FaceCamera) -> Array:
        """Return the place of ``camera``, shape (6,)."""
        from scipy.spatial.transform import Rotation

        turn = Rotation.from_matrix(camera.rotation @ self.reference.T).as_rotvec()
        return np.array([*turn, *camera.offset, camera.log_scale])

    @staticmethod
    def chain(place: Array) -> Array:
        """Return the derivatives of the unknowns of `FaceCamera` by ``place``, shape (7, 6)."""
        result = np.zeros((N_CAMERA, N_PLACE))
        result[:3, :3] = _left_jacobian(place[:3])
        result[3:6, 3:6] = np.eye(3)
        result[6, 5] = -1.0
        return result


@dataclass(frozen=True, eq=False)
class FrameQuadratic:
    """The energy of a frame about a state x_0: c + g' (x - x_0) + (x - x_0)' H (x - x_0) / 2, and the exact prior.

    Attributes:
        at: x_0, shape (r + 6,).
        slope: g, shape (r + 6,).
        curvature_of_data: H, shape (r + 6, r + 6).
        prior: Density of the expressions, or None if it is contained in the quadratic.
    """

    at: Array
    slope: Array
    curvature_of_data: Array
    prior: ExpressionPrior | None

    def energy_and_gradient(self, p: Array) -> tuple[float, Array]:
        """Return the energy of the unknowns ``p``, (r + 6,), up to a constant, and its gradient."""
        change = p - self.at
        bent = self.curvature_of_data @ change
        energy, gradient = float(change @ (self.slope + 0.5 * bent)), self.slope + bent
        if self.prior is not None:
            pose = p[:-N_PLACE]
            gradient[:-N_PLACE] += self.prior.slope_and_curvature(pose)[0]
            energy += self.prior.cost(pose)
        return energy, gradient

    def curvature(self, p: Array) -> Array:
        """Return the second derivative at ``p``, shape (r + 6, r + 6)."""
        total = np.array(self.curvature_of_data, dtype=np.float64)
        if self.prior is not None:
            total[:-N_PLACE, :-N_PLACE] += self.prior.slope_and_curvature(p[:-N_PLACE])[1]
        total[np.diag_indices_from(total)] += 1e-9
        return total


class FrameFit:
    """The fit of a known head to one frame."""

    def __init__(self, person: Person, placing: Placing, face: Landmarks, start: Array) -> None:
        """Prepare the fit of ``face`` from the unknowns ``start``, (r + 6,)."""
        self._person, self._placing = person, placing
        camera = placing.camera_at(start[-N_PLACE:])
        self._term = LandmarkTerm.of(face, person.points, person.errors, math.exp(camera.log_scale), camera.rotation)
        self._face, self.unknowns = face, start

    def misses(self) -> Array:
        """Return the distances of the landmarks from the face in pixels, shape (470,)."""
        state = self._state(self.unknowns)
        return self._term.misses(state, state.views[0])

    def settle(self) -> None:
        """Move the unknowns to the most likely ones, by the landmarks, with Levenberg and Marquardt's steps."""
        cost, damping = self._cost(self.unknowns), _FIRST_DAMPING
        for _ in range(_MOST_STEPS):
            slope, curvature = self._with_prior(*self._landmarks(self.unknowns))
            before = cost
            while damping <= _MOST_DAMPING:
                tried = self.unknowns + _step(slope, curvature, damping)
                value = self._cost(tried)
                if value < cost:
                    self.unknowns, cost, damping = tried, value, max(0.1 * damping, _LEAST_DAMPING)
                    break
                damping *= 10.0
            if before - cost <= _SLOW * (1.0 + abs(cost)):
                break

    def refine(self, pixels: NDArray[np.uint8], settings: "ColourSettings", rng: np.random.Generator) -> FrameQuadratic:
        """Move the unknowns by the colours of the frame ``pixels``, too, and return the energy about them."""
        skin = self._person.skin
        assert skin is not None
        camera = self._placing.camera
        photo = PhotoFace(self._face, camera.size, math.exp(camera.log_focal), 1.0)
        crop = FaceCrop.of(photo, pixels, settings.height)
        image = ndimage.gaussian_filter(crop.image, (settings.blur, settings.blur, 0.0))
        dense = DensePhoto(image, skin, settings.weight, settings.n_samples)
        # Those that face the camera are drawn; what hides others, such as the nose, is small.
        seen = np.arange(len(skin.faces))
        slope, curvature = np.zeros(0), np.zeros((0, 0))
        for step in range(settings.steps + 1):
            landmarks = self._landmarks(self.unknowns)
            state = self._state(self.unknowns, crop)
            chosen = dense.chosen(state, 0, seen, rng)
            colours = NormalEquations(Layout.of(state))
            if len(chosen):
                dense.add(state, 0, chosen, colours)
            slope, curvature = self._chained(colours)
            slope, curvature = slope + landmarks[0], curvature + landmarks[1]
            if step < settings.steps:
                self.unknowns = self.unknowns + _step(*self._with_prior(slope, curvature), settings.damping)
        return FrameQuadratic(self.unknowns, slope, curvature, self._person.prior)

    def quadratic(self, at: Array) -> FrameQuadratic:
        """Return the energy of the landmarks about the unknowns ``at``."""
        return FrameQuadratic(at, *self._landmarks(at), self._person.prior)

    def _landmarks(self, unknowns: Array) -> tuple[Array, Array]:
        """Return slope and curvature of the landmarks by the unknowns."""
        state = self._state(unknowns)
        equations = NormalEquations(Layout.of(state))
        self._term.add(state, 0, equations)
        return self._chained(equations, unknowns)

    def _chained(self, equations: NormalEquations, unknowns: Array | None = None) -> tuple[Array, Array]:
        """Return slope and curvature by the unknowns of a frame from those by pose and camera."""
        unknowns = self.unknowns if unknowns is None else unknowns
        r = len(unknowns) - N_PLACE
        chain = np.zeros((r + N_CAMERA, r + N_PLACE))
        chain[:r, :r] = np.eye(r)
        chain[r:, r:] = self._placing.chain(unknowns[-N_PLACE:])
        return chain.T @ equations.slope, chain.T @ equations.matrix @ chain

    def _with_prior(self, slope: Array, curvature: Array) -> tuple[Array, Array]:
        own_slope, own = self._person.prior.slope_and_curvature(self.unknowns[:-N_PLACE])
        slope, curvature = slope.copy(), curvature.copy()
        slope[:-N_PLACE] += own_slope
        curvature[:-N_PLACE, :-N_PLACE] += own
        return slope, curvature

    def _cost(self, unknowns: Array) -> float:
        state = self._state(unknowns)
        return self._term.cost(state, state.views[0]) + self._person.prior.cost(unknowns[:-N_PLACE])

    def _state(self, unknowns: Array, crop: FaceCrop | None = None) -> FitState:
        camera = self._placing.camera_at(unknowns[-N_PLACE:])
        if crop is not None:
            height, width = crop.image.shape[:2]
            camera = camera.scaled(crop.factor, crop.corner, (width, height))
        return FitState(_NONE, _NONE, (ViewState(unknowns[:-N_PLACE], camera, _NONE),))


@dataclass(frozen=True)
class ColourSettings:
    """Settings of the refinement of a frame by its colours.

    Attributes:
        height: Height of the face, in pixels, at which colours are compared.
        blur: Blur in pixels.
        steps: Number of steps.
        weight: Weight of the colours of a sample relative to an independent one.
        n_samples: Number of samples.
        damping: Enlargement of the diagonal of the curvature.
    """

    height: float = 200.0
    blur: float = 1.0
    steps: int = 4
    weight: float = 0.3
    n_samples: int = 1500
    damping: float = 0.01


def _step(slope: Array, curvature: Array, damping: float) -> Array:
    damped = curvature + np.diag(damping * np.diag(curvature) + 1e-9)
    return np.asarray(-np.linalg.solve(damped, slope), dtype=np.float64)


def _left_jacobian(vector: Array) -> Array:
    """Return the matrix that maps a change of a rotation vector to the small rotation, applied after, that it makes."""
    angle = float(np.linalg.norm(vector))
    x, y, z = vector
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    one, two = 0.5, 1.0 / 6.0
    if angle > 1e-4:
        one, two = (1.0 - math.cos(angle)) / angle**2, (angle - math.sin(angle)) / angle**3
    result: Array = np.eye(3) + one * cross + two * cross @ cross
    return result
