"""Scans of sampled identities, whose correspondence with our topology is known."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from faceposer.geometry.alignment import Similarity, rigid_alignment
from faceposer.geometry.mesh import TriangleMesh, VertexNormals
from faceposer.geometry.picking import SurfacePoints
from faceposer.model.character_file import load_character
from scripts.identity_building.learning import Learning
from scripts.identity_building.scans import N_SKIN
from scripts.identity_study.remeshing import holed, random_place, remeshed

Array = NDArray[np.float64]

# Holes in a scan: their number and their radius in centimetres; and height in which a scan is cut off.
_N_HOLES, _HOLE, _CUT = 3, 1.2, -12.0
# Hair: its thickness over the scalp, the height and the length of its waves, and the distance from the scalp within
# which it ends, in centimetres.
_HAIR, _WAVES, _WAVE, _HAIRLINE = 2.0, 0.4, 1.5, 1.0


@dataclass(frozen=True, eq=False)
class SampledScan:
    """A scan of a sampled identity.

    Attributes:
        mesh: The scan, in another unit and pose.
        place: The similarity from centimetres to it.
        truth: Places of our vertices on it, in centimetres, shape (N, 3); only those of `Scans.known` are known.
    """

    mesh: TriangleMesh
    place: Similarity
    truth: Array

    def in_centimetres(self, head: Array) -> Array:
        """Return ``head``, (N, 3), given in the unit and axes of the scan, upright and in centimetres."""
        return self.place.inverse().apply(head)


class SampledScans:
    """Maker of scans of identities sampled from all modes of the source."""

    def __init__(self, learning: Learning) -> None:
        """Prepare with the correspondence of our topology and the source."""
        people, carried = learning.people, learning.carried
        self.known = carried.known
        self._points: SurfacePoints = learning.correspondence.points
        self._mean, self._triangles = people.mean[:N_SKIN], people.triangles
        self._modes = people.modes[:, :N_SKIN].astype(np.float64)

    def scan(self, seed: int, count: int, damaged: bool = False, hair: bool = False) -> SampledScan:
        """Return a scan of about ``count`` vertices; with holes and cut off at the neck if ``damaged``.

        With ``hair``, the scalp is covered by a cap of waves, 2 cm thick.
        """
        rng = np.random.default_rng(seed)
        head = self._mean + np.tensordot(rng.standard_normal(len(self._modes)), self._modes, 1)
        mesh = remeshed(TriangleMesh(head, self._triangles), count, seed)
        if hair:
            man = load_character("man")
            scalp = man.regions["scalp"][man.regions["scalp"] < len(self.known)]
            mesh = with_hair(mesh, self._points.positions(head, self._triangles)[scalp[self.known[scalp]]], seed)
        if damaged:
            vertices = np.asarray(mesh.vertices)
            front = vertices[vertices[:, 2] > 4.0]
            mesh = holed(mesh, front[rng.choice(len(front), _N_HOLES)], _HOLE)
            low = vertices[:, 1].max() + 2.0 * _CUT
            mesh = holed(mesh, vertices[vertices[:, 1] < low], 0.3)
        place = random_place(rng)
        truth = self._points.positions(head, self._triangles)
        return SampledScan(TriangleMesh(place.apply(mesh.vertices), mesh.triangles), place, truth)


def with_hair(mesh: TriangleMesh, scalp: Array, seed: int) -> TriangleMesh:
    """Return ``mesh`` with a cap of hair over the places ``scalp``, (s, 3), which end within it."""
    vertices = np.asarray(mesh.vertices, dtype=np.float64)
    normals = VertexNormals(mesh.triangles, len(vertices))(vertices)
    apart, _ = cKDTree(scalp).query(vertices)
    rng = np.random.default_rng(seed)
    directions, phases = rng.normal(size=(3, 8)) / _WAVE, rng.uniform(0.0, 2.0 * np.pi, size=8)
    height = _HAIR + _WAVES * np.sin(vertices @ directions + phases).mean(axis=1) * np.sqrt(8.0)
    height *= np.clip(1.0 - apart / _HAIRLINE, 0.0, 1.0)
    return TriangleMesh(vertices + height[:, None] * normals, mesh.triangles)


def vertex_errors(head: Array, truth: Array, chosen: NDArray[np.bool_]) -> Array:
    """Return the distances of the ``chosen`` vertices in millimetres, after the similarity of least squares."""
    moved = rigid_alignment(head[chosen], truth[chosen], scale=True).apply(head[chosen])
    return 10.0 * np.linalg.norm(moved - truth[chosen], axis=1)
