"""Light on the skin as spherical harmonics of its normals, of degree 2.

Lambertian reflection of distant light is nearly a quadratic polynomial of the normal, with nine coefficients per
channel (R. Ramamoorthi and P. Hanrahan, "An efficient representation for irradiance environment maps", SIGGRAPH 2001).
Factors of the polynomials are absorbed by the coefficients.
"""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

N_LIGHT = 9
# Mean light on the face of a photo that is well exposed, and its weight, relative to the sum of squares of the albedo:
# dark skin in bright light and bright skin in dark light look the same.
_EXPOSURE, _EXPOSED = 0.95, 0.05
# Ridge on the coefficients, relative to the sum of squares of the albedo: least on the ambient light.
_RIDGE = 0.02 * np.array([1e-3, 0.05, 0.05, 0.05, 0.3, 0.3, 0.3, 0.3, 0.3])
# Residual of a colour, 0 to 1, from which a sample counts less, and the number of rounds.
_DOUBTFUL, _ROUNDS = 0.08, 4


def harmonics(normals: Array) -> Array:
    """Return the nine polynomials of unit ``normals``, (n, 3), shape (n, 9)."""
    x, y, z = normals.T
    return np.stack([np.ones_like(x), y, z, x, x * y, y * z, 3.0 * z * z - 1.0, x * z, x * x - y * y], axis=1)


def harmonic_slopes(normals: Array) -> Array:
    """Return the derivatives of `harmonics` by the normals, shape (n, 9, 3)."""
    x, y, z = normals.T
    none, one = np.zeros_like(x), np.ones_like(x)
    rows = [
        (none, none, none),
        (none, one, none),
        (none, none, one),
        (one, none, none),
        (y, x, none),
        (none, z, y),
        (none, none, 6.0 * z),
        (z, none, x),
        (2.0 * x, -2.0 * y, none),
    ]
    return np.stack([np.stack(row, axis=1) for row in rows], axis=1)


def fitted_light(colours: Array, albedo: Array, normals: Array, trust: Array) -> Array:
    """Return the light, (9, 3), under which ``albedo`` has the ``colours``, by robust ridge regression.

    Args:
        colours: Colours, 0 to 1, shape (n, 3).
        albedo: Colours under white light, shape (n, 3).
        normals: Unit normals in the frame of the light, shape (n, 3).
        trust: Weight of each sample, shape (n,).
    """
    basis = harmonics(normals)
    light = np.zeros((N_LIGHT, 3))
    mean = trust @ basis / max(float(trust.sum()), 1.0)
    for channel in range(3):
        total = max(float(trust @ np.square(albedo[:, channel])), 1e-6)
        prior = total * (np.diag(_RIDGE) + _EXPOSED * np.outer(mean, mean))
        expected = total * _EXPOSED * _EXPOSURE * mean
        rows, weights = basis * albedo[:, channel, None], trust
        for _ in range(_ROUNDS):
            weighted = rows * weights[:, None]
            light[:, channel] = np.linalg.solve(weighted.T @ rows + prior, weighted.T @ colours[:, channel] + expected)
            left = colours[:, channel] - rows @ light[:, channel]
            weights = trust / (1.0 + (left / _DOUBTFUL) ** 2)
    return light
