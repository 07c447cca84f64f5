"""Segments of the face that can vary on their own: eyes, nose, mouth, and the rest.

Coefficients of each segment give a whole head each; the segments' weights w_s, a smooth partition of unity over the
vertices, blend their offsets: x = S̄ + Σ_s w_s B b_s. The paper blends at borders with an image spline of several
resolutions (its section 3.4 after Burt and Adelson); where weights fall over centimetres, no seam is seen either.
With equal coefficients the blend is the head itself.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse import csgraph, linalg

from faceposer.geometry.deform import cotangent_laplacian
from faceposer.geometry.mesh import Floats, Ints

Array = NDArray[np.float64]

#: Names of the segments in order; the last takes what the others leave.
SEGMENT_NAMES = ("eyes", "nose", "mouth", "rest")
#: Beginnings of the names of the regions of a character around which each segment lies.
SEGMENT_REGIONS: Mapping[str, tuple[str, ...]] = {
    "eyes": ("eye_", "lids_", "brow_"),
    "nose": ("nose",),
    "mouth": ("lip_",),
}
#: Distances along the surface from these regions up to which a segment extends, in centimetres.
REACHES: Mapping[str, float] = {"eyes": 1.5, "nose": 0.8, "mouth": 2.0}
#: Length over which segments blend, in centimetres, and the number of steps of the diffusion, which make it smooth.
BLEND, _STEPS = 1.7, 3


@dataclass(frozen=True, eq=False)
class Segments:
    """A partition of unity over the vertices.

    Attributes:
        names: Names of the s segments.
        weights: Weight of each segment at each vertex, in [0, 1], which sum to 1 at each, shape (s, C).
    """

    names: tuple[str, ...]
    weights: Array

    def __post_init__(self) -> None:
        if self.weights.ndim != 2 or len(self.weights) != len(self.names):
            raise ValueError(f"{len(self.names)} segments, but weights of shape {self.weights.shape}")
        if not (self.weights >= 0.0).all() or not np.allclose(self.weights.sum(axis=0), 1.0, atol=1e-6):
            raise ValueError("the weights of the segments must not be negative, and sum to 1")

    def blend(self, offsets: Array) -> Array:
        """Return the blend, (C, 3), of the ``offsets`` that each segment gives all vertices, (s, C, 3)."""
        result: Array = np.einsum("sc,scd->cd", self.weights, offsets)
        return result

    def coefficients(self, whole: Array, of: Mapping[str, Array]) -> Array:
        """Return rows of coefficients, (s, K): those in ``of`` by the name of a segment, else ``whole``, (K,)."""
        return np.stack([np.asarray(of.get(name, whole), dtype=np.float64) for name in self.names])


def segments_of(vertices: Floats, quads: Ints, regions: Mapping[str, Sequence[int] | Ints]) -> Segments:
    """Return the segments of a head.

    Args:
        vertices: Positions in centimetres, shape (C, 3).
        quads: Quads, shape (F, 4).
        regions: Vertex ids of the regions of a character; those of other vertices are ignored.
    """
    positions = np.asarray(vertices, dtype=np.float64)
    apart = [np.full(len(positions), 1.0)]
    for name in SEGMENT_NAMES[:-1]:
        members = [np.asarray(ids) for region, ids in regions.items() if region.startswith(SEGMENT_REGIONS[name])]
        own = np.unique(np.concatenate(members))
        apart.append(_distances(positions, quads, own[own < len(positions)]) / REACHES[name])
    # The segment in whose reach a vertex is deepest, or the rest.
    nearest = np.argmin(apart, axis=0)
    indicators = np.stack([nearest == number for number in (1, 2, 3, 0)], axis=1).astype(np.float64)
    return Segments(SEGMENT_NAMES, _diffused(positions, quads, indicators).T)


def _diffused(vertices: Array, quads: Ints, values: Array) -> Array:
    """Return ``values``, (C, k), after implicit steps of heat: sums to 1, and signs, remain as they are.

    (A + t L) u' = A u with cotangent weights L, areas A and t = BLEND² / (2 n) in n steps.
    """
    laplacian, areas = cotangent_laplacian(vertices, quads[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3))
    mass = sparse.diags_array(areas)
    factors = linalg.splu((mass + BLEND**2 / (2 * _STEPS) * laplacian).tocsc())
    for _ in range(_STEPS):
        values = factors.solve(mass @ values)
    result = np.clip(values, 0.0, 1.0)
    return result / result.sum(axis=1, keepdims=True)


def _distances(vertices: Array, quads: Ints, sources: Ints) -> Array:
    """Return the distances along edges and diagonals of quads from the ``sources``, shape (C,)."""
    pairs = np.concatenate([quads[:, [a, b]] for a, b in ((0, 1), (1, 2), (2, 3), (3, 0), (0, 2), (1, 3))])
    pairs = np.unique(np.sort(pairs, axis=1), axis=0)
    lengths = np.linalg.norm(vertices[pairs[:, 0]] - vertices[pairs[:, 1]], axis=1)
    graph = sparse.csr_array((lengths, (pairs[:, 0], pairs[:, 1])), shape=(len(vertices), len(vertices)))
    found: Array = csgraph.dijkstra(graph, directed=False, indices=sources, min_only=True)
    return found
