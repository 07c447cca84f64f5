"""The subdivided mesh of the shipped heads' skin: its control mesh, and rings and loops of vertices on it."""

from dataclasses import dataclass
from functools import cached_property
from typing import Self

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from faceposer.identity.anatomy.loops import edge_loop, faces_at_edges

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]


@dataclass(frozen=True, eq=False)
class Topology:
    """A mesh of quads subdivided once, in the order of Catmull-Clark meshes of the shipped heads.

    The vertices of the control mesh come first, then the midpoints of its edges, then the centres of its faces; every
    four quads come from one of the control mesh, each starting at an old corner.

    Attributes:
        fine: Vertex ids of the subdivided mesh, shape (4 F, 4).
        quads: Vertex ids of the control mesh, shape (F, 4).
        n_control: Number of its vertices, C.
        n_fine: Number of vertices of the subdivided mesh, N.
    """

    fine: Ints
    quads: Ints
    n_control: int
    n_fine: int

    @classmethod
    def of(cls, fine: Ints) -> Self:
        """Return the topology of the subdivided mesh ``fine``, shape (4 F, 4)."""
        quads = fine[:, 0].reshape(-1, 4)
        return cls(fine, quads, int(quads.max()) + 1, int(fine.max()) + 1)

    @cached_property
    def _midpoints(self) -> Ints:
        """The midpoint after each corner of each control quad, shape (F, 4)."""
        return self.fine[:, 1].reshape(-1, 4)

    @cached_property
    def split(self) -> sparse.csr_array:
        """New vertices as plain means of the control vertices that they come from, shape (N, C)."""
        n = self.n_control
        first, second = self.quads.ravel(), np.roll(self.quads, -1, axis=1).ravel()
        middle, index = np.unique(self._midpoints.ravel(), return_index=True)
        centre = np.repeat(self.fine[::4, 2], 4)
        rows = np.concatenate([np.arange(n), middle, middle, centre])
        columns = np.concatenate([np.arange(n), first[index], second[index], first])
        values = np.concatenate([np.ones(n), np.full(2 * len(middle), 0.5), np.full(len(centre), 0.25)])
        return sparse.csr_array((values, (rows, columns)), shape=(self.n_fine, n))

    def among(self, control: Ints) -> Ints:
        """Return the vertices that subdivision derives from the vertices ``control`` of the control mesh only."""
        share = np.zeros(self.n_control)
        share[control] = 1.0
        return np.flatnonzero(self.split @ share > 1.0 - 1e-9).astype(np.int32)

    def fine_loop(self, loop: Ints) -> Ints:
        """Return a closed loop of control vertices with the vertices that subdivision inserts."""
        middle = {
            frozenset((a, b)): m
            for corners, middles in zip(self.quads.tolist(), self._midpoints.tolist(), strict=True)
            for a, b, m in zip(corners, corners[1:] + corners[:1], middles, strict=True)
        }
        pairs = zip(loop.tolist(), np.roll(loop, -1).tolist(), strict=True)
        return np.array([vertex for a, b in pairs for vertex in (a, middle[frozenset((a, b))])], dtype=np.int32)

    def loop_through(self, start: int, vertices: Floats) -> Ints:
        """Return the loop of control vertices that leaves ``start`` sideways on the mesh with ``vertices``, (N, 3)."""
        faces_at = faces_at_edges(self.quads, range(len(self.quads)))
        return np.array(edge_loop(faces_at, vertices, start), dtype=np.int32)
