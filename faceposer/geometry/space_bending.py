"""Space bent so that points come to lie on others: a similarity, and the smoothest displacement on top of it.

The displacement is the biharmonic spline of three dimensions, what a thin plate is in two: the kernel -r with a
constant and a ridge (Carr et al., "Reconstruction and representation of 3D objects with radial basis functions",
SIGGRAPH 2001, section 3). Far from all points it tends to a constant.
"""

import numpy as np
from numpy.typing import NDArray

from faceposer.geometry.alignment import rigid_alignment

Array = NDArray[np.float64]

# Places moved at a time, which limits the memory of their distances from the points.
_AT_A_TIME = 4096


def bend(places: Array, source: Array, target: Array, ridge: Array) -> Array:
    """Return ``places`` moved as ``source`` moves to ``target``.

    With the similarity S of least squares and the displacements d = target - S source, the coefficients c and the
    constant c0 solve (diag(ridge) - ‖x_i - x_j‖) c + c0 = d with Σ c = 0, and a place x moves to
    S x + c0 - Σ ‖x - x_j‖ c_j.

    Args:
        places: Positions, shape (n, 3).
        source: Points, at least three that are not on a line, shape (m, 3).
        target: Where they move, shape (m, 3).
        ridge: How little each point is trusted, a length, shape (m,): 0 is met exactly.
    """
    laid = rigid_alignment(source, target, 1.0 / np.maximum(ridge, 1e-6), scale=True)
    ones = np.ones((len(source), 1))
    kernel = np.diag(ridge) - np.linalg.norm(source[:, None] - source, axis=2)
    system = np.block([[kernel, ones], [ones.T, np.zeros((1, 1))]])
    shares = np.linalg.solve(system, np.vstack([target - laid.apply(source), np.zeros((1, 3))]))
    moved: Array = laid.apply(places) + shares[-1]
    for first in range(0, len(places), _AT_A_TIME):
        part = slice(first, first + _AT_A_TIME)
        moved[part] -= np.linalg.norm(places[part, None] - source, axis=2) @ shares[:-1]
    return moved
