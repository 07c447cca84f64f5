"""Rotation of lids that have passed each other back to where they meet."""

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from faceposer.model.character import Character
from faceposer.model.contact.displacement import Displacement, move_vertices
from faceposer.model.contact.eyeballs import Eyeball
from faceposer.model.contact.frames import pieces
from faceposer.model.contact.lids import PRESSED, LidEdges, azimuth_and_elevation, skin_ids
from faceposer.model.contact.spreading import Spreading, fading, hinge

Array = NDArray[np.float64]
Singles = NDArray[np.float32]
Ids = NDArray[np.intp]

# Shares of the overlap by which the upper and the lower lid turn back, in each of three passes. In the first pass the
# upper lid, which moves most, takes most; the others remove what remains between vertices.
_SHARES = ((0.8, 0.2), (1.0, 1.0), (1.0, 1.0))
#: Distance from the edges up to which skin turns with them, in radii of the ball.
TURN_REACH = 0.75
# Width of the rims along the edges, in radii of the ball.
_RIM = 0.3
# Start and margin of the turn of a lid, in radians.
_TURN_START, _TURN_MARGIN = 0.003, 0.012
# Largest gap between the last vertex of an edge and a corner of the eye in which the edge is known, in radians.
_LARGEST_GAP = np.deg2rad(8.0)
# Distance from that vertex up to which it is known next to a larger gap, in radians.
_BEYOND = np.deg2rad(2.5)
#: Spacing of the control points that spread pushes, in radians.
SPACING = 0.2


class Turning:
    """Correction that turns lids that have passed each other back to where they meet."""

    def __init__(self, character: Character, eyes: Sequence[tuple[int, Eyeball, LidEdges, list[Array]]]) -> None:
        """Precompute the turning of ``eyes``: number, ball, lid edges and distances of all vertices from both edges."""
        lids = [(number, _Lids.of(character, ball, edges, distances)) for number, ball, edges, distances in eyes]
        first = np.cumsum([0, *(len(each.ids) for _, each in lids)])
        self._count = int(first[-1])
        # Upper lids of all eyes, then lower lids of all eyes.
        both = range(2)
        self._spreading = Spreading.block_diagonal([each.spreadings[side] for side in both for _, each in lids])
        # Indices of the rims among the vertices of all lids.
        self._own = np.concatenate(
            [each.rims[side] + first[i] + side * self._count for side in both for i, (_, each) in enumerate(lids)]
        )
        self._allowed = np.concatenate([each.allowed[side] for side in both for _, each in lids])
        sizes = [[len(each.rims[side]) for _, each in lids] for side in both]
        self._shares = np.repeat(np.array(_SHARES), [sum(each) for each in sizes], axis=1)
        self._ids = np.concatenate([*(each.ids for _, each in lids), *(each.lashes for _, each in lids)])
        self._roots = np.concatenate([each.roots + first[i] for i, (_, each) in enumerate(lids)])
        lengths = [len(each.ids) for _, each in lids] + [len(each.lashes) for _, each in lids]
        numbers = [number for number, _ in lids]
        self._eye_of_id = np.repeat(numbers * 2, lengths)
        # Edges and corners of each eye, then the rims.
        self._edges = [each.edges for _, each in lids]
        edges = [ids for each in self._edges for ids in (each.upper, each.lower, each.corners)]
        rims = [each.ids[each.rims[side]] for side in both for _, each in lids]
        self._vertices = np.concatenate([*edges, *rims])
        self._runs = slices_of([len(ids) for ids in (*edges, *rims)])
        self._eye_of_vertex = np.repeat(
            [*np.repeat(numbers, 3), *numbers, *numbers], [len(ids) for ids in (*edges, *rims)]
        )
        self._at_rest = character.vertices[self._vertices]

    def apply(self, vertices: Singles, centres: Array, eyes_move: bool) -> Iterator[Displacement]:
        """Turn the lids of the pose ``vertices``, (N, 3), in place.

        Args:
            vertices: Posed vertices, shape (N, 3).
            centres: Centres of the eyes, shape (E, 3).
            eyes_move: True if an eye moves; otherwise lids at rest are skipped.
        """
        centres_of_vertices = centres.take(self._eye_of_vertex, axis=0)
        for shares in self._shares:
            places = vertices.take(self._vertices, axis=0)
            if not eyes_move and np.array_equal(places, self._at_rest):
                return
            overlaps = self._overlaps(places - centres_of_vertices)
            if overlaps.max(initial=0.0) <= 0.0:
                return
            turns = shares * hinge(overlaps, _TURN_START, _TURN_MARGIN)
            both = self._spreading(turns)
            both[self._own] = np.maximum(both.take(self._own), turns)
            angle = both[: self._count] - both[self._count :]
            angle = np.concatenate([angle, angle.take(self._roots)])
            turned = np.flatnonzero(angle)
            yield self._turn(vertices, turned, angle.take(turned), centres)

    def _overlaps(self, relative: Array) -> Array:
        """Return the angle by which each rim vertex is past the other edge, less the allowed angle, shape (k,).

        Args:
            relative: Positions of edges, corners and rims relative to the centres of their eyes, shape (s, 3).
        """
        azimuth, elevation, _ = azimuth_and_elevation(relative)
        azimuths, elevations = ([each[run] for run in self._runs] for each in (azimuth, elevation))
        count = len(self._edges)
        uppers, lowers = [], []
        for i, edges in enumerate(self._edges):
            edge, rim, other = slice(3 * i, 3 * i + 3), 3 * count + i, 4 * count + i
            upper, lower = edges.curves_through(azimuths[edge], elevations[edge])
            uppers.append(lower(azimuths[rim]) - elevations[rim])
            lowers.append(elevations[other] - upper(azimuths[other]))
        overlaps = np.concatenate([*uppers, *lowers])
        overlaps += self._allowed
        return overlaps

    def _turn(self, vertices: Singles, turned: Ids, angle: Singles, centres: Array) -> Displacement:
        """Turn the vertices ``self._ids[turned]`` up by an ``angle``, (n,), in place."""
        ids = self._ids.take(turned)
        before = vertices.take(ids, axis=0)
        x, y, z = (before - centres.take(self._eye_of_id.take(turned), axis=0)).T
        across = np.maximum(np.sqrt(x * x + z * z), 1e-9)
        cosine, sine = np.cos(angle), np.sin(angle)
        shrink = cosine - sine * y / across - 1.0
        move = np.stack([x * shrink, across * sine + y * (cosine - 1.0), z * shrink])
        return move_vertices(vertices, ids, before, move)


@dataclass(frozen=True, eq=False)
class _Lids:
    """The parts of the lids of one eye that turn.

    Attributes:
        ids: Ids of the vertices that turn, shape (n,).
        edges: Edges of the lids.
        rims: Indices into ``ids`` of the vertices at the rim of the upper and of the lower lid.
        allowed: Angle of each rim vertex behind its edge in the neutral face, less the allowed overlap.
        spreadings: Spreading of turns from each rim over ``ids``.
        lashes: Vertex ids of the lashes.
        roots: Index into ``ids`` of the vertex to which each of ``lashes`` is attached.
    """

    ids: Ids
    edges: LidEdges
    rims: list[Ids]
    allowed: list[Array]
    spreadings: list[Spreading]
    lashes: Ids
    roots: Ids

    @classmethod
    def of(cls, character: Character, ball: Eyeball, edges: LidEdges, distances: list[Array]) -> Self:
        """Return the lids with ``edges`` in front of a ``ball`` of ``character``."""
        skin = skin_ids(character)
        reach = TURN_REACH * ball.radius
        near = skin[np.minimum(distances[0], distances[1])[skin] < reach]
        points = character.vertices[near].astype(np.float64) - ball.centre
        azimuth, elevation, _ = azimuth_and_elevation(points)
        upper = upper_lid_share(distances, near)
        outward = np.sign(ball.centre[0]) or 1.0
        curves = edges.curves(character.vertices, ball.centre)
        starts, ends = zip(*(_known_range(curve.azimuth) for curve in curves), strict=True)
        first, last = max(starts), min(ends)
        on_edge = (azimuth >= first) & (azimuth <= last) & (ball.clearance(points)[0] >= 0.0)
        along, up = outward * azimuth / SPACING, elevation / SPACING
        rims, allowed, spreadings = [], [], []
        for number, (distance, share) in enumerate(zip(distances, (upper, 1.0 - upper), strict=True)):
            sign = 1.0 - 2.0 * number
            rim = np.flatnonzero(on_edge & (share > 0.5) & (distance[near] < _RIM * ball.radius))
            behind = np.maximum(sign * (elevation[rim] - curves[number](azimuth[rim])), 0.0)
            across = sign * (curves[1 - number](azimuth[rim]) - elevation[rim]) + behind
            fade = share * fading(distance[near], 0.0, reach)
            rims.append(rim)
            allowed.append(behind - np.maximum(across, PRESSED))
            spreadings.append(Spreading.over(along, up, share, fade, rim))
        turning = np.unique(np.concatenate([*rims, *(spreading.support for spreading in spreadings)]))
        lashes, roots = attached_lashes(character, ball, edges, near[turning])
        return cls(
            near[turning],
            edges,
            [np.searchsorted(turning, rim) for rim in rims],
            allowed,
            [spreading.restricted(turning) for spreading in spreadings],
            lashes,
            roots,
        )


def slices_of(lengths: Sequence[int]) -> list[slice]:
    """Return the slices of consecutive blocks of the given ``lengths``."""
    return [slice(*run) for run in itertools.pairwise(np.cumsum([0, *lengths]).tolist())]


def upper_lid_share(distances: list[Array] | None, ids: Ids) -> Array:
    """Return the share of the vertices ``ids`` in the upper lid from ``distances`` to the edges; 1/2 at the corners."""
    if distances is None:
        return np.full(len(ids), 0.5)
    upper, lower = (np.minimum(distance[ids], 1e6) for distance in distances)
    return 1.0 - fading((lower - upper) / np.maximum(lower + upper, 1e-9), -0.3, 0.3)


def _azimuth(character: Character, ball: Eyeball, ids: Ids) -> Array:
    return azimuth_and_elevation(character.vertices[ids].astype(np.float64) - ball.centre)[0]


def _known_range(azimuth: Array) -> tuple[float, float]:
    """Return the range of azimuths in which an edge with points at ascending ``azimuth``, (n,), is known."""
    first = azimuth[1] - _BEYOND if azimuth[1] - azimuth[0] > _LARGEST_GAP else azimuth[0]
    last = azimuth[-2] + _BEYOND if azimuth[-1] - azimuth[-2] > _LARGEST_GAP else azimuth[-1]
    return float(first), float(last)


def _lashes(character: Character, ball: Eyeball, edges: LidEdges | None) -> list[tuple[Ids, bool]]:
    """Return the connected pieces of lashes on the lids of ``ball``, each with True if it is on the upper lid."""
    found = []
    for part in character.parts if edges is not None else ():
        if part.material != "lashes":
            continue
        for ids in pieces(character, part):
            points = character.vertices[ids].astype(np.float64)
            if np.abs(points.mean(axis=0) - ball.centre)[0] > 1.2 * ball.radius:
                continue
            assert edges is not None
            near = [
                np.linalg.norm(points[:, None] - character.vertices[edge][None], axis=2).min(axis=1).mean()
                for edge in (edges.upper, edges.lower)
            ]
            found.append((ids, bool(near[0] < near[1])))
    return found


def attached_lashes(character: Character, ball: Eyeball, edges: LidEdges | None, skin: Ids) -> tuple[Ids, Ids]:
    """Return the vertex ids of lashes, and the index into ``skin`` of the edge vertex to which each is attached.

    Lashes attached to no vertex of ``skin`` are left out.
    """
    ids, roots = [np.zeros(0, dtype=np.intp)], [np.zeros(0, dtype=np.intp)]
    index = np.full(len(character.vertices), -1, dtype=np.intp)
    index[skin] = np.arange(len(skin))
    for lashes, is_upper in _lashes(character, ball, edges):
        assert edges is not None
        edge = edges.upper if is_upper else edges.lower
        between = np.abs(_azimuth(character, ball, lashes)[:, None] - _azimuth(character, ball, edge)[None])
        ids.append(lashes)
        roots.append(index[edge[between.argmin(axis=1)]])
    found, root = np.concatenate(ids), np.concatenate(roots)
    return found[root >= 0], root[root >= 0]
