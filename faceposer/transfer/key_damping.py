"""Damping of the small differences between keys, chosen by cross-validation over the keys.

The linear functions of the weights (``key_weights``) are fitted to keys that are not exact: an artist sets no slider to
a hundredth, and a proposal is no linear function of the source. Where keys differ little on the source, such errors of
the target are exaggerated. Ridge regression damps these directions. Each key is predicted from all others, in closed
form (Allen's PRESS; Golub, Heath and Wahba, "Generalized cross-validation as a method for choosing a good ridge
parameter", Technometrics 1979, section 1), and the largest damping is used whose predictions are not clearly worse than
the best ones: by no more than the standard error of the difference (after Hastie, Tibshirani and Friedman, *The
Elements of Statistical Learning*, 2009, section 7.10). A few keys that hardly predict each other give no reason to
exaggerate what they differ in.
"""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Dampings to choose from, relative to the largest variance of the keys. Smaller ones cannot be told from the keys when
#: there are few, and exaggerate far outside of them; larger ones damp what a single key is made for, such as a blink.
DAMPINGS: tuple[float, ...] = (1e-6, 2e-6, 5e-6, 1e-5, 2e-5, 5e-5, 1e-4)


def chosen_damping(places: Array, answers: Array) -> float:
    """Return the largest damping with which keys are predicted from all others about as well as with the best one.

    Args:
        places: Places of the keys in the space of their parameters, shape (M, n).
        answers: Their poses on the target, shape (M, r).
    """
    errors = prediction_errors(places, answers)
    worse = errors - errors[np.argmin(errors.mean(axis=1))]
    usable = worse.mean(axis=1) <= worse.std(axis=1) / np.sqrt(len(places))
    return DAMPINGS[int(np.flatnonzero(usable)[-1])]


def prediction_errors(places: Array, answers: Array, dampings: tuple[float, ...] = DAMPINGS) -> Array:
    """Return the squared error with which each key is predicted from all others, for each of the ``dampings``.

    Args:
        places: Places of the keys, shape (M, n).
        answers: Their poses on the target, shape (M, r).
        dampings: See ``KeyWeights``, shape (d,).

    Returns:
        Errors, shape (d, M).
    """
    count = len(places)
    # A basis of all vectors that are orthogonal to the constant, in which the constant term needs no care.
    centred = _contrasts(count)
    axes, sizes, _ = np.linalg.svd(centred.T @ places)
    axes = centred @ axes
    shares = np.zeros(count - 1)
    shares[: len(sizes)] = (sizes / max(float(sizes.max(initial=0.0)), 1e-300)) ** 2
    wanted = axes.T @ answers
    errors = []
    for damping in dampings:
        # What the fit leaves, in a form without cancellation: with as many parameters as keys, it is tiny.
        left = damping / (shares + damping)
        residuals = axes @ (left[:, None] * wanted)
        leverages = (axes**2) @ left
        errors.append(((residuals / leverages[:, None]) ** 2).sum(axis=1))
    return np.array(errors)


def _contrasts(count: int) -> Array:
    """Return an orthonormal basis of the vectors of sum 0, shape (count, count - 1) (Helmert)."""
    matrix = np.tril(np.ones((count, count)), -1)[1:]
    steps = np.arange(1, count)
    matrix[:, 1:][np.diag_indices(count - 1)] = -steps
    result: Array = (matrix / np.sqrt(steps * (steps + 1.0))[:, None]).T
    return result
