"""Deformation of a surface by handles: the smoothest displacement that interpolates them.

Linear variational deformation (Botsch and Sorkine, "On linear variational surface deformation methods", TVCG 14, 2008,
section 3): of all displacements that interpolate the handles, the one with the least bending and stretching, the
integrals of its squared Laplacian and gradient. It acts along the surface, so that touching lips can part.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import sparse
from scipy.sparse import csgraph, linalg

from faceposer.geometry.mesh import Floats, Ints
from faceposer.geometry.picking import SurfacePoints

Array = NDArray[np.float64]

# Cotangents of angles below three degrees are limited, as they belong to slivers.
_LARGEST_COTANGENT = 20.0
_SMALLEST_WEIGHT = 1e-3
_SMALLEST_AREA = 1e-3
# Default reach as a share of the diagonal of the handles' bounding box, and stiffness against stretching over that
# distance; see the measurements in docs/training.md.
_REACH = 1.0 / 6.0
_STRETCHING = 8.0


class MarkerDeformer:
    """Deformation of a surface by handles, for any number of frames.

    The displacements of all vertices are linear in those of the handles. The system is factorised once and solved once
    per handle; each frame is then a product with an (N, H) matrix.

    Attributes:
        weights: Displacement of each vertex per displacement of each handle, shape (N, H).
        places: Positions of the handles at rest, shape (H, 3).
        n_handles: Number H of handles.
    """

    def __init__(
        self,
        vertices: Floats,
        triangles: Ints,
        handles: SurfacePoints | ArrayLike,
        reach: float | None = None,
    ) -> None:
        """Factorise the system of a surface.

        Vertices at the same position, as along texture seams, move together. Components of the surface without a handle
        do not move.

        Args:
            vertices: Positions at rest, shape (N, 3).
            triangles: Vertex ids, shape (T, 3).
            handles: H points on the surface, or vertex ids, shape (H,).
            reach: Distance along edges from the nearest handle beyond which vertices do not move; unlimited if
                infinite. By default, a sixth of the diagonal of the handles' bounding box, or more if they are far
                apart.

        Raises:
            ValueError: If there is no handle, a handle is not on the surface, or two are at the same place.
        """
        points = handles if isinstance(handles, SurfacePoints) else SurfacePoints.at_vertices(np.asarray(handles))
        self._vertices = np.asarray(vertices, dtype=np.float64)
        corners, weights = _corners(points, np.asarray(triangles), len(vertices))
        nodes, node_of = np.unique(self._vertices, axis=0, return_inverse=True)
        node_of = node_of.reshape(-1)
        faces = node_of[np.asarray(triangles)]
        proper = (faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 2] != faces[:, 0])
        faces = faces[proper]

        self.n_handles = len(corners)
        self.places: Array = np.einsum("hc,hck->hk", weights, self._vertices[corners])
        if len(np.unique(self.places, axis=0)) < self.n_handles:
            raise ValueError("two handles are at the same place")
        rows = np.repeat(np.arange(self.n_handles), 3)
        select = sparse.csr_array(
            (weights.ravel(), (rows, node_of[corners].ravel())), shape=(self.n_handles, len(nodes))
        )
        reach = _default_reach(self.places) if reach is None else reach
        energy = _energy(nodes, faces, _STRETCHING / reach**2)
        distances = _distances(nodes, faces, np.unique(node_of[corners[weights > 0.0]]))
        free = np.flatnonzero((distances <= reach) & np.isfinite(distances))
        self.weights = np.zeros((len(nodes), self.n_handles))
        self.weights[free], self._stiffness = _responses(energy[free][:, free], select[:, free])
        self.weights = self.weights[node_of]

    def complete(self, displacements: ArrayLike) -> Array:
        """Return the handles' ``displacements``, (..., H, 3), with NaN inferred from the other handles.

        A missing handle moves freely with the surface that the others deform.

        Raises:
            ValueError: If the shape does not match, or all handles of a frame are missing.
        """
        filled = np.array(displacements, dtype=np.float64)
        if filled.shape[-2:] != (self.n_handles, 3):
            raise ValueError(f"displacements must be (..., {self.n_handles}, 3), not {filled.shape}")
        frames = filled.reshape(-1, self.n_handles, 3)
        missing = np.asarray(~np.isfinite(frames).all(axis=2))
        for pattern in np.unique(missing[missing.any(axis=1)], axis=0):
            of_pattern = (missing == pattern).all(axis=1)
            if pattern.all():
                raise ValueError("a frame without any handle cannot be completed")
            pull = self._stiffness[np.ix_(pattern, ~pattern)]
            gain = -np.linalg.solve(self._stiffness[np.ix_(pattern, pattern)], pull)
            frames[np.ix_(of_pattern, pattern)] = gain @ frames[np.ix_(of_pattern, ~pattern)]
        return filled

    def displaced(self, displacements: ArrayLike) -> Array:
        """Return the vertices, (..., N, 3), for ``displacements`` of the handles, (..., H, 3), NaN if unknown."""
        filled = self.complete(displacements)
        frames = filled.reshape(-1, self.n_handles, 3)
        # A single product of large matrices is several times faster than one per frame with three columns.
        moved = self.weights @ np.moveaxis(frames, 1, 0).reshape(self.n_handles, -1)
        vertices = np.moveaxis(moved.reshape(len(self.weights), len(frames), 3), 1, 0) + self._vertices
        return vertices.reshape(*filled.shape[:-2], -1, 3)

    def __call__(self, targets: ArrayLike) -> Array:
        """Return the vertices, (..., N, 3), with the handles at ``targets``, (..., H, 3), NaN if unknown."""
        return self.displaced(np.asarray(targets, dtype=np.float64) - self.places)


def _corners(points: SurfacePoints, triangles: Ints, n_vertices: int) -> tuple[NDArray[np.intp], Array]:
    faces = points.faces
    if not len(faces):
        raise ValueError("at least one handle is needed")
    if faces.max() >= len(triangles) or (-1 - faces.min()) >= n_vertices:
        raise ValueError("a handle refers to a triangle or vertex that does not exist")
    is_vertex = faces < 0
    corners = np.empty((len(faces), 3), dtype=np.intp)
    corners[is_vertex] = -1 - faces[is_vertex, None]
    corners[~is_vertex] = triangles[faces[~is_vertex]]
    return corners, np.asarray(points.barycentric, dtype=np.float64)


def _distances(nodes: Array, faces: Ints, sources: Ints) -> Array:
    """Return the length of the shortest path along edges to any of the ``sources``, infinite if there is none."""
    edges = np.unique(np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1), axis=0)
    lengths = np.linalg.norm(nodes[edges[:, 0]] - nodes[edges[:, 1]], axis=1)
    graph = sparse.csr_array((lengths, (edges[:, 0], edges[:, 1])), shape=(len(nodes), len(nodes)))
    distances: Array = csgraph.dijkstra(graph, directed=False, indices=sources, min_only=True)
    return distances


def _default_reach(places: Array) -> float:
    """Return a share of the handles' extent, but at least their median spacing."""
    if len(places) == 1:
        return np.inf
    between = np.linalg.norm(places[:, None] - places[None], axis=2)
    np.fill_diagonal(between, np.inf)
    return max(_REACH * float(np.linalg.norm(np.ptp(places, axis=0))), float(np.median(between.min(axis=1))))


def cotangent_laplacian(nodes: Array, faces: Ints) -> tuple[sparse.csr_array, Array]:
    """Return the Laplacian L with cotangent weights, positive semidefinite, shape (n, n), and lumped areas, shape (n,).

    Weights of edges opposite to obtuse angles are positive, too, and no area is 0.

    Args:
        nodes: Positions, shape (n, 3).
        faces: Vertex ids of triangles, shape (T, 3).
    """
    n = len(nodes)
    weights = np.zeros(0)
    ends = np.zeros((0, 2), dtype=np.intp)
    areas = np.zeros(n)
    for corner in range(3):
        at, a, b = (faces[:, (corner + k) % 3] for k in range(3))
        u, v = nodes[a] - nodes[at], nodes[b] - nodes[at]
        twice_area = np.linalg.norm(np.cross(u, v), axis=1)
        dots = np.einsum("tk,tk->t", u, v)
        floor = np.maximum(np.abs(dots) / _LARGEST_COTANGENT, np.finfo(float).tiny)
        weights = np.concatenate([weights, 0.5 * dots / np.maximum(twice_area, floor)])
        ends = np.concatenate([ends, np.stack([a, b], axis=1)])
        areas += np.bincount(at, twice_area / 6.0, minlength=n)
    graph = sparse.coo_array((weights, (ends[:, 0], ends[:, 1])), shape=(n, n)).tocsr()
    graph = (graph + graph.T).tocsr()
    # Negative weights, of edges opposite to obtuse angles, would cause oscillations.
    graph.data = np.maximum(graph.data, _SMALLEST_WEIGHT)
    laplacian = sparse.dia_array((graph.sum(axis=1)[None, :], [0]), shape=(n, n)).tocsr() - graph
    used = areas > 0.0
    least = _SMALLEST_AREA * float(areas[used].mean()) if used.any() else 1.0
    return laplacian, np.maximum(areas, least)


def _energy(nodes: Array, faces: Ints, stretching: float) -> sparse.csr_array:
    """Return L' M^-1 L + ``stretching`` L, with cotangent weights L and lumped areas M, shape (n, n)."""
    laplacian, areas = cotangent_laplacian(nodes, faces)
    masses = sparse.dia_array((1.0 / areas[None, :], [0]), shape=(len(nodes), len(nodes)))
    return (laplacian.T @ masses @ laplacian + stretching * laplacian).tocsr()


def _responses(energy: sparse.csr_array, select: sparse.csr_array) -> tuple[Array, Array]:
    """Return the fields of least ``energy`` per unit of each handle, (n, H), and the energy over handles, (H, H).

    With A = energy + w S'S, the least energy subject to S x = d is at x = A^-1 S' (S A^-1 S')^-1 d for any w, since the
    added term is constant under the constraint. A is positive definite, unlike the energy alone.
    """
    stiff = float(energy.diagonal().mean())
    system = (energy + stiff * (select.T @ select)).tocsc()
    factors = linalg.splu(system, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
    reactions = factors.solve(select.T.toarray())
    compliance = select @ reactions
    stiffness = np.linalg.inv(0.5 * (compliance + compliance.T))
    return reactions @ stiffness, stiffness - stiff * np.eye(len(stiffness))
