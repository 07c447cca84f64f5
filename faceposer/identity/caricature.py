"""Distinctiveness of heads: the average, the person, the caricature.

A head is the average plus what distinguishes the person; scaling the latter gives anti-caricatures and caricatures
(S. E. Brennan, "Caricature generator", Leonardo 18, 1985; Blanz and Vetter, "A morphable model for the synthesis of 3D
faces", SIGGRAPH 1999, section 2). All of a head counts, also what the modes do not explain.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from faceposer.errors import FacePoserError
from faceposer.geometry.alignment import rigid_alignment
from faceposer.identity.model import IdentityModel

Array = NDArray[np.float64]

#: Factors at which caricatures are still people, and beyond which they are grotesque.
NATURAL, GROTESQUE = 1.7, 2.5


def distinctiveness(model: IdentityModel, coefficients: ArrayLike) -> float:
    """Return how distinctive a head is: 0 for the average, 1 for a typical person.

    It is the root mean square of the coefficients, shape (K,) in standard deviations, or of one row for each segment.
    """
    given = np.asarray(coefficients, dtype=np.float64)
    rows = np.atleast_2d(given)
    return float(np.sqrt(np.square(rows).sum(axis=1).mean() / model.n_coefficients))


def with_distinctiveness(model: IdentityModel, coefficients: ArrayLike, wanted: float) -> Array:
    """Return ``coefficients`` scaled to a `distinctiveness` of ``wanted``; those of the average stay as they are."""
    given = np.asarray(coefficients, dtype=np.float64)
    _check(wanted)
    now = distinctiveness(model, given)
    return given * (wanted / now) if now > 0.0 else given.copy()


def exaggerated(model: IdentityModel, skin: ArrayLike, factor: float, weights: ArrayLike | None = None) -> Array:
    """Return a skin with its difference from the average scaled, where it is in space.

    Args:
        model: The model, whose average it is.
        skin: A head of its topology, shape (N, 3).
        factor: 0 for the average, 1 for the head itself, more for caricatures.
        weights: Share of each vertex in the alignment with the average, shape (N,); all alike if None.

    Raises:
        FacePoserError: If the factor is negative or not finite, or the skin has another number of vertices.
    """
    _check(factor)
    points, average = np.asarray(skin, dtype=np.float64), model.instance(np.zeros(model.n_coefficients))
    if points.shape != average.shape or not np.isfinite(points).all():
        raise FacePoserError(f"A head must have {len(average)} finite positions.")
    to_average = rigid_alignment(points, average, weights)
    difference = to_average.apply(points) - average
    result: Array = points + to_average.inverse().apply_to_directions((factor - 1.0) * difference)
    return result


def _check(factor: float) -> None:
    if not (np.isfinite(factor) and factor >= 0.0):
        raise FacePoserError(f"The distinctiveness must be 0 or more, not {factor}.")
