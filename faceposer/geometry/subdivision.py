"""One step of Catmull-Clark subdivision, as one sparse matrix."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse


@dataclass(frozen=True)
class Subdivision:
    """A subdivided mesh of quads.

    Attributes:
        matrix: New positions = matrix @ old positions; shape (N', N). The first N rows are the old vertices, then
            come the edges' midpoints, then the faces' centres.
        quads: Four quads for each old one, in order, each starting at an old corner; shape (4 F, 4).
        split: New vertices as plain means of the old ones they come from, unsmoothed; shape (N', N).
        n_edge_points: End index of the midpoints of the edges in that order.
    """

    matrix: sparse.csr_array
    split: sparse.csr_array
    quads: NDArray[np.int32]
    n_edge_points: int


def catmull_clark(quads: NDArray[np.int32], n_vertices: int) -> Subdivision:
    """Subdivide once with the rules of Catmull and Clark (1978).

    Open borders follow the cubic B-spline rule independently of the interior, so that two meshes with the same border
    remain joined; a border vertex of a single quad is a corner and is not moved.

    Args:
        quads: Vertex ids, shape (F, 4).
        n_vertices: Number of vertices; each must be used.
    """
    edges, edge_of = _edges(quads)
    n_faces, n_edges = len(quads), len(edges)
    to_faces = _average(quads, n_vertices)
    to_midpoints = _average(edges, n_vertices)

    faces_at_edge = np.bincount(edge_of.ravel(), minlength=n_edges)
    if faces_at_edge.max() > 2:
        raise ValueError("an edge has more than two faces")
    border = faces_at_edge == 1
    face_sum_at_edge = sparse.coo_array(
        (np.ones(4 * n_faces), (edge_of.ravel(), np.repeat(np.arange(n_faces), 4))), shape=(n_edges, n_faces)
    )
    smooth_edge = 0.5 * to_midpoints + 0.25 * (face_sum_at_edge @ to_faces)
    to_edges = _rows(border) @ to_midpoints + _rows(~border) @ smooth_edge

    valence = np.bincount(edges.ravel(), minlength=n_vertices).astype(float)
    n_at_vertex = np.bincount(quads.ravel(), minlength=n_vertices).astype(float)
    if not n_at_vertex.all():
        raise ValueError("a vertex belongs to no face")
    on_border = np.zeros(n_vertices, dtype=bool)
    on_border[edges[border]] = True
    faces_mean = _mean_around(quads, n_vertices, n_faces) @ to_faces
    edges_mean = _mean_around(edges, n_vertices, n_edges) @ to_midpoints
    identity = sparse.eye_array(n_vertices)
    smooth = _rows(1.0 / valence) @ (faces_mean + 2.0 * edges_mean) + _rows((valence - 3.0) / valence) @ identity
    border_edges = edges[border]
    along_border = 0.75 * identity + 0.125 * sparse.coo_array(
        (np.ones(2 * len(border_edges)), (border_edges.ravel(), border_edges[:, ::-1].ravel())),
        shape=(n_vertices, n_vertices),
    )
    corner = on_border & (n_at_vertex == 1)
    to_vertices = _rows(~on_border) @ smooth + _rows(on_border & ~corner) @ along_border + _rows(corner) @ identity
    matrix = sparse.csr_array(sparse.vstack([to_vertices, to_edges, to_faces]))
    split = sparse.csr_array(sparse.vstack([identity, to_midpoints, to_faces]))
    return Subdivision(matrix, split, _split_quads(quads, edge_of, n_vertices, n_edges), n_vertices + n_edges)


def linear_split(quads: NDArray[np.int32], n_vertices: int) -> Subdivision:
    """Split each quad into the same four as `catmull_clark` does, without moving or smoothing anything."""
    edges, edge_of = _edges(quads)
    split = sparse.csr_array(
        sparse.vstack([sparse.eye_array(n_vertices), _average(edges, n_vertices), _average(quads, n_vertices)])
    )
    return Subdivision(split, split, _split_quads(quads, edge_of, n_vertices, len(edges)), n_vertices + len(edges))


def _edges(quads: NDArray[np.int32]) -> tuple[NDArray[np.int32], NDArray[np.intp]]:
    """Return the edges (E, 2) in lexicographic order and the edge that leaves each corner of each quad (F, 4)."""
    directed = np.stack([quads, np.roll(quads, -1, axis=1)], axis=-1)
    edges, index = np.unique(np.sort(directed, axis=-1).reshape(-1, 2), axis=0, return_inverse=True)
    return edges, index.reshape(quads.shape)


def _split_quads(
    quads: NDArray[np.int32], edge_of: NDArray[np.intp], n_vertices: int, n_edges: int
) -> NDArray[np.int32]:
    leaving = n_vertices + edge_of
    arriving = np.roll(leaving, 1, axis=1)
    centre = np.broadcast_to((n_vertices + n_edges + np.arange(len(quads)))[:, None], quads.shape)
    return np.stack([quads, leaving, centre, arriving], axis=-1).reshape(-1, 4).astype(np.int32)


def _average(groups: NDArray[np.int32], n_vertices: int) -> sparse.csr_array:
    n, size = groups.shape
    values = np.full(n * size, 1.0 / size)
    return sparse.csr_array((values, (np.repeat(np.arange(n), size), groups.ravel())), shape=(n, n_vertices))


def _mean_around(groups: NDArray[np.int32], n_vertices: int, n_groups: int) -> sparse.csr_array:
    """Return the matrix (N, G) that averages, for each vertex, the values of the groups (faces or edges) around it."""
    columns = np.repeat(np.arange(n_groups), groups.shape[1])
    count = np.bincount(groups.ravel(), minlength=n_vertices)
    return sparse.csr_array((1.0 / count[groups.ravel()], (groups.ravel(), columns)), shape=(n_vertices, n_groups))


def _rows(factors: NDArray[np.float64] | NDArray[np.bool_]) -> sparse.dia_array:
    return sparse.diags_array(factors.astype(float))
