"""Lights of synthetic photos: that of the model of the fit, and others, which it does not have."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_GAMMA, _SHININESS = 2.2, 12.0
# Of several lamps: their strengths, the deviation of their colours, the share of ambient light, the sky, the highlight.
_STRENGTHS, _TINT, _AMBIENT, _SKY, _NARROW = (0.6, 0.35, 0.25), 0.15, 0.5, 0.3, 25.0


class Light(Protocol):
    """A light in the axes of a camera."""

    def colours(self, albedo: Array, normals: Array, towards: Array) -> Array:
        """Return colours, 0..1, of points with ``albedo``, unit ``normals`` and directions ``towards`` the camera."""


@dataclass(frozen=True, eq=False)
class PhongLight:
    """Ambient light and one lamp with Phong's highlight in linear colours.

    Attributes:
        lamp: Unit vector to it, shape (3,).
        ambient: Colour of the ambient light, shape (3,).
        diffuse: Colour of the lamp, shape (3,).
        specular: Strength of the highlight.
    """

    lamp: Array
    ambient: Array
    diffuse: Array
    specular: float

    def colours(self, albedo: Array, normals: Array, towards: Array) -> Array:
        """Return colours of a display of exponent 2.2."""
        gloss = self.specular * _highlight(normals, towards, self.lamp, _SHININESS)
        lit = self.ambient + self.diffuse * np.maximum(normals @ self.lamp, 0.0)[:, None]
        result: Array = (albedo**_GAMMA * lit + gloss[:, None]).clip(0.0, 1.0) ** (1.0 / _GAMMA)
        return result


@dataclass(frozen=True, eq=False)
class ManyLights:
    """Three lamps of different colours with a narrow highlight, light from the sky, and the transfer curve of sRGB.

    Attributes:
        lamps: Unit vectors to the lamps, shape (3, 3).
        ambient: Colour of the ambient light, shape (3,).
        diffuse: Colours of the lamps, shape (3, 3).
        specular: Strength of the highlight.
    """

    lamps: Array
    ambient: Array
    diffuse: Array
    specular: float

    @classmethod
    def about(cls, light: PhongLight, rng: np.random.Generator) -> "ManyLights":
        """Return the ``light`` with two lamps more."""
        more = []
        for _ in _STRENGTHS[1:]:
            x, y, z = rng.normal(size=3)
            lamp = np.array([x, y, -abs(z) - 0.2])
            more.append(lamp / np.linalg.norm(lamp))
        tints = np.exp(rng.normal(0.0, _TINT, (len(_STRENGTHS), 3)))
        return cls(np.stack([light.lamp, *more]), light.ambient, light.diffuse * tints, light.specular)

    def colours(self, albedo: Array, normals: Array, towards: Array) -> Array:
        """Return colours of a display of sRGB."""
        lit = _AMBIENT * self.ambient + _SKY * (0.5 - 0.5 * normals[:, 1:2])
        gloss = np.zeros(len(normals))
        for lamp, colour, strength in zip(self.lamps, self.diffuse, _STRENGTHS, strict=True):
            lit = lit + strength * colour * np.maximum(normals @ lamp, 0.0)[:, None]
            gloss += strength * self.specular * _highlight(normals, towards, lamp, _NARROW)
        linear = np.where(albedo <= 0.04045, albedo / 12.92, ((albedo + 0.055) / 1.055) ** 2.4) * lit + gloss[:, None]
        curved = 1.055 * np.maximum(linear, 1e-9) ** (1.0 / 2.4) - 0.055
        return np.where(linear <= 0.0031308, linear * 12.92, curved).clip(0.0, 1.0)


def _highlight(normals: Array, towards: Array, lamp: Array, shininess: float) -> Array:
    mirrored = 2.0 * (normals @ lamp)[:, None] * normals - lamp
    result: Array = np.maximum((mirrored * towards).sum(axis=1), 0.0) ** shininess
    return result
