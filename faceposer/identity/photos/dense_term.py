"""The term of a photo's pixels: colours of random triangles of the face, with derivatives by all unknowns.

At the middle x of a triangle with the unit normal n, in camera axes, the face has the colour a ∘ (L' h(n)), with the
albedo a = exp(ā + T t), the light L and the harmonics h; the photo has the colour I(u(x)). As the unknowns change, the
middle moves in the photo and the normal turns in the light. Blanz and Vetter (1999), section 4, descend
stochastically, too; theirs is Phong's light.
"""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from faceposer.identity.photos.face_camera import turning
from faceposer.identity.photos.harmonics import fitted_light, harmonic_slopes, harmonics
from faceposer.identity.photos.skin_samples import SkinSamples
from faceposer.identity.photos.unknowns import FitState, NormalEquations
from faceposer.landmarks.drawing import visible_triangles

Array = NDArray[np.float64]

#: Standard deviation of a colour, 0 to 1, and the number of them from which a sample counts less.
SIGMA, _DOUBTFUL = 0.04, 3.0
#: Usual median difference of colours, and limits of the factor on the weight of other photos. The noise falls
#: as the fit proceeds; hair, glasses and wrinkles leave more of it than bare skin.
NOISE, _FACTORS = 0.02, (0.1, 3.0)
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
        weight: Weight of a sample relative to an independent one, at a noise of `NOISE`.
        n_samples: Number of samples.
        light: The light found last, shape (9, 3).
        noise: Median difference of colours found last, by which the photo is trusted.
    """

    image: Array
    skin: SkinSamples
    weight: float
    n_samples: int
    slopes: tuple[Array, Array] = field(init=False)
    light: Array = field(init=False)
    noise: float = NOISE

    def __post_init__(self) -> None:
        self.slopes = (np.asarray(np.gradient(self.image, axis=1)), np.asarray(np.gradient(self.image, axis=0)))
        self.light = np.zeros((9, 3))

    @property
    def effective_weight(self) -> float:
        """Weight of a sample relative to an independent one."""
        return self.weight * float(np.clip((NOISE / max(self.noise, 1e-6)) ** 2, *_FACTORS))

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
        faces, _ = visible_triangles(camera.pixels(local), depth, triangles, (width, height))
        seen = np.zeros(len(triangles), dtype=bool)
        seen[faces[faces >= 0]] = True
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
        self, state: FitState, number: int, samples: NDArray[np.int64], light: Array | None = None
    ) -> "DenseResidual":
        """Return the differences of ``samples`` between the photo and the face, under ``light`` or the best one."""
        corners = self._corners(state, number, samples)
        cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        length = np.maximum(np.linalg.norm(cross, axis=1), 1e-12)
        normals = cross / length[:, None]
        pixels = state.views[number].camera.pixels(corners.mean(axis=1))
        colours = self._looked_up(self.image, pixels)
        albedo = np.exp(self.skin.colour[samples] + np.tensordot(state.texture, self.skin.colours[:, samples], 1))
        if light is None:
            light = fitted_light(colours, albedo, normals, np.ones(len(samples)))
        shade = harmonics(normals) @ light
        return DenseResidual(samples, corners, length, normals, pixels, albedo, shade, light, colours - albedo * shade)

    @staticmethod
    def _looked_up(image: Array, pixels: Array) -> Array:
        at = pixels[:, ::-1].T - 0.5
        return np.stack([ndimage.map_coordinates(image[..., k], at, order=1, mode="nearest") for k in range(3)], axis=1)

    def derivatives(self, state: FitState, number: int, found: "DenseResidual") -> Array:
        """Return the derivatives of the residual by head, texture, pose and camera, the light fixed, (n, 3, k)."""
        camera, samples = state.views[number].camera, found.samples
        slopes = np.stack([self._looked_up(slope, found.pixels) for slope in self.slopes], axis=2)
        by_place, by_camera = camera.derivatives(found.corners.mean(axis=1))
        by_middle = slopes @ by_place
        by_normal = -np.einsum("skj,kc->scj", harmonic_slopes(found.normals), found.light) * found.albedo[..., None]
        # The unit normal turns by (I - n n') dc / |c| as the cross product c of the edges changes.
        inner = np.einsum("scj,sj->sc", by_normal, found.normals)
        by_cross = (by_normal - inner[..., None] * found.normals[:, None]) / found.length[:, None, None]
        first = (found.corners[:, 1] - found.corners[:, 0])[:, None]
        second = (found.corners[:, 2] - found.corners[:, 0])[:, None]
        by_first, by_second = np.cross(second, by_cross), np.cross(by_cross, first)
        third = by_middle / 3.0
        by_corner = np.stack([third - by_first - by_second, third + by_first, third + by_second], axis=2)
        by_corner = by_corner @ camera.rotation
        rows = self.skin.rows[self.skin.triangles[samples]].reshape(len(samples), 9, -1)
        by_modes = by_corner.reshape(len(samples), 3, 9) @ rows
        n_shape = len(state.shape)
        by_texture = -(self.skin.colours[:, samples].transpose(1, 2, 0) * (found.albedo * found.shade)[..., None])
        by_camera = slopes @ by_camera
        by_camera[:, :, :3] += by_normal @ turning(found.normals)
        return np.concatenate([by_modes[:, :, :n_shape], by_texture, by_modes[:, :, n_shape:], by_camera], axis=2)

    def add(self, state: FitState, number: int, samples: NDArray[np.int64], equations: NormalEquations) -> float:
        """Add the term at ``samples`` to ``equations``, and return the median difference of colours."""
        found = self.residual(state, number, samples)
        self.light, self.noise = found.light, found.size()
        trust = found.trust()
        scale = np.sqrt(self.effective_weight * self.n_samples / max(len(samples), 1)) / SIGMA
        rows = self.derivatives(state, number, found) * (scale * trust)[:, None, None]
        at = equations.layout.view(number)
        residual = found.values * (scale * trust)[:, None]
        where = [equations.layout.shape, equations.layout.texture, at.pose, at.camera]
        equations.add_rows(rows.reshape(-1, rows.shape[2]), residual.ravel(), where)
        return found.size()

    def cost(self, state: FitState, number: int, samples: NDArray[np.int64]) -> float:
        """Return the cost at ``samples`` under the best light: a robust sum of squares."""
        found = self.residual(state, number, samples)
        squares = (np.abs(found.values).max(axis=1) / (_DOUBTFUL * SIGMA)) ** 2
        robust = 0.5 * _DOUBTFUL**2 * squares / (1.0 + squares)
        return float(self.effective_weight * self.n_samples * 3.0 * robust.mean())


@dataclass(frozen=True, eq=False)
class DenseResidual:
    """Differences between photo and face at samples, and what they were computed from.

    Attributes:
        samples: Triangles, shape (n,).
        corners: Their corners in camera axes, shape (n, 3, 3).
        length: Twice their areas, shape (n,).
        normals: Unit normals in camera axes, shape (n, 3).
        pixels: Where their middles are in the photo, shape (n, 2).
        albedo: Colours under white light, shape (n, 3).
        shade: Light on them, shape (n, 3).
        light: Coefficients of the light, shape (9, 3).
        values: Photo minus face, shape (n, 3).
    """

    samples: NDArray[np.int64]
    corners: Array
    length: Array
    normals: Array
    pixels: Array
    albedo: Array
    shade: Array
    light: Array
    values: Array

    def trust(self) -> Array:
        """Return the square roots of the robust weights of Geman and McClure's function, shape (n,)."""
        largest = np.abs(self.values).max(axis=1) / (_DOUBTFUL * SIGMA)
        result: Array = 1.0 / (1.0 + largest**2)
        return result

    def size(self) -> float:
        """Return the median difference of colours, 0 to 1."""
        return float(np.median(np.abs(self.values).mean(axis=1)))
