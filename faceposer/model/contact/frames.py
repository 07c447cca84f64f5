"""Parts of a character that move as one piece, and their motion in a pose."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse import csgraph

from faceposer.model.character import Character, Part

Array = NDArray[np.float64]
Ids = NDArray[np.intp]

# So many vertices, spread over a part, tell its motion.
_WITNESSES = 64
# Vertices move as one piece if an affine map predicts them to this share of the head's height in every shape.
_TOLERANCE = 1e-3


@dataclass(frozen=True, eq=False)
class AffineFrame:
    """The affine map y = linear (x - origin) + moved origin nearest to the motion of some vertices.

    Shapes that turn a rigid part are affine in its positions, and so are their sums: the map is then exact, while the
    nearest rigid motion is not.

    Attributes:
        ids: The vertices, shape (n,).
        witnesses: Those of them that the map is fitted to, shape (w,).
        origin: Centroid of the witnesses in the neutral face, shape (3,).
        solver: Pseudoinverse of the centred neutral witnesses, whose rows sum to 0, and below it their mean, (4, w).
    """

    ids: Ids
    witnesses: Ids
    origin: Array
    solver: Array

    @classmethod
    def of(cls, ids: Ids, neutral: NDArray[np.floating]) -> "AffineFrame":
        """Return the frame of the vertices ``ids`` of the ``neutral`` face, shape (N, 3)."""
        witnesses = ids[:: max(1, len(ids) // _WITNESSES)]
        points = neutral[witnesses].astype(np.float64)
        origin = points.mean(axis=0)
        mean = np.full((1, len(witnesses)), 1.0 / len(witnesses))
        return cls(ids, witnesses, origin, np.vstack([np.linalg.pinv(points - origin, rcond=1e-6), mean]))

    def motion(self, vertices: NDArray[np.floating]) -> tuple[Array, Array]:
        """Return the linear part, (3, 3), and the place of the origin, (3,), in the pose ``vertices``, (N, 3)."""
        return self.motion_of(vertices.take(self.witnesses, axis=0))

    def motion_of(self, places: NDArray[np.floating]) -> tuple[Array, Array]:
        """Return the same where the witnesses lie at ``places``, (w, 3)."""
        found = self.solver @ places.astype(np.float64)
        return found[:3].T, found[3]


def to_rest(points: Array, origin: Array, linear: Array, moved: Array) -> Array:
    """Return where ``points`` of the pose, (n, 3), lie relative to a part at rest."""
    back: Array = (points - moved) @ np.linalg.inv(linear).T + origin
    return back


def moves_as_one(character: Character, ids: Ids) -> bool:
    """Return whether the vertices ``ids`` move affinely in every shape of the ``character``."""
    points = character.vertices[ids].astype(np.float64)
    system = np.hstack([points - points.mean(axis=0), np.ones((len(ids), 1))])
    offsets = np.moveaxis(character.shapes[:, ids], 1, 0).reshape(len(ids), -1).astype(np.float64)
    basis, scale, _ = np.linalg.svd(system, full_matrices=False)
    basis = basis[:, scale > 1e-6 * scale[0]]
    left = offsets - basis @ (basis.T @ offsets)
    return float(np.abs(left).max(initial=0.0)) <= _TOLERANCE * character.height


def pieces(character: Character, part: Part) -> list[Ids]:
    """Return the connected pieces of ``part`` as vertex ids."""
    first, last = part.vertices
    run = slice(*character.part_triangles(part))
    corners = character.triangles[run] - first
    count = last - first
    ends = np.concatenate([corners[:, [0, 1]], corners[:, [1, 2]]])
    graph = sparse.coo_array((np.ones(len(ends), dtype=np.int8), ends.T), shape=(count, count))
    n_pieces, labels = csgraph.connected_components(graph, directed=False)
    return [first + np.flatnonzero(labels == k) for k in range(n_pieces)]


def group_by_motion(character: Character, candidates: Sequence[Ids]) -> list[Ids]:
    """Return unions of the ``candidates`` that each move as one, the largest candidate first."""
    groups: list[Ids] = []
    for ids in sorted(candidates, key=len, reverse=True):
        for number, group in enumerate(groups):
            if moves_as_one(character, np.concatenate([group, ids])):
                groups[number] = np.concatenate([group, ids])
                break
        else:
            groups.append(ids)
    return groups
