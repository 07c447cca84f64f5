"""Cholesky factors and solutions for positive definite matrices of a few dozen rows, by direct calls of LAPACK.

LAPACK is column-major and reads a row-major NumPy matrix as its transpose. No copy is needed: a symmetric matrix equals
its transpose, and a lower triangle is passed as an upper one.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.lapack import dposv, dtrtrs

Array = NDArray[np.float64]


def robust_cholesky(matrix: Array) -> Array:
    """Return a lower triangular L with L L^T approximately the ``matrix``, (r, r).

    In extreme close-ups, constraints outweigh the prior by more than double precision resolves. A small multiple of the
    identity then restores definiteness.
    """
    try:
        return np.asarray(np.linalg.cholesky(matrix), dtype=np.float64)
    except np.linalg.LinAlgError:
        diagonal = np.eye(len(matrix)) * float(np.trace(matrix)) / len(matrix)
    for jitter in (1e-12, 1e-9, 1e-6):
        try:
            return np.asarray(np.linalg.cholesky(matrix + jitter * diagonal), dtype=np.float64)
        except np.linalg.LinAlgError:
            continue
    root: Array = np.sqrt(np.diag(np.diag(matrix)) + 1e-3 * diagonal)
    return root


def solve_triangular(lower: Array, right: Array, transposed: bool = False) -> Array:
    """Return L^-1 b, or L^-T b, for a lower triangular L, (r, r), and b of shape (r,) or (r, k)."""
    solution, _ = dtrtrs(lower.T, right, lower=0, trans=0 if transposed else 1)
    return np.asarray(solution, dtype=np.float64)


def solve_definite(matrix: Array, right: Array) -> Array:
    """Return M^-1 b, shape (r,), for a positive definite M, (r, r), and b, (r,)."""
    _, solution, failed = dposv(matrix.T, right, lower=1)
    return np.asarray(np.linalg.solve(matrix, right) if failed else solution, dtype=np.float64)
