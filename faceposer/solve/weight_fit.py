"""Bounded least-squares fit of rig weights to a pose, or to every pose of a performance."""

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import LinAlgError, cho_factor, cho_solve
from scipy.optimize import lsq_linear

from faceposer.model.face_model import FaceModel

Array = NDArray[np.float64]

# Ridge on the normalised Gram matrix, for shapes that are linearly dependent or nearly so.
_RIDGE = 1e-9
# The active set nearly always converges in a handful of steps; if it cycles, an exact method takes over.
_MOST_STEPS = 40


def fit_weights(model: FaceModel, p: ArrayLike) -> dict[str, float]:
    """Return the weights of the shapes by name, within their limits, that fit the face ``p``, (r,), best.

    The sum of squared vertex distances is minimised. Shapes that move nothing get 0.
    """
    values = fit_weights_of_frames(model, np.asarray(p, dtype=np.float64)[None])[0]
    return dict(zip(model.character.shape_names, values.tolist(), strict=True))


def fit_weights_of_frames(model: FaceModel, coefficients: ArrayLike) -> Array:
    """Return the weights within their limits, (F, S), that fit the faces ``coefficients``, (F, r), best.

    Solves a bounded least-squares problem for each frame, min (w - v)^T G (w - v) with v the unbounded weights and G
    the Gram matrix of the shapes, by the primal-dual active set method (Hintermueller, Ito and Kunisch, SIAM J. Optim.
    13, 2002), warm-started from the previous frame. Shapes that move nothing get 0.
    """
    free = np.asarray(coefficients, dtype=np.float64) @ model.subspace.directions.T
    result = np.zeros(free.shape)
    moving = np.flatnonzero(np.diag(model.gram) > 0)
    lower, upper = model.character.shape_limits[moving].T.astype(np.float64)
    # Normalise the shapes, so that the choice of the active set does not favour a jaw over an eyelid.
    lengths = np.sqrt(np.diag(model.gram)[moving])
    gram = model.gram[np.ix_(moving, moving)] / np.outer(lengths, lengths)
    targets = free[:, moving] * lengths @ gram
    gram[np.diag_indices_from(gram)] += _RIDGE
    low, high = lower * lengths, upper * lengths
    sides = np.zeros(len(moving), dtype=np.int8)
    for frame, target in enumerate(targets):
        values, sides = _solve_bounded(gram, target, low, high, sides)
        result[frame, moving] = np.clip(values / lengths, lower, upper)
    return result


def _solve_bounded(
    gram: Array, target: Array, low: Array, high: Array, sides: NDArray[np.int8]
) -> tuple[Array, NDArray[np.int8]]:
    """Return the minimum x of x^T gram x / 2 - target^T x from ``low`` to ``high``, and its active set.

    ``sides`` is the initial active set: -1 at the lower limit, 1 at the upper, 0 between.
    """
    for _ in range(_MOST_STEPS):
        inside = sides == 0
        x = np.where(sides < 0, low, high)
        try:
            free = cho_factor(gram[np.ix_(inside, inside)])
        except LinAlgError:
            break
        x[inside] = cho_solve(free, target[inside] - gram[np.ix_(inside, ~inside)] @ x[~inside])
        force = target - gram @ x
        force[inside] = 0.0
        new = np.where(force + (x - high) > 0, 1, np.where(force + (x - low) < 0, -1, 0)).astype(np.int8)
        if np.array_equal(new, sides):
            return x, sides
        sides = new
    # The solver requires distinct limits; where they coincide, the clip in the caller restores the only weight.
    squared, axes = np.linalg.eigh(gram)
    half = np.sqrt(np.maximum(squared, _RIDGE))[:, None] * axes.T
    right = np.linalg.solve(half.T, target)
    exact = lsq_linear(half, right, bounds=(low, np.maximum(high, low + 1e-9)), method="bvls")
    return exact.x, exact.active_mask.astype(np.int8)
