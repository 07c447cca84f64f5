"""The lining of the mouth below the lips, which stays inside the skin."""

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.spatial import cKDTree

from faceposer.identity.template import HeadTemplate

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

#: Distance of the lining below the middle of the lips, its radius around that and half its width, and the radius of the
#: skin that covers it; all in centimetres.
_BELOW, _RADIUS, _HALF_WIDTH, _COVER_RADIUS = 0.5, 13.0, 4.5, 16.0
#: Distances from the contact of the lips beyond which the lining and the skin do not belong to them, in centimetres.
_LINING_FROM_LIPS, _SKIN_FROM_LIPS = 0.55, 0.8
#: Number of places of the skin in front whose tangent planes tell the depth below it, and distance along the skin from
#: them beyond which their planes say nothing, in centimetres.
_PLANES, _ALONG = 4, 0.9
#: Depth below which expressions may bring the lining through the skin.
_SHALLOW = 1.0
#: Least depth at rest, unless the reference's lining has less; what is added to what a head lacks, so that something is
#: left for expressions, at most, and per lack; least depth over the open jaw of mouthClose; all in centimetres.
_AT_REST, _RESERVE, _STEEP, _OVER_JAW = 0.25, 0.15, 4.0, 0.15
#: Motion of the lining below which a shape is left as it is, in centimetres.
_STILL = 1e-3
#: Share of the depth that the reference's lining loses in a shape that other heads' may lose, since such losses add up.
_LOSS = 0.6
#: Weaker strengths of a shape in which the depth is looked at, too: places of the skin that a strong shape moves far
#: along tell nothing about the depth.
_MIDWAY = (0.25, 0.5)


class Lining:
    """Lining of the mouth of a reference head, for keeping that of other heads of the same topology inside the skin.

    Attributes:
        ids: Its vertices, shape (n,).
        shallow: Indices into ``ids`` of those that are close below the skin, shape (s,).
    """

    def __init__(self, template: HeadTemplate, skin: Floats, outer: Ints, contact: Ints) -> None:
        """Find the lining below the lips, and the skin that covers it.

        Args:
            template: Topology of the skin.
            skin: The reference's skin, shape (N, 3).
            outer: Its visible vertices.
            contact: The loop where the lips touch.
        """
        away = skin - skin[contact].mean(axis=0)
        distance, from_lips = np.linalg.norm(away, axis=1), cKDTree(skin[contact]).query(skin)[0]
        hidden = (distance < _RADIUS) & (away[:, 1] < -_BELOW) & (np.abs(away[:, 0]) < _HALF_WIDTH)
        hidden[outer] = False
        self.ids = np.flatnonzero(hidden & (from_lips > _LINING_FROM_LIPS)).astype(np.int32)
        covers = (distance < _COVER_RADIUS) & (away[:, 1] < 0.0) & (from_lips > _SKIN_FROM_LIPS)
        candidates = outer[covers[outer]]
        self._around = _Cover(template.quads, candidates, len(skin))
        in_front = cKDTree(skin[candidates]).query(skin[self.ids], k=_PLANES)[1]
        self._reference_depth, _ = self._around.depth(skin, self.ids, in_front)
        self.shallow = np.flatnonzero(self._reference_depth < _SHALLOW)
        used, index = np.unique(in_front[self.shallow], return_inverse=True)
        self._in_front = _Cover(template.quads, candidates[used], len(skin))
        self._in_front_of = index.reshape(-1, _PLANES)

    def depth(self, skin: Floats) -> Floats:
        """Return how far the vertices `shallow` of a posed ``skin``, (N, 3), are below what covers them, shape (s,).

        It is the least distance from the tangent planes of the places that are nearest in the reference, negative
        outside. Those that are nearest in a pose may belong to lips that fold over.
        """
        return self._shallow_depth(skin)[0]

    def inside(self, skin: Floats) -> Floats:
        """Return the neutral ``skin`` (N, 3) with its lining below it."""
        result = skin.copy()
        self._lower(result, self.shallow, *self._shallow_depth(result))
        nearest = cKDTree(skin[self._around.ids]).query(result[self.ids], k=_PLANES)[1]
        self._lower(result, np.arange(len(self.ids)), *self._around.depth(result, self.ids, nearest))
        return result

    def behind(self, skin: Floats, opening: Floats, closing: Floats) -> Floats:
        """Return mouthClose, ``closing`` (N, 3), with the lining of ``skin`` below it together with jawOpen."""
        depth, inwards = self._shallow_depth(skin + opening + closing)
        lack = np.maximum(np.minimum(self._reference_depth[self.shallow], _OVER_JAW) - depth, 0.0)
        result = closing.copy()
        result[self.ids[self.shallow]] += lack[:, None] * inwards
        return result

    def losses(self, skin: Floats, shapes: Floats) -> Floats:
        """Return the depth that `shallow` of ``skin``, (N, 3), loses in each of ``shapes``, (S, N, 3), shape (S, s)."""
        rest = self.depth(skin)
        return np.stack([rest - self.depth(skin + offsets) for offsets in shapes])

    def losing_less(self, skin: Floats, shapes: Floats, losses: Floats) -> Floats:
        """Return ``shapes`` (S, N, 3) of ``skin``, in which the lining loses less than the reference's ``losses``."""
        rest, result = self.depth(skin), shapes.copy()
        for k in np.flatnonzero(np.abs(shapes[:, self.ids]).max(axis=(1, 2)) > _STILL):
            allowed = _LOSS * np.maximum(losses[k], 0.0)
            depth, inwards = self._shallow_depth(skin + shapes[k])
            lack = np.maximum(rest - depth - allowed, 0.0)
            for strength in _MIDWAY:
                depth, inwards_then = self._shallow_depth(skin + strength * shapes[k])
                lack_then = (np.minimum(rest, _AT_REST + _RESERVE) - depth) / strength - allowed
                lack_then = np.minimum(lack_then, _RESERVE)
                more = lack_then > lack
                lack[more], inwards[more] = lack_then[more], inwards_then[more]
            result[k, self.ids[self.shallow]] += lack[:, None] * inwards
        return result

    def _shallow_depth(self, skin: Floats) -> tuple[Floats, Floats]:
        return self._in_front.depth(skin, self.ids[self.shallow], self._in_front_of)

    def _lower(self, skin: Floats, which: NDArray[np.intp], depth: Floats, inwards: Floats) -> None:
        """Move ``ids[which]`` of a neutral ``skin`` with too little ``depth``, (n,), ``inwards``, (n, 3), in place."""
        lack = np.maximum(np.minimum(self._reference_depth[which], _AT_REST) - depth, 0.0)
        skin[self.ids[which]] += (lack + np.minimum(_STEEP * lack, _RESERVE))[:, None] * inwards


class _Cover:
    """Skin that covers the lining.

    Attributes:
        ids: Its vertices, shape (k,).
    """

    def __init__(self, quads: Ints, ids: Ints, n_vertices: int) -> None:
        """Take the vertices ``ids`` of the mesh of ``quads`` (F, 4) with ``n_vertices``."""
        self.ids = ids
        self._quads = quads[np.isin(quads, ids).any(axis=1)]
        rows, columns = self._quads.ravel(), np.repeat(np.arange(len(self._quads)), 4)
        shape = (n_vertices, len(self._quads))
        self._adjacent = sparse.csr_array((np.ones(len(rows)), (rows, columns)), shape=shape)[ids]

    def depth(self, skin: Floats, ids: Ints, places: NDArray[np.intp]) -> tuple[Floats, Floats]:
        """Return the depths of ``ids`` of ``skin``, (N, 3), below its ``places`` (n, 4), and directions inwards."""
        a, b, c, d = skin[self._quads].transpose(1, 0, 2)
        normals = self._adjacent @ np.cross(c - a, d - b)
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
        around = normals[places]
        away = skin[self.ids][places] - skin[ids][:, None]
        depth = np.einsum("nkd,nkd->nk", away, around).min(axis=1)
        distance = np.linalg.norm(away.mean(axis=1), axis=1)
        depth = np.where(distance**2 - depth**2 > _ALONG**2, distance, depth)
        outwards = around.sum(axis=1)
        return depth, -outwards / np.maximum(np.linalg.norm(outwards, axis=1, keepdims=True), 1e-12)
