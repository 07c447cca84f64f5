"""Positive definite matrices of a few dozen rows: triangular roots and solutions, straight by LAPACK.

To LAPACK, which counts by columns, a matrix of NumPy's is its transpose, and need not be copied: a symmetric one is the
same, a lower triangle an upper one.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.lapack import dposv, dtrtrs

Array = NDArray[np.float64]


def square_root(matrix: Array) -> Array:
    """Return lower triangular L with L L^T about the ``matrix``, (r, r).

    Seen from very near, constraints outweigh the prior by more digits than a number has; a faint diagonal then makes up
    for what rounding takes away.
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


def solved_by_root(lower: Array, right: Array, transposed: bool = False) -> Array:
    """Return L^-1 b, or L^-T b, for a lower triangular L, (r, r), and b of shape (r,) or (r, k)."""
    solution, _ = dtrtrs(lower.T, right, lower=0, trans=0 if transposed else 1)
    return np.asarray(solution, dtype=np.float64)


def solved(matrix: Array, right: Array) -> Array:
    """Return M^-1 b, shape (r,), for a positive definite M, (r, r), and b, (r,)."""
    _, solution, failed = dposv(matrix.T, right, lower=1)
    return np.asarray(np.linalg.solve(matrix, right) if failed else solution, dtype=np.float64)
