"""The term of a photo's pixels: colours of random triangles of the face, with derivatives by all unknowns.

At the middle x of a triangle with the unit normal n, in camera axes, the face has the colour c(a, n, x) of `SkinLight`
with the albedo a = exp(ā + T t); the photo has the colour I(u(x)). As the unknowns change, the middle moves in the
photo and the normal turns in the light. The light follows, and is eliminated from the equations of a step (Schur's
complement). Blanz and Vetter (1999), section 4, descend stochastically, too.
"""

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from faceposer.identity.photos.face_camera import turning
from faceposer.identity.photos.harmonics import fitted_light
from faceposer.identity.photos.skin_light import FIRST_LAMPS, LitSkin, SkinLight, prior_of
from faceposer.identity.photos.skin_samples import SkinSamples
from faceposer.identity.photos.unknowns import FitState, NormalEquations
from faceposer.landmarks.drawing import visible_triangles

Array = NDArray[np.float64]

# Limits of the standard deviation of a colour, which is that found, and the number of them from which a sample counts
# less. The noise falls as the fit proceeds; hair, glasses and wrinkles leave more of it than bare skin.
_SIGMAS, _DOUBTFUL = (0.01, 0.1), 3.0
#: Noise from which what differs is not noise but hair, wrinkles and light that the model does not have, whose colours
#: belong together.
USUAL_NOISE = 0.012
# Number of steps towards the best light, the first time and later.
_FIRST_LIGHT_STEPS, _LIGHT_STEPS = 8, 2
# Least cosine between a triangle and the view at which it is compared.
_FACING = 0.25
# Number of triangles, in those compared, from which these are drawn.
_POOL = 2


@dataclass(eq=False)
class DensePhoto:
    """A photo in which colours are compared.

    Attributes:
        image: Colours, 0 to 1, blurred, shape (h, w, 3).
        skin: Triangles of the face.
        occluders: Triangles of the whole skin that may hide them, vertex ids, shape (T', 3).
        weight: Weight of a sample relative to an independent one, up to a noise of `USUAL_NOISE`.
        n_samples: Number of samples.
        light: The light found last.
        noise: Standard deviation of colours found last, by which the photo is trusted.
    """

    image: Array
    skin: SkinSamples
    weight: float
    n_samples: int
    slopes: tuple[Array, Array] = field(init=False)
    light: SkinLight | None = None
    noise: float = 0.04

    def __post_init__(self) -> None:
        self.slopes = (np.asarray(np.gradient(self.image, axis=1)), np.asarray(np.gradient(self.image, axis=0)))

    @property
    def sigma(self) -> float:
        """Standard deviation of a colour."""
        return float(np.clip(self.noise, *_SIGMAS))

    @property
    def effective_weight(self) -> float:
        """Weight of a sample relative to an independent one."""
        return self.weight * float(min(1.0, USUAL_NOISE / self.sigma))

    def visible(self, state: FitState, number: int, rest: Array, triangles: NDArray[np.integer]) -> NDArray[np.int64]:
        """Return the samples that the camera sees.

        Args:
            state: The fit.
            number: Number of the photo.
            rest: Vertices of the whole skin with head and pose, shape (N, 3).
            triangles: All its triangles, shape (T', 3).
        """
        camera = state.views[number].camera
        local = camera.local(rest)
        depth = local[:, 2] + np.exp(camera.log_depth)
        height, width = self.image.shape[:2]
        pixels = camera.pixels(local)
        first, second, third = (pixels[triangles[:, corner]] for corner in range(3))
        turn = (second[:, 0] - first[:, 0]) * (third[:, 1] - first[:, 1])
        turn -= (second[:, 1] - first[:, 1]) * (third[:, 0] - first[:, 0])
        # Behind a triangle that faces away there is nothing on a closed surface that faces the camera.
        facing = np.flatnonzero(turn < 0.0)
        faces, _ = visible_triangles(pixels, depth, triangles[facing], (width, height))
        seen = np.zeros(len(triangles), dtype=bool)
        seen[facing[faces[faces >= 0]]] = True
        return np.flatnonzero(seen[self.skin.faces])

    def chosen(
        self, state: FitState, number: int, seen: NDArray[np.int64], rng: np.random.Generator
    ) -> NDArray[np.int64]:
        """Return random samples of those ``seen``, by their areas in the picture."""
        if len(seen) > _POOL * self.n_samples:
            seen = rng.choice(seen, _POOL * self.n_samples, replace=False)
        corners = self._corners(state, number, seen)
        cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        area = np.linalg.norm(cross, axis=1)
        cosine = self._facing(state, number, corners, cross / np.maximum(area, 1e-12)[:, None])
        usable = np.flatnonzero(cosine > _FACING)
        shares = area[usable] * cosine[usable]
        if not usable.size:
            return seen[:0]
        return seen[rng.choice(usable, min(self.n_samples, len(usable)), replace=False, p=shares / shares.sum())]

    def _facing(self, state: FitState, number: int, corners: Array, normals: Array) -> Array:
        camera = state.views[number].camera
        middles = corners.mean(axis=1) + (*camera.offset, np.exp(camera.log_depth))
        result: Array = -(normals * middles).sum(axis=1) / np.linalg.norm(middles, axis=1)
        return result

    def _corners(self, state: FitState, number: int, samples: NDArray[np.int64]) -> Array:
        """Return the corners of ``samples`` in the axes of the camera about the middle of the face, shape (n, 3, 3)."""
        view = state.views[number]
        local = view.camera.local(self.skin.places(state.shape, view.pose))
        result: Array = local[self.skin.triangles[samples]]
        return result

    def residual(
        self, state: FitState, number: int, samples: NDArray[np.int64], light: SkinLight | None = None
    ) -> "DenseResidual":
        """Return the differences of ``samples`` between the photo and the face, under ``light`` or that found last."""
        camera = state.views[number].camera
        corners = self._corners(state, number, samples)
        cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        length = np.maximum(np.linalg.norm(cross, axis=1), 1e-12)
        normals = cross / length[:, None]
        middles = corners.mean(axis=1)
        pixels = camera.pixels(middles)
        before = middles + (*camera.offset, np.exp(camera.log_depth))
        colours = self._looked_up(self.image, pixels)
        albedo = np.exp(self.skin.colour[samples] + np.tensordot(state.texture, self.skin.colours[:, samples], 1))
        if light is None:
            light = self.light or SkinLight.first(fitted_light(colours, albedo, normals, np.ones(len(samples))))
        lit = light.lit(albedo, normals, before)
        return DenseResidual(samples, corners, length, pixels, albedo, before, colours, lit, colours - lit.colours)

    @staticmethod
    def _looked_up(image: Array, pixels: Array) -> Array:
        at = pixels[:, ::-1].T - 0.5
        return np.stack([ndimage.map_coordinates(image[..., k], at, order=1, mode="nearest") for k in range(3)], axis=1)

    def derivatives(self, state: FitState, number: int, found: "DenseResidual") -> Array:
        """Return the derivatives of the residual by head, texture, pose and camera, the light fixed, (n, 3, k)."""
        camera, samples, lit = state.views[number].camera, found.samples, found.lit
        slopes = np.stack([self._looked_up(slope, found.pixels) for slope in self.slopes], axis=2)
        by_place, by_camera = camera.derivatives(found.corners.mean(axis=1))
        by_view = -lit.by_middle()
        by_middle = slopes @ by_place + by_view
        by_normal = -lit.by_normal()
        # The unit normal turns by (I - n n') dc / |c| as the cross product c of the edges changes.
        inner = np.einsum("scj,sj->sc", by_normal, lit.normals)
        by_cross = (by_normal - inner[..., None] * lit.normals[:, None]) / found.length[:, None, None]
        first = (found.corners[:, 1] - found.corners[:, 0])[:, None]
        second = (found.corners[:, 2] - found.corners[:, 0])[:, None]
        by_first, by_second = np.cross(second, by_cross), np.cross(by_cross, first)
        third = by_middle / 3.0
        by_corner = np.stack([third - by_first - by_second, third + by_first, third + by_second], axis=2)
        by_corner = by_corner @ camera.rotation
        rows = self.skin.rows[self.skin.triangles[samples]].reshape(len(samples), 9, -1)
        by_modes = by_corner.reshape(len(samples), 3, 9) @ rows
        n_shape = len(state.shape)
        by_texture = -(self.skin.colours[:, samples].transpose(1, 2, 0) * lit.by_log_albedo[..., None])
        by_camera = slopes @ by_camera
        by_camera[:, :, :3] += by_normal @ turning(lit.normals) + by_view @ turning(found.corners.mean(axis=1))
        by_camera[:, :, 3:5] += by_view[:, :, :2]
        by_camera[:, :, 6] += by_view[:, :, 2] * np.exp(camera.log_depth)
        return np.concatenate([by_modes[:, :, :n_shape], by_texture, by_modes[:, :, n_shape:], by_camera], axis=2)

    def lit(self, state: FitState, number: int, samples: NDArray[np.int64]) -> "DenseResidual":
        """Return the differences of ``samples`` after steps towards the best light; light and noise are kept."""
        found = self.residual(state, number, samples)
        self.noise = found.noise()
        if self.light is None:
            starts = [found.lit.light, *(found.lit.light.from_direction(way) for way in FIRST_LAMPS)]
            tried = [self._relit(found.under(light), _FIRST_LIGHT_STEPS) for light in starts]
            found = min(tried, key=self._light_cost)
        found = self._relit(found, _LIGHT_STEPS)
        self.light, self.noise = found.lit.light, found.noise()
        return found

    def _relit(self, found: "DenseResidual", steps: int) -> "DenseResidual":
        """Return ``found`` under a better light, by Levenberg and Marquardt's steps."""
        cost, damping = self._light_cost(found), 1e-3
        for _ in range(steps):
            matrix, slope = self._light_equations(found)
            while damping < 1e6:
                damped = matrix + np.diag(damping * np.diag(matrix))
                step = -np.linalg.solve(damped, slope).astype(np.float64)
                tried = found.under(found.lit.light.moved(step))
                value = self._light_cost(tried)
                if value < cost:
                    found, cost, damping = tried, value, max(damping * 0.1, 1e-6)
                    break
                damping *= 10.0
            else:
                break
        return found

    def _light_cost(self, found: "DenseResidual") -> float:
        return self._cost(found) + 0.5 * float(np.square(found.light_prior()[0]).sum())

    def _light_equations(self, found: "DenseResidual") -> tuple[Array, Array]:
        """Return curvature and slope by the light, shapes (34, 34) and (34,)."""
        scale = self._scale(found)
        rows = (found.lit.by_light() * -scale[:, None, None]).reshape(len(scale) * 3, -1)
        prior, prior_rows = found.light_prior()
        matrix = rows.T @ rows + prior_rows.T @ prior_rows + 1e-6 * np.eye(rows.shape[1])
        return matrix, rows.T @ (found.values * scale[:, None]).ravel() + prior_rows.T @ prior

    def _scale(self, found: "DenseResidual") -> Array:
        """Return the square roots of the weights of samples, shape (n,)."""
        result: Array = (
            found.trust(_DOUBTFUL * self.sigma)
            * np.sqrt(self.effective_weight * self.n_samples / max(len(found.samples), 1))
            / self.sigma
        )
        return result

    def add(self, state: FitState, number: int, samples: NDArray[np.int64], equations: NormalEquations) -> None:
        """Add the term at ``samples`` to ``equations``, the best light following what changes."""
        found = self.lit(state, number, samples)
        scale = self._scale(found)
        rows = (self.derivatives(state, number, found) * scale[:, None, None]).reshape(len(scale) * 3, -1)
        values = (found.values * scale[:, None]).ravel()
        at = equations.layout.view(number)
        where = [equations.layout.shape, equations.layout.texture, at.pose, at.camera]
        equations.add_rows(rows, values, where)
        # Schur's complement of the light.
        by_light = (found.lit.by_light() * -scale[:, None, None]).reshape(len(scale) * 3, -1)
        matrix, slope = self._light_equations(found)
        mixed = by_light.T @ rows
        solved = np.linalg.solve(matrix, np.column_stack([mixed, slope]))
        equations.add_products(-mixed.T @ solved[:, :-1], -mixed.T @ solved[:, -1], where)

    def cost(self, state: FitState, number: int, samples: NDArray[np.int64]) -> float:
        """Return the cost at ``samples`` under the best light, with the noise found last: a robust sum of squares."""
        found = self._relit(self.residual(state, number, samples), _FIRST_LIGHT_STEPS)
        self.light = found.lit.light
        return self._light_cost(found)

    def _cost(self, found: "DenseResidual") -> float:
        limit = _DOUBTFUL * self.sigma
        squares = np.square(found.values).sum(axis=1) / limit**2
        robust = 0.5 * _DOUBTFUL**2 * squares / (1.0 + squares)
        return float(self.effective_weight * self.n_samples * robust.mean())


@dataclass(frozen=True, eq=False)
class DenseResidual:
    """Differences between photo and face at samples, and what they were computed from.

    Attributes:
        samples: Triangles, shape (n,).
        corners: Their corners in camera axes, shape (n, 3, 3).
        length: Twice their areas, shape (n,).
        pixels: Where their middles are in the photo, shape (n, 2).
        albedo: Colours under white light, shape (n, 3).
        before: Their middles in front of the camera, shape (n, 3).
        colours: Colours in the photo, shape (n, 3).
        lit: Their colours in the light.
        values: Photo minus face, shape (n, 3).
    """

    samples: NDArray[np.int64]
    corners: Array
    length: Array
    pixels: Array
    albedo: Array
    before: Array
    colours: Array
    lit: LitSkin
    values: Array

    def under(self, light: SkinLight) -> "DenseResidual":
        """Return the differences under another ``light``."""
        lit = light.lit(self.albedo, self.lit.normals, self.before)
        return replace(self, lit=lit, values=self.colours - lit.colours)

    def trust(self, limit: float) -> Array:
        """Return the square roots of the robust weights of Geman and McClure's function, shape (n,)."""
        result: Array = 1.0 / (1.0 + np.square(self.values).sum(axis=1) / limit**2)
        return result

    def harmonic_light(self) -> Array:
        """Return the light as harmonics for the colours of displays, (9, 3)."""
        return fitted_light(self.colours, self.albedo, self.lit.normals, np.ones(len(self.samples)))

    def light_prior(self) -> tuple[Array, Array]:
        """Return the residuals of the prior of the light, and their derivatives."""
        direct = np.maximum(self.lit.normals @ self.lit.light.towards, 0.0)
        return prior_of(self.lit.light, np.append(self.lit.basis.mean(axis=0), direct.mean()))

    def noise(self) -> float:
        """Return a robust standard deviation of the colours of a channel."""
        return 1.48 * float(np.median(np.abs(self.values)))

    def size(self) -> float:
        """Return the median difference of colours, 0 to 1."""
        return float(np.median(np.abs(self.values).mean(axis=1)))
