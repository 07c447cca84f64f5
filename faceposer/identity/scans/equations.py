"""Normal equations of fits to scans, with bounds for some of the unknowns, and the motion of a scan."""

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve
from scipy.spatial.transform import Rotation

from faceposer.geometry.alignment import Similarity

Array = NDArray[np.float64]

# Sweeps of the coordinate descent, and the change of a weight at which it ends.
_SWEEPS, _SETTLED = 500, 1e-5


class System:
    """Normal equations H θ = g of all unknowns."""

    def __init__(self, size: int) -> None:
        self.matrix = np.zeros((size, size))
        self.right = np.zeros(size)

    def add(self, where: NDArray[np.int64], rows: Array, values: Array) -> None:
        """Add the weighted ``rows``, (r, p), of the unknowns ``where``, (p,), with right sides ``values``, (r,)."""
        self.matrix[np.ix_(where, where)] += rows.T @ rows
        self.right[where] += rows.T @ values


def pose_columns(places: Array) -> Array:
    """Return the motion of ``places``, (n, 3), by a small rotation, translation and growth, shape (7, n, 3)."""
    turns = np.cross(np.eye(3)[:, None], places[None])
    shifts = np.broadcast_to(np.eye(3)[:, None], turns.shape)
    return np.concatenate([turns, shifts, places[None]])


def moved(frame: Similarity, pose: Array) -> Similarity:
    """Return ``frame`` followed by the small motion ``pose``, (7,)."""
    turn, growth = Rotation.from_rotvec(pose[:3]).as_matrix(), float(np.exp(np.clip(pose[6], -0.5, 0.5)))
    return Similarity(
        turn @ frame.rotation, growth * (turn @ frame.translation) + pose[3:6], np.asarray(growth * float(frame.scale))
    )


def bounded(system: System, free: NDArray[np.int64], held: Array | None) -> Array:
    """Return the minimiser of ½ θᵀHθ - gᵀθ with the unknowns ``free`` from 0 to 1, or with the values ``held``."""
    size = len(system.right)
    others = np.setdiff1d(np.arange(size), free)
    ridge = 1e-9 * float(np.trace(system.matrix)) / size
    factor = cho_factor(system.matrix[np.ix_(others, others)] + ridge * np.eye(len(others)))
    theta = np.zeros(size)
    cross = system.matrix[np.ix_(others, free)]
    if held is not None:
        theta[free] = held
    elif len(free):
        reduced = system.matrix[np.ix_(free, free)] - cross.T @ cho_solve(factor, cross)
        right = system.right[free] - cross.T @ cho_solve(factor, system.right[others])
        theta[free] = within_bounds(reduced + ridge * np.eye(len(free)), right)
    theta[others] = cho_solve(factor, system.right[others] - cross @ theta[free])
    return theta


def within_bounds(matrix: Array, right: Array) -> Array:
    """Return the minimiser of ½ xᵀ M x - rᵀ x over 0 ≤ x ≤ 1 by coordinate descent, which converges for definite M."""
    x = np.zeros(len(right))
    for _ in range(_SWEEPS):
        before = x.copy()
        for i in range(len(x)):
            x[i] = np.clip(x[i] + (right[i] - matrix[i] @ x) / matrix[i, i], 0.0, 1.0)
        if np.abs(x - before).max(initial=0.0) < _SETTLED:
            break
    return x
