"""Composition of emotional and verbal keys by the importance of each vertex for speech.

Pyun et al., "An example-based approach for facial expression cloning", SCA 2003, section 2 and appendix. The control
parameters, which the paper leaves open, were chosen on pictures of the built-in characters.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from faceposer.errors import FacePoserError

Array = NDArray[np.float64]
#: Rule where verbal and emotional keys meet: "switch" at the importance .5 as in the paper, or "smooth".
Meeting = Literal["switch", "smooth"]

# S1, S2, and L_p and L_e as shares of the height of the head.
_SPREADS_ABOVE, _VERBAL_ABOVE, _VERBAL_REACH, _EMOTIONAL_REACH = 0.2, 0.5, 0.06, 0.03
# Half the range of importance over which the smooth rule passes from one kind to the other.
_HALF_RANGE = 0.35
# Displacements below this share of the height have no direction.
_ZERO = 1e-9
_SMOOTHINGS = 12


@dataclass(frozen=True, eq=False)
class Importance:
    """Importance of the vertices of a face for speech, after each step of the appendix; all are from 0 to 1.

    Attributes:
        verbal: Largest displacements over the verbal keys, relative to the largest of all, p_1, shape (N,).
        emotional: The same over the emotional keys, e_1, shape (N,).
        verbal_spread: p_2: large values spread to vertices near them, shape (N,).
        emotional_spread: e_2, shape (N,).
        values: The importance alpha (eq. (13)), shape (N,).
    """

    verbal: Array
    emotional: Array
    verbal_spread: Array
    emotional_spread: Array
    values: Array


def importance(
    vertices: ArrayLike, verbal: Iterable[ArrayLike], emotional: Iterable[ArrayLike], height: float
) -> Importance:
    """Return the importance of the vertices of a face for speech.

    Args:
        vertices: Neutral positions, shape (N, 3).
        verbal: Displacements in the verbal keys, each of shape (N, 3).
        emotional: Displacements in the emotional keys, each of shape (N, 3).
        height: Height of the head in the unit of the vertices.

    Raises:
        FacePoserError: If the keys of a kind are missing, or move nothing.
    """
    positions = np.asarray(vertices, dtype=np.float64)
    p1, e1 = (_largest(keys, len(positions), kind) for keys, kind in ((verbal, "verbal"), (emotional, "emotional")))
    p2, e2 = _spread(positions, p1, _VERBAL_REACH * height), _spread(positions, e1, _EMOTIONAL_REACH * height)
    values = np.where(p2 < _VERBAL_ABOVE, p2 * (1.0 - e2), 1.0 - (1.0 - p2) * e2)
    return Importance(p1, e1, p2, e2, values)


def _largest(keys: Iterable[ArrayLike], count: int, kind: str) -> Array:
    # One key at a time: all of them in double precision would need much memory.
    largest = np.zeros(count)
    for key in keys:
        largest = np.maximum(largest, np.linalg.norm(np.asarray(key, dtype=np.float64), axis=1))
    if not largest.max(initial=0.0) > 0.0:
        tag = {"verbal": "viseme", "emotional": "expression"}[kind]
        raise FacePoserError(
            f"There are no {kind} keys that move the face, so that none can be composed; give poses the tag '{tag}'."
        )
    result: Array = largest / largest.max()
    return result


def _spread(vertices: Array, values: Array, reach: float) -> Array:
    """Return the largest of the ``values`` above S1 within ``reach`` of each vertex, or its own, shape (N,)."""
    from scipy.spatial import cKDTree

    important = np.flatnonzero(values > _SPREADS_ABOVE)
    spread = values.copy()
    if not len(important):
        return spread
    tree = cKDTree(vertices)
    # From the least to the greatest, so that the greatest remains.
    order = important[np.argsort(values[important])]
    for source, near in zip(order, tree.query_ball_point(vertices[order], reach), strict=True):
        spread[near] = np.maximum(spread[near], values[source])
    return spread


def composed(
    emotional: ArrayLike, verbal: ArrayLike, alpha: ArrayLike, meeting: Meeting = "smooth", height: float = 1.0
) -> Array:
    """Return the displacements of an emotional and a verbal key combined, shape (N, 3).

    Where a vertex is important for speech, the verbal displacement remains, and the part of the emotional one
    perpendicular to it is added with the weight 1 - alpha; elsewhere the roles are exchanged (section 2).

    Args:
        emotional: Displacements in the emotional key, shape (N, 3).
        verbal: Displacements in the verbal key, shape (N, 3).
        alpha: Importance of each vertex for speech, shape (N,).
        meeting: "switch" between both rules at alpha = .5, where neighbours may jump apart, or "smooth" for a gradual
            transition between them.
        height: Height of the head; much smaller displacements have no direction.
    """
    e, p = np.asarray(emotional, dtype=np.float64), np.asarray(verbal, dtype=np.float64)
    a = np.asarray(alpha, dtype=np.float64)[:, None]
    least = _ZERO * height
    speaking = p + (1.0 - a) * _perpendicular(e, p, least)
    feeling = e + a * _perpendicular(p, e, least)
    if meeting == "switch":
        return np.where(a >= 0.5, speaking, feeling)
    share = np.clip((a - 0.5) / (2.0 * _HALF_RANGE) + 0.5, 0.0, 1.0)
    share = share * share * (3.0 - 2.0 * share)
    return share * speaking + (1.0 - share) * feeling


def _perpendicular(moved: Array, to: Array, least: float) -> Array:
    """Return the parts of the vectors ``moved``, (N, 3), perpendicular to ``to``; all of it where ``to`` is zero."""
    squares = np.einsum("nd,nd->n", to, to)
    along = np.einsum("nd,nd->n", moved, to) / np.maximum(squares, least**2 + 1e-300)
    return moved - np.where(squares > least**2, along, 0.0)[:, None] * to


def smoothed(values: ArrayLike, triangles: NDArray[np.integer]) -> Array:
    """Return ``values`` of vertices, (N,), averaged with their neighbours on the mesh of ``triangles``, (T, 3).

    Spreading by a distance makes the importance jump at its end, which the smooth rule cannot mend.
    """
    from scipy import sparse

    result = np.asarray(values, dtype=np.float64)
    ends = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    ends = np.concatenate([ends, ends[:, ::-1]])
    count = len(result)
    links = sparse.csr_array((np.ones(len(ends)), (ends[:, 0], ends[:, 1])), shape=(count, count))
    links.data[:] = 1.0
    degree = np.asarray(links.sum(axis=1)).ravel()
    for _ in range(_SMOOTHINGS):
        around = np.where(degree > 0, (links @ result) / np.maximum(degree, 1.0), result)
        result = 0.5 * (result + around)
    return result


def tear(displacements: ArrayLike, vertices: ArrayLike, triangles: NDArray[np.integer]) -> Array:
    """Return how much the edges of a mesh stretch or shrink under ``displacements``, (N, 3), as |log ratio|, (3 T,)."""
    rest = np.asarray(vertices, dtype=np.float64)
    moved = rest + np.asarray(displacements, dtype=np.float64)
    ends = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    before, after = (np.linalg.norm(x[ends[:, 0]] - x[ends[:, 1]], axis=1) for x in (rest, moved))
    proper = before > 0.0
    ratios: Array = np.abs(np.log(np.maximum(after[proper], 1e-12) / before[proper]))
    return ratios
