"""The cavity of the mouth, which stays inside heads that are far from the reference."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.spatial import cKDTree

from faceposer.identity.anatomy.falloff import ramp
from faceposer.identity.template import HeadTemplate

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

#: Places in the cavity relative to the middle of the lips, along the palate, in centimetres of the reference: each
#: point of the cavity is drawn towards the nearest of them.
_MIDDLES = np.array([[0.0, 0.3, -2.5], [0.0, 0.8, -5.0], [0.0, 0.8, -7.5]])
#: Distance from these beyond which skin does not cover the cavity, in centimetres of the reference.
_REACH = 17.0
#: Number of the skin's vertices that tell how far away it is, and the angle in radians around a direction within which
#: they do; the number of them that tell how it moves, and the angle within which so many do where vertices are sparse;
#: how far beyond the farthest point they are, in centimetres.
_AROUND, _ANGLE, _FRONT, _SPARSE, _BEYOND = 40, 0.26, 3, 0.5, 1.0
#: Least depth of the cavity below the skin, unless the reference's has less, in centimetres.
_DEPTH = 0.45
#: Distance from the contact of the lips up to which the lining belongs to the lips, and distances over which the share
#: of the reference's depth that must remain rises to 1 from the share given, so that cheeks stay off the teeth, in
#: centimetres.
_FROM_LIPS, _CHEEKS, _OF_CHEEKS = 0.6, (1.0, 2.5), 0.4
#: Share of the way to the skin that remains at least.
_CLOSEST = 0.1
#: Distances by which a point was drawn in over which it takes on the motion of the skin in front of it, in centimetres.
_FOLLOWS = (0.0, 0.4)


@dataclass(frozen=True, eq=False)
class Drawn:
    """Points of the cavity in a head, drawn in where they were too close to the skin or outside.

    Attributes:
        points: Their positions, shape (n, 3), in centimetres.
        share: Share of the motion of the skin in front of them that they take on, shape (n,).
        skin: Vertices of the skin in front of them, shape (n, k).
    """

    points: Floats
    share: Floats
    skin: NDArray[np.intp]

    def following(self, offsets: Floats, of_skin: Floats) -> Floats:
        """Return ``offsets`` (S, n, 3) of the points in shapes, with their share of those ``of_skin``, (S, N, 3)."""
        which = np.flatnonzero(self.share)
        result = offsets.copy()
        of_cover = of_skin[:, self.skin[which]].mean(axis=2)
        result[:, which] += self.share[which, None] * (of_cover - offsets[:, which])
        return result


@dataclass(frozen=True, eq=False)
class Part:
    """Points of the reference's cavity.

    Attributes:
        middle_of: Index of the place towards which each of them is drawn, shape (n,).
        depth: Least depth of each below the skin, in centimetres of the reference, shape (n,).
    """

    middle_of: NDArray[np.intp]
    depth: Floats


class Cavity:
    """Cavity of the mouth of a reference head, for keeping that of others of the same topology inside the skin.

    Far from the average, its lining, which nobody sees in scans, and the throat, which is rigid, could cross the neck.

    Attributes:
        middles: Places towards which it is drawn, in the reference, shape (m, 3).
        ids: Vertices of the skin inside the mouth, without those close to the lips, shape (n,).
    """

    def __init__(self, template: HeadTemplate, skin: Floats, contact: Ints) -> None:
        """Find the cavity of the reference's ``skin``, (N, 3), behind the loop ``contact`` where the lips touch."""
        n = len(skin)
        edges = np.concatenate([template.quads[:, [i, (i + 1) % 4]] for i in range(4)])
        edges = edges[~np.isin(edges, contact).any(axis=1)]
        graph = sparse.coo_array((np.ones(len(edges)), edges.T), shape=(n, n))
        _, pieces = sparse.csgraph.connected_components(graph, directed=False)
        self.middles = _MIDDLES + skin[contact].mean(axis=0)
        # Of the pieces into which the loop cuts the skin, the larger one is outside.
        counts = np.bincount(pieces)
        outside, inside = np.argsort(counts)[-1:-3:-1]
        self._lips = cKDTree(skin[contact])
        self.ids = np.flatnonzero((pieces == inside) & (self._lips.query(skin)[0] > _FROM_LIPS)).astype(np.int32)
        near = cKDTree(self.middles).query(skin)[0] < _REACH
        self._cover = np.flatnonzero(((pieces == outside) & near)[: template.n_control])
        self._reference = skin

    def part(self, points: Floats) -> Part:
        """Return the part of the cavity of ``points`` in the reference, shape (n, 3)."""
        middle_of, depth = cKDTree(self.middles).query(points)[1], np.zeros(len(points))
        for k, middle in enumerate(self.middles):
            which = np.flatnonzero(middle_of == k)
            reach, distance, _ = self._towards(points[which], self._reference, middle)
            depth[which] = np.minimum(reach - distance, _DEPTH)
        kept = _OF_CHEEKS + (1.0 - _OF_CHEEKS) * ramp(*_CHEEKS, self._lips.query(points)[0])
        return Part(middle_of, np.minimum(kept * depth, depth))

    def drawn(self, part: Part, points: Floats, skin: Floats, middles: Floats, scale: float) -> Drawn:
        """Return ``points`` of ``part`` in a head, drawn towards the middle of its cavity where they lack depth.

        Args:
            part: The part of the cavity.
            points: Positions in the head, shape (n, 3), in centimetres.
            skin: The head's skin, shape (N, 3).
            middles: The places `middles` in the head, shape (m, 3).
            scale: Size of the mouth relative to the reference's.
        """
        result, share = points.copy(), np.zeros(len(points))
        fronts = np.zeros((len(points), _FRONT), dtype=np.intp)
        for k, middle in enumerate(middles):
            which = np.flatnonzero(part.middle_of == k)
            reach, distance, fronts[which] = self._towards(points[which], skin, middle)
            kept = np.minimum(distance, np.maximum(reach - scale * part.depth[which], _CLOSEST * reach))
            result[which] = middle + (kept / np.maximum(distance, 1e-9))[:, None] * (points[which] - middle)
            share[which] = ramp(*_FOLLOWS, distance - kept)
        return Drawn(result, share, fronts)

    def _towards(self, points: Floats, skin: Floats, centre: Floats) -> tuple[Floats, Floats, NDArray[np.intp]]:
        """Return how far from ``centre`` the skin is in the directions of ``points``, how far they are, and where."""
        away = points - centre
        distance = np.linalg.norm(away, axis=1)
        radii = np.linalg.norm(skin[self._cover] - centre, axis=1)
        # Skin beyond the points, such as the neck's under the throat, would only hide what is in front of it.
        close = np.argsort(radii)[: max(np.count_nonzero(radii < distance.max(initial=0.0) + _BEYOND), _AROUND)]
        cover, radii = self._cover[close], radii[close]
        directions = away / np.maximum(distance, 1e-9)[:, None]
        angle, nearest = cKDTree((skin[cover] - centre) / radii[:, None]).query(directions, k=_AROUND)
        counts = angle < _ANGLE
        counts[:, :_FRONT] = angle[:, :_FRONT] < _SPARSE
        reaches = np.where(counts, radii[nearest], np.inf)
        first = np.argpartition(reaches, _FRONT, axis=1)[:, :_FRONT]
        return reaches.min(axis=1), distance, cover[np.take_along_axis(nearest, first, axis=1)]
