"""Terms of the fit of a head to photos: landmarks and priors. Costs are -ln p, up to constants."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from faceposer.identity.photos.face_places import LandmarkErrors
from faceposer.identity.photos.head_basis import ExpressionPrior, FacePoints
from faceposer.identity.photos.unknowns import FitState, NormalEquations, ViewState
from faceposer.landmarks.points import EYE_CORNERS, Landmarks
from faceposer.landmarks.reference import reference

Array = NDArray[np.float64]

#: Standard deviation of the middle of an iris in a photo, in centimetres of the face.
_PUPIL = 0.06
# Cosine between skin and view from which a landmark counts fully, and the least factor on its residual.
_FACING, _LEAST_TRUST = 0.4, 0.15
# Number of the mode of heads from which less than half of a greater likeness applies, as exponents.
_BROAD_MODES = 30.0
# Residuals in standard deviations from which a point counts less (Cauchy's function).
_DOUBTFUL = 4.0


def upright(found: Landmarks) -> Array:
    """Return the rotation, (2, 2), from a picture in which the eyes are level to that of the landmarks ``found``."""
    across = found.points[EYE_CORNERS[1][1], :2] - found.points[EYE_CORNERS[0][0], :2]
    angle = math.atan2(across[1], across[0])
    return np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])


@dataclass(frozen=True, eq=False)
class LandmarkTerm:
    """½ Σ_i c² ln(1 + e_i²/c²) with e_i the distance of a landmark from the face, less its errors, in deviations.

    Attributes:
        points: The 470 points of the face.
        pixels: Where the photo has them, shape (470, 2).
        mean: Mean of the errors in pixels, shape (470, 2).
        modes: Modes of the errors in pixels, shape (q, 470, 2).
        roots: 1 / the standard deviation in pixels, 0 for points that do not count, shape (470,).
    """

    points: FacePoints
    pixels: Array
    mean: Array
    modes: Array
    roots: Array

    @classmethod
    def of(
        cls, found: Landmarks, points: FacePoints, errors: LandmarkErrors, scale: float, rotation: Array | None = None
    ) -> "LandmarkTerm":
        """Return the term of the landmarks ``found`` in a photo.

        Args:
            found: The landmarks.
            points: The points of the face.
            errors: Errors of the landmarks.
            scale: Pixels per centimetre of the face.
            rotation: Rotation from face to camera, (3, 3), by which landmarks that face away count less; they are
                guesses. None if all count.
        """
        n = len(points.mean)
        turn = scale * upright(found)
        mean, modes = np.zeros((n, 2)), np.zeros((len(errors.modes), n, 2))
        mean[:-2], modes[:, :-2] = errors.mean @ turn.T, errors.modes @ turn.T
        deviations = np.concatenate([errors.deviations, [_PUPIL, _PUPIL]]) * scale
        pixels = np.concatenate([found.points[:, :2], found.iris[:, 0, :2]])
        roots = 1.0 / deviations
        if rotation is not None:
            facing = -reference().normals @ rotation[2]
            roots[:-2] *= np.clip(facing / _FACING, _LEAST_TRUST, 1.0)
        return cls(points, pixels, mean, modes, roots)

    def residual(self, state: FitState, view: ViewState) -> Array:
        """Return the residuals in deviations, shape (470, 2)."""
        found = view.camera.project(self.points.at(state.shape, view.pose))
        errors = self.mean + np.tensordot(view.errors, self.modes, 1)
        result: Array = (found + errors - self.pixels) * self.roots[:, None]
        return result

    def cost(self, state: FitState, view: ViewState) -> float:
        """Return the cost."""
        squares = np.square(self.residual(state, view)).sum(axis=1)
        return float(0.5 * _DOUBTFUL**2 * np.log1p(squares / _DOUBTFUL**2).sum())

    def derivatives(self, state: FitState, view: ViewState) -> Array:
        """Return the derivatives of `residual` by head, pose, camera and errors, shape (470, 2, n)."""
        local = view.camera.local(self.points.at(state.shape, view.pose))
        by_place, by_camera = view.camera.derivatives(local)
        by_point = by_place @ view.camera.rotation
        moves = np.concatenate([self.points.identity, self.points.expression])
        by_moves = np.einsum("nij,knj->nik", by_point, moves, optimize=True)
        rows = np.concatenate([by_moves, by_camera, self.modes.transpose(1, 2, 0)], axis=2)
        result: Array = rows * self.roots[:, None, None]
        return result

    def add(self, state: FitState, number: int, equations: NormalEquations) -> None:
        """Add the term of photo ``number`` to ``equations``."""
        view, at = state.views[number], equations.layout.view(number)
        residual = self.residual(state, view)
        weights = 1.0 / np.sqrt(1.0 + np.square(residual).sum(axis=1) / _DOUBTFUL**2)
        rows = self.derivatives(state, view) * weights[:, None, None]
        equations.add_rows(
            rows.reshape(-1, rows.shape[2]),
            (residual * weights[:, None]).ravel(),
            [equations.layout.shape, at.pose, at.camera, at.errors],
        )

    def misses(self, state: FitState, view: ViewState) -> Array:
        """Return the distances of the landmarks from the face in pixels, without errors of the networks, (470,)."""
        found = view.camera.project(self.points.at(state.shape, view.pose))
        return np.asarray(np.linalg.norm(found - self.pixels, axis=1))


@dataclass(frozen=True, eq=False)
class Priors:
    """The densities of heads, textures, poses, focal lengths and errors of landmarks.

    Attributes:
        expression: That of poses.
        log_focals: Expected logarithm of the focal length of each photo, and its standard deviation.
        strength: Weight of the density of heads and textures: below 1 for likeness, above 1 for likelihood.
        alike: Correlation of the expressions of two photos, from 0 up to less than 1. If photos were taken to be
            independent, a smile that all of them show would be likelier a property of the head, which counts once.
    """

    expression: ExpressionPrior
    log_focals: tuple[tuple[float, float], ...]
    strength: float = 1.0
    alike: float = 0.0

    def shape_weights(self, n: int) -> Array:
        """Return the weights of n coefficients of heads, the modes with the largest variance first.

        More likeness relaxes what a photo determines, the broad modes. Small ones would follow shadows, lamps that the
        fit does not have, and noise, in directions that the photo does not show. Likelihood holds all alike.
        """
        exponents = 1.0 / (1.0 + (np.arange(n) / _BROAD_MODES) ** 2) if self.strength < 1.0 else np.ones(n)
        weights: Array = self.strength**exponents
        return weights

    @property
    def texture_weight(self) -> float:
        """Weight of the coefficients of textures, to which more likeness does not leave more of the shading."""
        return max(self.strength, 1.0)

    def cost(self, state: FitState) -> float:
        """Return the cost."""
        total = 0.5 * float(self.shape_weights(len(state.shape)) @ np.square(state.shape))
        total += 0.5 * self.texture_weight * float(state.texture @ state.texture)
        poses = np.array([view.pose for view in state.views])
        total += 0.5 * float(np.vdot(self._between() @ poses, poses @ self.expression.precision))
        for view, (expected, spread) in zip(state.views, self.log_focals, strict=True):
            total += self.expression.bounds.evaluate(view.pose)[0] + 0.5 * float(view.errors @ view.errors)
            total += 0.5 * ((view.camera.log_focal - expected) / spread) ** 2
        return total

    def _between(self) -> Array:
        """Return the inverse of the correlation of expressions between photos, shape (n, n)."""
        n, rest = len(self.log_focals), 1.0 - self.alike
        result: Array = (np.eye(n) - self.alike / (rest + n * self.alike)) / rest
        return result

    def add(self, state: FitState, equations: NormalEquations) -> None:
        """Add the priors to ``equations``."""
        layout = equations.layout
        weights = self.shape_weights(len(state.shape))
        equations.add_block(layout.shape, weights * state.shape, np.diag(weights))
        equations.add_block(layout.texture, self.texture_weight * state.texture, self.texture_weight)
        places = [layout.view(number).pose for number in range(len(state.views))]
        pose = np.concatenate([view.pose for view in state.views])
        # Kronecker's product of the correlations between photos and within an expression.
        precision = np.asarray(np.kron(self._between(), self.expression.precision), dtype=np.float64)
        equations.add_products(precision, precision @ pose, places)
        for number, (view, (expected, spread)) in enumerate(zip(state.views, self.log_focals, strict=True)):
            at = layout.view(number)
            _, slope, _, curvature = self.expression.bounds.evaluate(view.pose)
            equations.add_block(at.pose, slope, curvature)
            equations.add_block(at.errors, view.errors, 1.0)
            focal = np.zeros(at.camera.stop - at.camera.start)
            focal[5:7] = 1.0 / spread
            equations.add_block(at.camera, focal * (view.camera.log_focal - expected) / spread, np.outer(focal, focal))
