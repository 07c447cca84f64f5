"""Smooth deformations as modes of a head of which no statistics are known.

The displacement of a point is a Gaussian process whose covariance falls with the distance (Lüthi, Gerig, Jud and
Vetter, "Gaussian process morphable models", PAMI 2018), with the sum of several widths,

    k(x, y) = Σ s² exp(-‖x - y‖² / 2 l²),

and its largest modes are found from some of the vertices by the method of Nyström. Heads are nearly symmetric: k is
split into what is even and what is odd across the plane x = 0, and the modes that move both sides differently are
weakened.
"""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# Standard deviations s and widths l, in centimetres.
_SCALES = ((0.42, 8.0), (0.21, 4.0), (0.07, 2.0))
# Vertices of one half from which the modes are found, and the most even and odd functions.
_N_POINTS, _N_FUNCTIONS = 250, 40
# Strength of asymmetric modes.
_ASYMMETRIC = 0.2
_FLIP = np.array([-1.0, 1.0, 1.0])
# Least variance of a function, as a share of the largest.
_LEAST = 1e-6


def smooth_modes(mean: Array, chosen: NDArray[np.integer]) -> Array:
    """Return smooth modes of a head about symmetric in x, the largest first, (K, N, 3), per standard deviation.

    Args:
        mean: The head, shape (N, 3), in centimetres.
        chosen: Vertices that matter, shape (n,).
    """
    half = np.asarray(chosen)[mean[chosen, 0] >= 0.0]
    centres = mean[_spread_out(mean[half], half, _N_POINTS)]
    modes = []
    for parity in (1.0, -1.0):
        within = 0.5 * (_covariance(centres, centres) + parity * _covariance(centres, centres * _FLIP))
        across = 0.5 * (_covariance(mean, centres) + parity * _covariance(mean, centres * _FLIP))
        values, vectors = np.linalg.eigh(within)
        largest = np.argsort(-values)[:_N_FUNCTIONS]
        largest = largest[values[largest] > _LEAST * values[largest[0]]]
        functions = across @ (vectors[:, largest] / np.sqrt(values[largest]))
        for axis in range(3):
            # Along x, odd functions move both sides alike.
            symmetric = (axis > 0) == (parity > 0.0)
            offsets = np.zeros((functions.shape[1], len(mean), 3))
            offsets[:, :, axis] = functions.T * (1.0 if symmetric else _ASYMMETRIC)
            modes.append(offsets)
    found = np.concatenate(modes)
    return found[np.argsort(-np.linalg.norm(found[:, chosen], axis=(1, 2)), kind="stable")]


def _covariance(first: Array, second: Array) -> Array:
    squares = np.square(first[:, None] - second[None]).sum(axis=2)
    return np.asarray(sum(s**2 * np.exp(-squares / (2.0 * width**2)) for s, width in _SCALES))


def _spread_out(places: Array, ids: NDArray[np.integer], count: int) -> NDArray[np.int64]:
    """Return ``count`` of the ``ids``, (n,), at ``places``, (n, 3), each the farthest from those before."""
    picked = [0]
    distances = np.linalg.norm(places - places[0], axis=1)
    while len(picked) < min(count, len(places)):
        picked.append(int(distances.argmax()))
        distances = np.minimum(distances, np.linalg.norm(places - places[picked[-1]], axis=1))
    return np.asarray(ids)[picked].astype(np.int64)
