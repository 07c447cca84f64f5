"""Lids that have passed each other turn back to where they meet."""

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from faceposer.model.character import Character
from faceposer.model.contact.eyeballs import Eyeball
from faceposer.model.contact.frames import pieces
from faceposer.model.contact.lids import PRESSED, LidEdges, azimuth_and_elevation, skin_ids
from faceposer.model.contact.moved import Moved, moved_by
from faceposer.model.contact.spreading import Spreading, fading, hinge

Array = NDArray[np.float64]
Singles = NDArray[np.float32]
Ids = NDArray[np.intp]

# Shares of an overlap that the upper and the lower lid give way by: the upper one is the one that moves. Both turn at
# once, each to where the other was; what that leaves between vertices, further turns take away.
_SHARES = ((0.8, 0.2), (1.0, 1.0), (1.0, 1.0))
#: In radii of the ball: how far from the edges skin turns with them.
TURNS = 0.75
# In radii of the ball: how far from the edges it is their rim.
_RIM = 0.3
# In radians: start and margin of the turn of a lid by the other.
_TURN_START, _TURN_MARGIN = 0.003, 0.012
# What lies between an edge's last vertex and a corner of the eye that is further away than this is unknown, in radians.
_UNKNOWN = np.deg2rad(8.0)
#: Distance of the control points that spread pushes, in radians.
SPACING = 0.2


class Turning:
    """Turns lids that have passed each other back to where they meet."""

    def __init__(self, character: Character, eyes: Sequence[tuple[int, Eyeball, LidEdges, list[Array]]]) -> None:
        """Prepare for ``eyes``: of each its number, ball, edges of the lids, and distances of all vertices to them."""
        lids = [(number, _Lids.of(character, ball, edges, distances)) for number, ball, edges, distances in eyes]
        first = np.cumsum([0, *(len(each.ids) for _, each in lids)])
        self._count = int(first[-1])
        # Upper lids of all eyes, then lower lids of all eyes.
        both = range(2)
        self._spreading = Spreading.beside([each.spreadings[side] for side in both for _, each in lids])
        # Where the rims' own turns lie among those of all lids.
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
        self._seen = np.concatenate([*edges, *rims])
        self._runs = runs_of([len(ids) for ids in (*edges, *rims)])
        self._eye_of_seen = np.repeat(
            [*np.repeat(numbers, 3), *numbers, *numbers], [len(ids) for ids in (*edges, *rims)]
        )
        self._at_rest = character.vertices[self._seen]

    def apply(self, vertices: Singles, centres: Array, looks: bool) -> Iterator[Moved]:
        """Turn the lids of the pose ``vertices``, (N, 3), in place.

        Args:
            vertices: Shape (N, 3).
            centres: Of the eyes, shape (E, 3).
            looks: Whether an eye is moved; if none is, lids that are at rest are not looked at.
        """
        centre_of_seen = centres.take(self._eye_of_seen, axis=0)
        for shares in self._shares:
            places = vertices.take(self._seen, axis=0)
            if not looks and np.array_equal(places, self._at_rest):
                return
            past = self._past(places - centre_of_seen)
            if past.max(initial=0.0) <= 0.0:
                return
            turns = shares * hinge(past, _TURN_START, _TURN_MARGIN)
            both = self._spreading(turns)
            both[self._own] = np.maximum(both.take(self._own), turns)
            angle = both[: self._count] - both[self._count :]
            angle = np.concatenate([angle, angle.take(self._roots)])
            turned = np.flatnonzero(angle)
            yield self._turn(vertices, turned, angle.take(turned), centres)

    def _past(self, relative: Array) -> Array:
        """Return by which angle each vertex of the rims is past the other edge, less what it may be, shape (k,).

        Args:
            relative: Where edges, corners and rims lie, relative to the centres of their eyes, shape (s, 3).
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
        past = np.concatenate([*uppers, *lowers])
        past += self._allowed
        return past

    def _turn(self, vertices: Singles, turned: Ids, angle: Singles, centres: Array) -> Moved:
        """Turn the vertices numbered ``turned``, (n,), up by an ``angle``, (n,), in place."""
        ids = self._ids.take(turned)
        before = vertices.take(ids, axis=0)
        x, y, z = (before - centres.take(self._eye_of_id.take(turned), axis=0)).T
        across = np.maximum(np.sqrt(x * x + z * z), 1e-9)
        cosine, sine = np.cos(angle), np.sin(angle)
        shrink = cosine - sine * y / across - 1.0
        move = np.stack([x * shrink, across * sine + y * (cosine - 1.0), z * shrink])
        return moved_by(vertices, ids, before, move)


@dataclass(frozen=True, eq=False)
class _Lids:
    """The lids of one eye, as far as they turn.

    Attributes:
        ids: The vertices that turn, shape (n,).
        edges: The edges.
        rims: Indices into ``ids`` of the vertices at the rim of the upper and of the lower lid.
        allowed: How far each of these lies behind its edge, less the overlap that it may have.
        spreadings: From each rim over ``ids``.
        lashes: Vertices of lashes.
        roots: The index into ``ids`` of the vertex that each of them goes with.
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
        """Return the lids with ``edges`` before a ``ball`` of ``character``."""
        skin = skin_ids(character)
        reach = TURNS * ball.radius
        near = skin[np.minimum(distances[0], distances[1])[skin] < reach]
        points = character.vertices[near].astype(np.float64) - ball.centre
        azimuth, elevation, _ = azimuth_and_elevation(points)
        upper = upper_share(distances, near)
        outward = np.sign(ball.centre[0]) or 1.0
        curves = edges.curves(character.vertices, ball.centre)
        starts, ends = zip(*(_known(curve.azimuth) for curve in curves), strict=True)
        first, last = max(starts), min(ends)
        on_edge = (azimuth > first) & (azimuth < last) & (ball.clearance(points)[0] >= 0.0)
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
        turning = np.unique(np.concatenate([*rims, *(spreading.reaches for spreading in spreadings)]))
        lashes, roots = followers_of(character, ball, edges, near[turning])
        return cls(
            near[turning],
            edges,
            [np.searchsorted(turning, rim) for rim in rims],
            allowed,
            [spreading.at(turning) for spreading in spreadings],
            lashes,
            roots,
        )


def runs_of(lengths: Sequence[int]) -> list[slice]:
    """Return where runs of such ``lengths``, one after another, lie."""
    return [slice(*run) for run in itertools.pairwise(np.cumsum([0, *lengths]).tolist())]


def upper_share(distances: list[Array] | None, ids: Ids) -> Array:
    """Return the share of the vertices ``ids`` in the upper lid, 1/2 at the corners, by ``distances`` to the edges."""
    if distances is None:
        return np.full(len(ids), 0.5)
    upper, lower = (np.minimum(distance[ids], 1e6) for distance in distances)
    return 1.0 - fading((lower - upper) / np.maximum(lower + upper, 1e-9), -0.3, 0.3)


def _azimuth(character: Character, ball: Eyeball, ids: Ids) -> Array:
    return azimuth_and_elevation(character.vertices[ids].astype(np.float64) - ball.centre)[0]


def _known(azimuth: Array) -> tuple[float, float]:
    """Return between which angles an edge is known whose points lie at the rising ``azimuth``, shape (n,)."""
    first = 1 if azimuth[1] - azimuth[0] > _UNKNOWN else 0
    last = -2 if azimuth[-1] - azimuth[-2] > _UNKNOWN else -1
    return float(azimuth[first]), float(azimuth[last])


def _lashes(character: Character, ball: Eyeball, edges: LidEdges | None) -> list[tuple[Ids, bool]]:
    """Return the pieces of lashes on the lids of ``ball``, each with whether they are those of the upper lid."""
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


def followers_of(character: Character, ball: Eyeball, edges: LidEdges | None, skin: Ids) -> tuple[Ids, Ids]:
    """Return the vertices of lashes, and the index into ``skin`` of the edge's vertex that each goes with.

    Those that go with none of ``skin`` are left out.
    """
    ids, roots = [np.zeros(0, dtype=np.intp)], [np.zeros(0, dtype=np.intp)]
    place = np.full(len(character.vertices), -1, dtype=np.intp)
    place[skin] = np.arange(len(skin))
    for lashes, is_upper in _lashes(character, ball, edges):
        assert edges is not None
        edge = edges.upper if is_upper else edges.lower
        between = np.abs(_azimuth(character, ball, lashes)[:, None] - _azimuth(character, ball, edge)[None])
        ids.append(lashes)
        roots.append(place[edge[between.argmin(axis=1)]])
    found, root = np.concatenate(ids), np.concatenate(roots)
    return found[root >= 0], root[root >= 0]
