"""Parts of a character that move affinely, and their motion in a pose."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse import csgraph

from faceposer.model.character import Character, Part

Array = NDArray[np.float64]
Ids = NDArray[np.intp]

# Number of vertices, spread over a part, to which its motion is fitted.
_WITNESSES = 64
# Tolerance of an affine map of vertices in every shape, as a share of the head's height.
_TOLERANCE = 1e-3


@dataclass(frozen=True, eq=False)
class AffineFrame:
    """The affine map y = linear (x - origin) + moved origin that best fits the motion of some vertices.

    Displacements by shapes that rotate a rigid part are affine in its positions, and so are their sums. The affine map
    is then exact, unlike the nearest rigid motion.

    Attributes:
        ids: Vertex ids, shape (n,).
        witnesses: Subset of the vertices to which the map is fitted, shape (w,).
        origin: Centroid of the witnesses in the neutral face, shape (3,).
        solver: Matrix, shape (4, w): the pseudoinverse of the centred neutral witnesses, then a row that averages.
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
        """Return the linear part, (3, 3), and the moved origin, (3,), in the pose ``vertices``, (N, 3)."""
        return self.motion_of(vertices.take(self.witnesses, axis=0))

    def motion_of(self, places: NDArray[np.floating]) -> tuple[Array, Array]:
        """Return the same, given the positions ``places`` of the witnesses, (w, 3)."""
        found = self.solver @ places.astype(np.float64)
        return found[:3].T, found[3]


def to_rest(points: Array, origin: Array, linear: Array, moved: Array) -> Array:
    """Return ``points`` of the pose, (n, 3), in the rest frame of a part, (n, 3)."""
    back: Array = (points - moved) @ np.linalg.inv(linear).T + origin
    return back


def moves_affinely(character: Character, ids: Ids) -> bool:
    """Return True if the vertices ``ids`` move affinely in every shape of the ``character``."""
    points = character.vertices[ids].astype(np.float64)
    system = np.hstack([points - points.mean(axis=0), np.ones((len(ids), 1))])
    offsets = np.moveaxis(character.shapes[:, ids], 1, 0).reshape(len(ids), -1).astype(np.float64)
    basis, scale, _ = np.linalg.svd(system, full_matrices=False)
    basis = basis[:, scale > 1e-6 * scale[0]]
    residual = offsets - basis @ (basis.T @ offsets)
    return float(np.abs(residual).max(initial=0.0)) <= _TOLERANCE * character.height


def pieces(character: Character, part: Part) -> list[Ids]:
    """Return the vertex ids of each connected component of ``part``."""
    first, last = part.vertices
    run = slice(*character.part_triangles(part))
    corners = character.triangles[run] - first
    count = last - first
    ends = np.concatenate([corners[:, [0, 1]], corners[:, [1, 2]]])
    graph = sparse.coo_array((np.ones(len(ends), dtype=np.int8), ends.T), shape=(count, count))
    n_pieces, labels = csgraph.connected_components(graph, directed=False)
    return [first + np.flatnonzero(labels == k) for k in range(n_pieces)]


def group_by_motion(character: Character, candidates: Sequence[Ids]) -> list[Ids]:
    """Return unions of the ``candidates`` that move affinely together, merged in order of decreasing size."""
    groups: list[Ids] = []
    for ids in sorted(candidates, key=len, reverse=True):
        for number, group in enumerate(groups):
            if moves_affinely(character, np.concatenate([group, ids])):
                groups[number] = np.concatenate([group, ids])
                break
        else:
            groups.append(ids)
    return groups
