"""Rig weights within their limits that come nearest to a pose, or to every pose of a performance."""

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import LinAlgError, cho_factor, cho_solve
from scipy.optimize import lsq_linear

from faceposer.model.face_model import FaceModel

Array = NDArray[np.float64]

# Of the mean squared length of a shape: what keeps shapes apart that together move nothing, or hardly anything.
_RIDGE = 1e-9
# The sets of weights at a limit nearly always settle in a handful of steps; where they go round in circles, an exact
# method takes over.
_MOST_STEPS = 40


def fit_weights(model: FaceModel, p: ArrayLike) -> dict[str, float]:
    """Return the weight of each shape by name, within its limits, whose sum comes nearest to the face ``p``, (r,).

    Nearest in the sum of squared vertex distances; shapes that move nothing get 0.
    """
    values = fit_weights_of_frames(model, np.asarray(p, dtype=np.float64)[None])[0]
    return dict(zip(model.character.shape_names, values.tolist(), strict=True))


def fit_weights_of_frames(model: FaceModel, coefficients: ArrayLike) -> Array:
    """Return the weights within their limits whose sums come nearest to the faces ``coefficients``, (F, r), as (F, S).

    A bounded least squares for each frame, min (w - v)^T G (w - v) with v the weights without limits and G the Gram
    matrix of the shapes, by the primal-dual active set method (Hintermueller, Ito and Kunisch, SIAM J. Optim. 13,
    2002), which starts from the frame before. Shapes that move nothing get 0.
    """
    free = np.asarray(coefficients, dtype=np.float64) @ model.subspace.directions.T
    result = np.zeros(free.shape)
    moving = np.flatnonzero(np.diag(model.gram) > 0)
    lower, upper = model.character.shape_limits[moving].T.astype(np.float64)
    # Shapes of one length, so that no jaw is weighed against an eyelid in the choice of what is at its limit.
    lengths = np.sqrt(np.diag(model.gram)[moving])
    gram = model.gram[np.ix_(moving, moving)] / np.outer(lengths, lengths)
    wanted = free[:, moving] * lengths @ gram
    gram[np.diag_indices_from(gram)] += _RIDGE
    low, high = lower * lengths, upper * lengths
    sides = np.zeros(len(moving), dtype=np.int8)
    for frame, target in enumerate(wanted):
        values, sides = _bounded(gram, target, low, high, sides)
        result[frame, moving] = np.clip(values / lengths, lower, upper)
    return result


def _bounded(
    gram: Array, target: Array, low: Array, high: Array, sides: NDArray[np.int8]
) -> tuple[Array, NDArray[np.int8]]:
    """Return the x from ``low`` to ``high`` that makes x^T gram x / 2 - target^T x least, and which lie at a limit.

    ``sides`` says from which of them to start: -1 at the lower limit, 1 at the upper, 0 between.
    """
    for _ in range(_MOST_STEPS):
        inside = sides == 0
        x = np.where(sides < 0, low, high)
        try:
            free = cho_factor(gram[np.ix_(inside, inside)])
        except LinAlgError:
            break
        x[inside] = cho_solve(free, target[inside] - gram[np.ix_(inside, ~inside)] @ x[~inside])
        pull = target - gram @ x
        pull[inside] = 0.0
        new = np.where(pull + (x - high) > 0, 1, np.where(pull + (x - low) < 0, -1, 0)).astype(np.int8)
        if np.array_equal(new, sides):
            return x, sides
        sides = new
    # The solver needs room between the limits; where there is none, the shape keeps its only weight.
    squared, axes = np.linalg.eigh(gram)
    half = np.sqrt(np.maximum(squared, _RIDGE))[:, None] * axes.T
    wanted = np.linalg.solve(half.T, target)
    exact = lsq_linear(half, wanted, bounds=(low, np.maximum(high, low + 1e-9)), method="bvls")
    return exact.x, exact.active_mask.astype(np.int8)
