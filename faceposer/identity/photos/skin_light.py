"""Light on skin in linear colours: harmonics for what is around, and a lamp with Phong's highlight.

A surface with the albedo a (of a display), the unit normal n and the unit vector v towards the camera has the colour

    c = (a^s E + g)^(1/s),    E = L' h(n) + d max(n·l, 0),    g = k max(r·v, 0)^m,    r = 2 (n·l) n - l,

the ambient and the directed light of V. Blanz and T. Vetter, "A morphable model for the synthesis of 3D faces"
(SIGGRAPH 1999), section 4, where L is one colour; here it may come from all sides, as harmonics of degree 2.
The exponent s of displays is 2.2.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from faceposer.identity.photos.harmonics import N_LIGHT, harmonic_slopes, harmonics

Array = NDArray[np.float64]

GAMMA = 2.2
#: Number of unknowns: harmonics and lamp of three channels, a turn of the lamp, ln k and ln m.
N_UNKNOWN = 3 * (N_LIGHT + 1) + 4
# Linear colour below which the slope of the display's curve no longer rises.
_DARKEST = 1e-3
# Mean light of a photo that is well exposed, the deviations of its logarithm and of the ratios of channels, and those
# of the harmonics of degree 1 and 2 from none and of the lamp's colours from the usual.
_EXPOSURE, _EXPOSURE_SPREAD = 0.9, 0.35
_SPREADS = np.array([2.0, 0.2, 0.2, 0.2, 0.08, 0.08, 0.08, 0.08, 0.08])
_LAMP, _LAMP_SPREAD = 0.6, 0.6
_GLOSS, _GLOSS_SPREAD = 0.04, 1.0
_SHININESS, _SHININESS_SPREAD = 12.0, 0.3
#: Directions to the lamp from which it is searched, apart from that of the harmonics: x to the right, y down.
FIRST_LAMPS = np.array([[0.0, 0.0, -1.0], [0.8, -0.3, -0.6], [-0.8, -0.3, -0.6], [0.0, -0.8, -0.6], [0.0, 0.8, -0.6]])


@dataclass(frozen=True, eq=False)
class SkinLight:
    """A light in the axes of a camera.

    Attributes:
        around: L, coefficients of the harmonics, shape (9, 3).
        lamp: d, colour of the lamp, shape (3,).
        towards: l, unit vector to the lamp, shape (3,).
        log_gloss: ln k.
        log_shininess: ln m.
    """

    around: Array
    lamp: Array
    towards: Array
    log_gloss: float
    log_shininess: float

    @classmethod
    def first(cls, harmonic: Array) -> "SkinLight":
        """Return a light like the coefficients ``harmonic`` of a display's colours, (9, 3), to start from."""
        slope = harmonic[[3, 1, 2]].mean(axis=1) + (0.0, 0.0, -0.05)
        towards = slope / max(float(np.linalg.norm(slope)), 1e-9)
        if towards[2] > -0.2:
            towards = towards + (0.0, 0.0, -0.2 - towards[2])
            towards /= np.linalg.norm(towards)
        around = np.zeros((N_LIGHT, 3))
        around[0] = 0.5
        return cls(around, np.full(3, _LAMP), towards, float(np.log(_GLOSS)), float(np.log(_SHININESS)))

    def moved(self, step: Array) -> "SkinLight":
        """Return the light after a ``step`` of its unknowns, shape (34,)."""
        n = 3 * N_LIGHT
        turn = np.clip(step[n + 3 : n + 5], -0.5, 0.5) @ self._across()
        towards = self.towards + turn
        return replace(
            self,
            around=self.around + step[:n].reshape(N_LIGHT, 3),
            lamp=np.maximum(self.lamp + step[n : n + 3], 0.0),
            towards=towards / np.linalg.norm(towards),
            log_gloss=self.log_gloss + float(np.clip(step[n + 5], -1.0, 1.0)),
            log_shininess=self.log_shininess + float(np.clip(step[n + 6], -0.5, 0.5)),
        )

    def from_direction(self, towards: Array) -> "SkinLight":
        """Return the light with its lamp in the direction ``towards``, (3,)."""
        return replace(self, towards=towards / np.linalg.norm(towards))

    def _across(self) -> Array:
        """Return two unit vectors across the direction to the lamp, shape (2, 3)."""
        return np.linalg.svd(self.towards[None])[2][1:]

    def lit(self, albedo: Array, normals: Array, middles: Array) -> "LitSkin":
        """Return the colours of ``albedo``, (n, 3), with unit ``normals``, (n, 3), at ``middles`` before the camera."""
        distance = np.linalg.norm(middles, axis=1)
        view = -middles / distance[:, None]
        cosine = normals @ self.towards
        direct = np.maximum(cosine, 0.0)
        mirrored = 2.0 * cosine[:, None] * normals - self.towards
        towards = np.where(cosine > 0.0, np.maximum((mirrored * view).sum(axis=1), 0.0), 0.0)
        shininess = float(np.exp(self.log_shininess))
        lobe = towards**shininess
        basis = harmonics(normals)
        linear = albedo**GAMMA
        shade = basis @ self.around + direct[:, None] * self.lamp
        gloss = np.exp(self.log_gloss) * lobe
        radiance = np.maximum(linear * shade + gloss[:, None], _DARKEST)
        colours = radiance ** (1.0 / GAMMA)
        slope = colours / radiance / GAMMA
        return LitSkin(self, normals, view, distance, basis, linear, shade, gloss, mirrored, towards, colours, slope)


@dataclass(frozen=True, eq=False)
class LitSkin:
    """Colours of lit skin, and what they were computed from.

    Attributes:
        light: The light.
        normals: Unit normals, shape (n, 3).
        view: Unit vectors to the camera, shape (n, 3).
        distance: Distances from the camera, shape (n,).
        basis: Harmonics, shape (n, 9).
        linear: Albedo in linear colours, shape (n, 3).
        shade: E, shape (n, 3).
        gloss: g, shape (n,).
        mirrored: r, shape (n, 3).
        aligned: max(r·v, 0), shape (n,).
        colours: Colours of a display, shape (n, 3).
        slope: Their derivatives by linear colours, shape (n, 3).
    """

    light: SkinLight
    normals: Array
    view: Array
    distance: Array
    basis: Array
    linear: Array
    shade: Array
    gloss: Array
    mirrored: Array
    aligned: Array
    colours: Array
    slope: Array

    @property
    def by_log_albedo(self) -> Array:
        """Derivatives of each channel by the logarithm of its albedo, shape (n, 3)."""
        return self.slope * GAMMA * self.linear * self.shade

    def by_light(self) -> Array:
        """Return the derivatives by the unknowns of the light, shape (n, 3, 34)."""
        light, n = self.light, 3 * N_LIGHT
        rows = np.zeros((len(self.normals), 3, N_UNKNOWN))
        by_shade = self.slope * self.linear
        cosine = self.normals @ light.towards
        direct = np.maximum(cosine, 0.0)
        for k in range(3):
            rows[:, k, k:n:3] = by_shade[:, k, None] * self.basis
            rows[:, k, n + k] = by_shade[:, k] * direct
        across = light._across()
        # Derivatives of n·l and of r·v = 2 (n·l) (n·v) - l·v.
        turned = self.normals @ across.T
        facing = (self.normals * self.view).sum(axis=1)
        aligned = 2.0 * facing[:, None] * turned - self.view @ across.T
        by_turn = (by_shade * light.lamp)[..., None] * (turned * (cosine > 0.0)[:, None])[:, None]
        rows[:, :, n + 3 : n + 5] = by_turn + self.slope[..., None] * (self._by_aligned[:, None] * aligned)[:, None]
        rows[:, :, n + 5] = self.slope * self.gloss[:, None]
        logs = np.log(np.maximum(self.aligned, 1e-12)) * np.exp(light.log_shininess)
        rows[:, :, n + 6] = self.slope * (self.gloss * logs)[:, None]
        return rows

    @property
    def _by_aligned(self) -> Array:
        """Derivatives of the gloss by r·v, shape (n,)."""
        shininess = float(np.exp(self.light.log_shininess))
        result: Array = shininess * self.gloss / np.maximum(self.aligned, 1e-6)
        return result

    def by_normal(self) -> Array:
        """Return the derivatives by the normals, shape (n, 3, 3)."""
        light = self.light
        cosine = self.normals @ light.towards
        by_shade = np.einsum("skj,kc->scj", harmonic_slopes(self.normals), light.around)
        by_shade += (cosine > 0.0)[:, None, None] * (light.lamp[:, None] * light.towards)
        facing = (self.normals * self.view).sum(axis=1)
        aligned = 2.0 * (facing[:, None] * light.towards + cosine[:, None] * self.view)
        gloss = self._by_aligned[:, None] * aligned
        result: Array = self.slope[..., None] * (self.linear[..., None] * by_shade + gloss[:, None])
        return result

    def by_middle(self) -> Array:
        """Return the derivatives by the places, by which the view of a highlight changes, shape (n, 3, 3)."""
        away = -(self.mirrored - self.aligned[:, None] * self.view) / self.distance[:, None]
        result: Array = self.slope[..., None] * (self._by_aligned[:, None] * away)[:, None]
        return result


def prior_of(light: SkinLight, mean: Array) -> tuple[Array, Array]:
    """Return residuals, (q,), whose squares are twice -ln p of ``light``, and their derivatives, (q, 34).

    Args:
        light: The light.
        mean: Mean over the face of the harmonics and of the directed light, shape (10,): what exposes the photo.
    """
    n = 3 * N_LIGHT
    residuals: list[float] = []
    rows: list[Array] = []

    def add(value: float, at: list[int], slopes: list[float]) -> None:
        row = np.zeros(N_UNKNOWN)
        row[at] = slopes
        residuals.append(value)
        rows.append(row)

    for k in range(3):
        for i in range(N_LIGHT):
            expected = 0.5 if i == 0 else 0.0
            add((light.around[i, k] - expected) / _SPREADS[i], [3 * i + k], [1.0 / _SPREADS[i]])
        add((light.lamp[k] - _LAMP) / _LAMP_SPREAD, [n + k], [1.0 / _LAMP_SPREAD])
        exposed = mean[:N_LIGHT] @ light.around[:, k] + mean[N_LIGHT] * light.lamp[k]
        at = [*range(k, n, 3), n + k]
        add((exposed - _EXPOSURE) / _EXPOSURE_SPREAD, at, (mean / _EXPOSURE_SPREAD).tolist())
    add((light.log_gloss - np.log(_GLOSS)) / _GLOSS_SPREAD, [n + 5], [1.0 / _GLOSS_SPREAD])
    add((light.log_shininess - np.log(_SHININESS)) / _SHININESS_SPREAD, [n + 6], [1.0 / _SHININESS_SPREAD])
    return np.array(residuals), np.array(rows)
