"""Relaxed (natural) cubic Bezier curves through given points (paper, section 4.4)."""

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import solve_banded

Array = NDArray[np.float64]


def relaxed_bezier(points: ArrayLike) -> Array:
    """Return the Bezier control points, shape (n - 1, 4, 2), of the relaxed curve through ``points``, shape (n, 2).

    First and second derivatives are continuous, and the second derivative is zero at both ends. The interior B-spline
    points solve the paper's eq. (14), a tridiagonal system (1, 4, 1) with the right-hand side 6 S, less the end points
    in its first and last row. Two points give a straight line.

    Raises:
        ValueError: If there are fewer than two points.
    """
    through = np.asarray(points, dtype=np.float64).reshape(-1, 2)
    count = len(through)
    if count < 2:
        raise ValueError("a curve needs at least two points")
    spline = through.copy()
    if count > 2:
        right = 6.0 * through[1:-1]
        right[0] -= through[0]
        right[-1] -= through[-1]
        bands = np.array([np.ones(count - 2), np.full(count - 2, 4.0), np.ones(count - 2)])
        spline[1:-1] = solve_banded((1, 1), bands, right)
    pieces = np.empty((count - 1, 4, 2))
    pieces[:, 0], pieces[:, 3] = through[:-1], through[1:]
    # The Bezier points divide each edge of the B-spline's control polygon into thirds.
    pieces[:, 1] = (2.0 * spline[:-1] + spline[1:]) / 3.0
    pieces[:, 2] = (spline[:-1] + 2.0 * spline[1:]) / 3.0
    return pieces


def curve_at(pieces: Array, parameters: ArrayLike) -> tuple[Array, Array]:
    """Return positions and first derivatives, each (m, 2), of a piecewise curve at ``parameters``, shape (m,).

    Args:
        pieces: Bezier control points, shape (n, 4, 2).
        parameters: Parameters from 0 to n; integers are the ends of the pieces.
    """
    at = np.clip(np.asarray(parameters, dtype=np.float64), 0.0, len(pieces))
    index = np.minimum(at.astype(np.intp), len(pieces) - 1)
    t = (at - index)[:, None]
    a, b, c, d = (pieces[index, i] for i in range(4))
    s = 1.0 - t
    positions: Array = s**3 * a + 3.0 * s**2 * t * b + 3.0 * s * t**2 * c + t**3 * d
    derivatives: Array = 3.0 * (s**2 * (b - a) + 2.0 * s * t * (c - b) + t**2 * (d - c))
    return positions, derivatives


def even_parameters(n_pieces: int, per_piece: int) -> Array:
    """Return parameters that divide each of ``n_pieces`` into ``per_piece`` parts, (n_pieces * per_piece + 1,)."""
    return np.linspace(0.0, n_pieces, n_pieces * per_piece + 1)


def nearest_parameter(pieces: Array, point: ArrayLike, per_piece: int = 32) -> tuple[float, float]:
    """Return the parameter of the sample of the curve nearest to ``point``, shape (2,), and its distance."""
    parameters = even_parameters(len(pieces), per_piece)
    positions, _ = curve_at(pieces, parameters)
    distances = np.hypot(*(positions - np.asarray(point, dtype=np.float64)).T)
    best = int(np.argmin(distances))
    return float(parameters[best]), float(distances[best])
