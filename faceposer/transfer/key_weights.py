"""Weights of keys at any place of their parameter space: linear and radial cardinal functions.

Pyun et al., "An example-based approach for facial expression cloning", SCA 2003, section 4, after Sloan et al., "Shape
by example", I3D 2001.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

# The radial system is solved with narrower functions while its condition is above this.
_WORST_CONDITION, _NARROWER = 1e8, 0.8
# Distances below this share of the largest are those of one place.
_SAME = 1e-9


def cubic_b_spline(x: ArrayLike) -> Array:
    """Return the cubic B-spline with support from -2 to 2 at ``x``, of the shape of ``x``."""
    size = np.abs(np.asarray(x, dtype=np.float64))
    inner = 2.0 / 3.0 + size**2 * (0.5 * size - 1.0)
    outer = np.maximum(2.0 - size, 0.0) ** 3 / 6.0
    return np.where(size < 1.0, inner, outer)


class KeyWeights:
    """Cardinal functions w_i(p) of M keys: w_i(p_j) is 1 for i = j and 0 otherwise (eq. (4)).

    Linear functions are fitted by least squares (eq. (5)). Radial functions around the keys, cubic B-splines as wide as
    the distance to the nearest other key, then take up what remains at the keys (eqs. (6) to (8)). Far from all keys
    only the linear functions remain, which extrapolate. With damping they are fitted by ridge regression, so that
    directions in which the keys hardly differ count less; the radial functions still make the weights cardinal.

    Attributes:
        places: Places of the keys, shape (M, n).
        dilations: Distance of each key to the nearest other key, shape (M,), smaller where the system would otherwise
            be singular.
    """

    def __init__(self, places: ArrayLike, damping: float = 0.0) -> None:
        """Fit the functions of keys.

        Args:
            places: Places of the keys, shape (M, n).
            damping: Penalty of the slopes, relative to the largest variance of the places; a direction with this share
                of it counts half. 0 for plain least squares.

        Raises:
            ValueError: If there are fewer than two keys, or two at the same place.
        """
        self.places = np.array(places, dtype=np.float64)
        count = len(self.places)
        if count < 2:
            raise ValueError("two keys or more are needed")
        distances = _distances(self.places, self.places)
        self._linear = _fitted(self.places, damping)
        residual = np.eye(count) - _affine(self.places) @ self._linear
        apart = distances + np.diag(np.full(count, np.inf))
        self.dilations: Array = np.asarray(apart.min(axis=1), dtype=np.float64)
        if not self.dilations.min() > _SAME * distances.max():
            raise ValueError("two keys are at the same place")
        radial = cubic_b_spline(distances / self.dilations)
        while np.linalg.cond(radial) > _WORST_CONDITION:
            self.dilations = _NARROWER * self.dilations
            radial = cubic_b_spline(distances / self.dilations)
        self._radial: Array = np.asarray(np.linalg.solve(radial, residual), dtype=np.float64)

    def __call__(self, places: ArrayLike) -> Array:
        """Return the weights of all keys at ``places``, (m, n), shape (m, M)."""
        points = np.asarray(places, dtype=np.float64)
        radial = cubic_b_spline(_distances(points, self.places) / self.dilations)
        weights: Array = _affine(points) @ self._linear + radial @ self._radial
        return weights


def _fitted(places: Array, damping: float) -> Array:
    """Return the constants and slopes of the linear functions of keys at ``places``, (M, n), shape (1 + n, M)."""
    mean = places.mean(axis=0)
    left, sizes, right = np.linalg.svd(places - mean, full_matrices=False)
    kept = sizes > max(places.shape) * np.finfo(np.float64).eps * sizes.max(initial=0.0)
    left, sizes, right = left[:, kept], sizes[kept], right[kept]
    slopes = right.T @ ((sizes / (sizes**2 + damping * sizes.max(initial=0.0) ** 2))[:, None] * left.T)
    return np.vstack([1.0 / len(places) - mean @ slopes, slopes])


def _affine(places: Array) -> Array:
    """Return the linear functions A_0 = 1 and A_l = p^l at ``places``, (m, n), shape (m, 1 + n)."""
    return np.hstack([np.ones((len(places), 1)), places])


def _distances(places: Array, others: Array) -> Array:
    """Return the distances between ``places``, (m, n), and ``others``, (M, n), shape (m, M)."""
    # Imported late to shorten the start of the window. It takes differences, not inner products, so that the distance
    # of a key to itself is exactly 0, and needs no memory for them.
    from scipy.spatial.distance import cdist

    return np.asarray(cdist(places, others), dtype=np.float64)
