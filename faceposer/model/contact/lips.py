"""The skin in front of a dental arch: the outer skin, and the inside of the lips that an open mouth reveals."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse import csgraph

from faceposer.model.character import Character
from faceposer.model.contact.arches import FINE, DentalArch, radius_raster
from faceposer.model.contact.lids import skin_ids
from faceposer.model.contact.samples import SurfaceSamples, lattice

Array = NDArray[np.float64]
Ids = NDArray[np.intp]

# Shares of the head's height: reach of the search in front of the teeth and beyond their ends, depth of the outer skin
# behind the outermost surface, and width of the inside of the lips from their rim.
_REACH, _BEYOND, _OUTERMOST, _INSIDE = 0.12, 0.08, 0.006, 0.025
# Length of an edge from which its triangles are sampled more finely, as a share of the head's height.
_LARGE = 0.02


@dataclass(frozen=True, eq=False)
class Covering:
    """The skin that covers the teeth of an arch in the neutral face, as vertex ids in ascending order.

    Attributes:
        outer: The outer skin, shape (n,).
        lips: The outer skin and the inside of the lips, shape (m,).
    """

    outer: Ids
    lips: Ids


def find_covering(character: Character, arch: DentalArch) -> Covering:
    """Return the skin of the ``character`` that covers ``arch``; empty if there is none."""
    skin = skin_ids(character)
    points = character.vertices[skin].astype(np.float64)
    size = character.height
    beyond = _BEYOND * size
    gap = arch.gap(points)
    level = (points[:, 1] > arch.bottom - beyond) & (points[:, 1] < arch.top + beyond)
    near = skin[level & (gap >= 0.0) & (gap < _REACH * size)]
    if not len(near):
        return Covering(near, near)
    all_skin = triangles_with_any(character, skin[level & np.isfinite(gap)])
    row = arch.coarse_row
    rows = int(np.ceil((arch.top - arch.bottom + 2.0 * beyond) / row)) + 1
    bottom = arch.bottom - beyond
    surface = lattice(character.vertices[all_skin].astype(np.float64), 0.8 * row)
    outermost = radius_raster(surface, arch.axis, bottom, row, rows)
    place, height, radius = arch.cylinder(character.vertices[near].astype(np.float64))
    column = np.clip(np.round(place / FINE).astype(np.intp), 0, outermost.shape[0] - 1)
    line = np.clip(np.round((height - bottom) / row).astype(np.intp), 0, rows - 1)
    outer = near[radius > outermost[column, line] - _OUTERMOST * size]
    from_outer = surface_distance(character, outer, _INSIDE * size)
    return Covering(outer, near[from_outer[near] < np.inf])


def skin_samples(character: Character, ids: Ids) -> SurfaceSamples:
    """Return samples of the vertices ``ids`` and of the triangles among them."""
    return SurfaceSamples.of(character.vertices, triangles_among(character, ids), ids, _LARGE * character.height)


def triangles_among(character: Character, ids: Ids) -> NDArray[np.int32]:
    """Return the triangles of the ``character`` with all corners in ``ids``, shape (F, 3)."""
    return character.triangles[_vertex_mask(character, ids)[character.triangles].all(axis=1)]


def triangles_with_any(character: Character, ids: Ids) -> NDArray[np.int32]:
    """Return the triangles of the ``character`` with any corner in ``ids``, shape (F, 3)."""
    return character.triangles[_vertex_mask(character, ids)[character.triangles].any(axis=1)]


def with_neighbours(character: Character, ids: Ids) -> Ids:
    """Return the vertices ``ids`` and those that share a triangle with them, in ascending order."""
    neighbours: Ids = np.unique(triangles_with_any(character, ids)).astype(np.intp)
    return np.union1d(ids, neighbours)


def _vertex_mask(character: Character, ids: Ids) -> NDArray[np.bool_]:
    chosen = np.zeros(len(character.vertices), dtype=bool)
    chosen[ids] = True
    return chosen


def surface_distance(character: Character, sources: Ids, limit: float) -> Array:
    """Return the length of the shortest path along neutral edges from ``sources`` to each vertex, shape (N,).

    Lengths beyond ``limit`` are infinite.
    """
    graph = _edge_graph(character)
    distances: Array = csgraph.dijkstra(graph, directed=False, indices=sources, min_only=True, limit=limit)
    return distances


@lru_cache(maxsize=2)
def _edge_graph(character: Character) -> sparse.csr_array:
    """Return the lengths of all edges and of both diagonals of quads, for left-right symmetry, shape (N, N)."""
    corners, positions = character.polygons.astype(np.int64), character.vertices.astype(np.float64)
    pairs = ((0, 1), (1, 2), (2, 3), (3, 0), (0, 2), (1, 3))
    ends = np.concatenate([corners[:, pair] for pair in pairs])
    ends = ends[(ends >= 0).all(axis=1)]
    count = len(positions)
    first, second = np.divmod(np.unique(ends.min(axis=1) * count + ends.max(axis=1)), count)
    lengths = np.maximum(np.linalg.norm(positions[first] - positions[second], axis=1), 1e-9)
    return sparse.csr_array((lengths, (first, second)), shape=(count, count))
