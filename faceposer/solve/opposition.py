"""Opposition: an expression against which constraints pull fades before its opposite begins.

The prior keeps the start pose. Where that is a broad smile and an artist draws the mouth's corners down, it would keep
the lips apart and the cheeks raised beside a frown. A real face ends one expression before it begins the opposite one.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from faceposer.model.face_model import FaceModel
from faceposer.model.local_moments import attribution
from faceposer.model.muscles import muscle_of_shape, side_of_shape, subsiding
from faceposer.sized_cache import weak_cache
from faceposer.solve.term import Array

# Attribution of the constraints to a muscle, relative to the largest, at which it begins to fade and at which it can
# fade to 0.
_ATTRIBUTED = (0.25, 0.6)
# Prior variance of a share, against constraints in standard deviations: pulls of a hand's tremor do not count.
_STIFFNESS = 1.0
# Weights of a start below which a muscle counts as relaxed.
_RELAXED = 1e-3
_SWEEPS, _TOLERANCE = 30, 1e-4


@dataclass(frozen=True, eq=False)
class _Muscles:
    """Muscles by side that can fade.

    Attributes:
        own: Mask of the weights of each muscle, shape (M, W).
        carried: Change of each other weight per unit of each muscle, shape (M, W).
    """

    own: NDArray[np.bool_]
    carried: Array


def fading(model: FaceModel, start: Array, rows: Array, residual: Array, strength: float = 1.0) -> Array | None:
    """Return the part of ``start`` that constraints pull against, shape (r,), which is to be subtracted, or None.

    With a_mw the part of weight w in the start that ends with muscle m of one side, which is all of its own weights and
    a part of others (``muscles.subsiding``), and V_m the change of the constraints' residuals r by -a_m, the shares s_m
    minimise |V s + r|^2 + |s|^2 with 0 <= s_m <= b_m, where b_m is the attribution of the constraints to the muscle
    (``local_moments.attribution``) through a smooth step. The result is the sum of all s_m a_m, limited to the start.
    Constraints that are met at the start change nothing, and the result is continuous in their targets.

    Args:
        model: The face.
        start: Coefficients of the start pose, shape (r,).
        rows: Jacobian of the constraints' residuals at the start, divided by their standard deviations, shape (m, r).
        residual: Residuals at the start, divided likewise, shape (m,).
        strength: Factor on all shares, from 0 to 1.
    """
    density = model.rig_density
    weights = density.directions @ start
    if not len(rows) or strength <= 0.0 or np.abs(weights).max(initial=0.0) < _RELAXED:
        return None
    muscles, active = _muscles(model), np.maximum(weights, 0.0)
    strengths = np.where(muscles.own, active, 0.0).max(axis=1)
    parts = np.where(muscles.own, active, np.minimum(muscles.carried * strengths[:, None], active))
    by_weight = rows @ density.projection
    attributed = attribution(by_weight, residual, density.largest)
    first, last = _ATTRIBUTED
    t = ((np.where(muscles.own, attributed, 0.0).max(axis=1) - first) / (last - first)).clip(0.0, 1.0)
    bounds = np.where(strengths < _RELAXED, 0.0, t * t * (3.0 - 2.0 * t))
    shares = _bounded_least_squares(-(parts @ by_weight.T), residual, bounds)
    if not shares.any():
        return None
    fade: Array = density.projection @ (strength * np.minimum(shares @ parts, active))
    return fade


def _bounded_least_squares(columns: Array, residual: Array, bounds: Array) -> Array:
    """Return s with 0 <= s <= ``bounds``, (M,), that minimises |``columns``^T s + ``residual``|^2 + |s|^2.

    Coordinate descent (cyclic, exact for each coordinate), of few unknowns.
    """
    found = np.zeros(len(bounds))
    free = np.flatnonzero(bounds > 0.0)
    if not len(free):
        return found
    chosen = columns[free]
    gram = chosen @ chosen.T + _STIFFNESS * np.eye(len(free))
    slope, shares, upper = chosen @ residual, np.zeros(len(free)), bounds[free]
    for _ in range(_SWEEPS):
        change = 0.0
        for i in range(len(free)):
            new = min(max(shares[i] - (slope[i] + gram[i] @ shares) / gram[i, i], 0.0), upper[i])
            change = max(change, abs(new - shares[i]))
            shares[i] = new
        if change < _TOLERANCE:
            break
    found[free] = shares
    return found


@weak_cache(4)
def _muscles(model: FaceModel) -> _Muscles:
    names = [model.character.shape_names[row] for row in model.rig_density.shape_rows]
    groups = [(muscle_of_shape(name), side_of_shape(name)) for name in names]
    kinds = [kind for kind in dict.fromkeys(groups) if subsiding(kind[0]) is not None]
    own = np.array([[group == kind for group in groups] for kind in kinds], dtype=bool).reshape(len(kinds), len(names))
    carried = np.zeros(own.shape)
    for row, (muscle, side) in enumerate(kinds):
        amounts = subsiding(muscle) or {}
        for column, (other, other_side) in enumerate(groups):
            if other_side in (side, ""):
                # A shape of both sides follows either side by half.
                carried[row, column] = amounts.get(other, 0.0) * (1.0 if other_side == side else 0.5)
    return _Muscles(own, carried)
