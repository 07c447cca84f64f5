"""Harmonic filling: displacements of vertices without correspondence, from those around them."""

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse import linalg

from faceposer.geometry.mesh import Ints
from scripts.identity_building.scans import Floats

Mask = NDArray[np.bool_]


def links_of(quads: Ints, n_vertices: int) -> sparse.csr_array:
    """Return the matrix with 1 for each edge of ``quads``, shape (N, N)."""
    a, b = np.stack([quads, np.roll(quads, -1, axis=1)], axis=-1).reshape(-1, 2).T
    links = sparse.csr_array((np.ones(len(a)), (a, b)), shape=(n_vertices, n_vertices))
    links = links + links.T
    links.data[:] = 1.0
    return links


def eroded(known: Mask, links: sparse.csr_array, kept: Mask, rings: int = 1) -> Mask:
    """Return ``known`` without the vertices within ``rings`` edges of an unknown one; those of ``kept`` remain."""
    for _ in range(rings):
        known = known & ((links @ (~known).astype(float) == 0.0) | kept)
    return known


class Filler:
    """Harmonic continuation, in which each unknown vertex moves as the mean of its neighbours.

    Biharmonic continuation keeps the slope at the rim, which blows up in holes with narrow rims, as nostrils.
    """

    def __init__(self, known: Mask, links: sparse.csr_array) -> None:
        """Factorise the system of the vertices that are not ``known``, shape (N,)."""
        laplacian = sparse.csr_array(sparse.diags_array(links.sum(axis=1)) - links)
        self._known, self._unknown = np.flatnonzero(known), np.flatnonzero(~known)
        self._pull = laplacian[self._unknown][:, self._known]
        self._factors = linalg.splu(
            laplacian[self._unknown][:, self._unknown].tocsc(),
            permc_spec="MMD_AT_PLUS_A",
            diag_pivot_thresh=0.0,
            options={"SymmetricMode": True},
        )

    def __call__(self, displacements: Floats) -> Floats:
        """Return ``displacements``, (N, k), with the rows of the unknown vertices filled in."""
        result = displacements.copy()
        result[self._unknown] = self._factors.solve(-(self._pull @ displacements[self._known]))
        return result
