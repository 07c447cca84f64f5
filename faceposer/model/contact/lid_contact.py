"""Lids stop at each other and slide on the eyeball.

Lid on lid: where the edges have passed each other by an angle o, seen from the centre of the eye, the upper lid goes
back by a share of o and the lower lid by the rest, so that both meet; the skin around turns with them, less and less.
Lid on ball: skin at a direction d from the centre whose distance is below the ball's radius rho(d), sclera or cornea,
goes out along d; the skin around goes with it.
"""

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from faceposer.model.contact.eyeballs import Eyeball, Eyeballs
from faceposer.model.contact.frames import pieces
from faceposer.model.contact.lids import (
    PRESSED,
    LidEdges,
    azimuth_and_elevation,
    find_all_edges,
    over_the_ball,
    skin_ids,
)
from faceposer.model.contact.lips import skin_samples, surface_distance, with_neighbours
from faceposer.model.contact.moved import Moved, moved_by
from faceposer.model.contact.samples import SurfaceSamples
from faceposer.model.contact.spreading import NOTHING, Spreading, fading, hinge
from faceposer.model.subject import Subject

Array = NDArray[np.float64]
Singles = NDArray[np.float32]
Ids = NDArray[np.intp]
Vertices = NDArray[np.floating]

# Shares of an overlap that the upper and the lower lid give way by: the upper one is the one that moves. Both turn at
# once, each to where the other was; what that leaves between vertices, further turns take away.
_SHARES = ((0.8, 0.2), (1.0, 1.0), (1.0, 1.0))
# In radii of the ball: how far from the edges skin turns with them and how far it is their rim; up to which clearance
# in the neutral face skin may come to touch the ball; where pushes begin to fade and have faded.
_TURNS, _RIM, _TOUCHES, _FADES, _FADED = 0.75, 0.3, 0.8, 0.4, 0.8
# A sphere of radius R bulges by s^2 / 6 R through a triangle with edges s, here of the neutral ones times this factor.
_STRETCHED = 3.0
# In radii of the ball and in radians: start and margin of the pushes out of the ball and of a lid by the other.
_START, _MARGIN, _TURN_START, _TURN_MARGIN = 0.001, 0.018, 0.003, 0.012
# What lies between an edge's last vertex and a corner of the eye that is further away than this is unknown, in radians.
_UNKNOWN = np.deg2rad(8.0)
# Distance of the control points that spread pushes, in radians.
_SPACING = 0.2


@dataclass(frozen=True, eq=False)
class _Eye:
    """An eye with what surrounds it.

    Attributes:
        ball: Its ball.
        edges: Of its lids, if there are any.
        distances: Of all vertices to the upper and to the lower edge; None without edges.
        samples: Of the skin that may touch the ball.
        ids: The vertices that move with pushes: first those of the samples, shape (n,).
        spreading: Of pushes of the samples' vertices over ``ids``.
        followers: Lashes, and the index into ``ids`` of the vertex that each goes with.
    """

    ball: Eyeball
    edges: LidEdges | None
    distances: list[Array] | None
    samples: SurfaceSamples
    ids: Ids
    spreading: Spreading
    followers: tuple[Ids, Ids]

    @classmethod
    def of(cls, subject: Subject, ball: Eyeball, edges: LidEdges | None) -> Self:
        """Return the eye of the ``subject`` with a ``ball``, and ``edges`` of its lids if there are any."""
        distances = None
        if edges is not None:
            reach = 4.0 * ball.radius
            distances = [surface_distance(subject, ids, reach) for ids in (edges.upper, edges.lower)]
        near = over_the_ball(subject, ball)
        clearance, _ = ball.clearance(subject.vertices[near] - ball.centre)
        touches = np.isin(near, with_neighbours(subject, near[clearance < _TOUCHES * ball.radius]))
        samples = skin_samples(subject, near[touches])
        pushed = np.arange(int(touches.sum()))
        ids = np.concatenate([near[touches], near[~touches]])
        points = subject.vertices[ids] - ball.centre
        azimuth, elevation, _ = azimuth_and_elevation(points)
        layer = _upper_share(distances, ids)
        fade = fading(ball.clearance(points)[0], _FADES * ball.radius, _FADED * ball.radius)
        outward = np.sign(ball.centre[0]) or 1.0
        spreading = Spreading.over(outward * azimuth / _SPACING, elevation / _SPACING, layer, fade, pushed)
        moving = np.concatenate([pushed, np.setdiff1d(spreading.reaches, pushed)])
        followers = _followers(subject, ball, edges, ids[moving])
        return cls(ball, edges, distances, samples, ids[moving], spreading.at(moving), followers)


class LidContact:
    """Keeps the lids of eyes off their balls and off each other.

    What surrounds one eye has no vertex in common with what surrounds another; all are looked at together.
    """

    def __init__(self, subject: Subject, eyes: Sequence[_Eye]) -> None:
        """Prepare for the ``eyes`` of ``subject``."""
        self._balls = Eyeballs([eye.ball for eye in eyes], subject.vertices)
        self._turning = _Turning(subject, eyes) if any(eye.edges is not None for eye in eyes) else None
        self._samples = SurfaceSamples.joined([eye.samples for eye in eyes])
        numbers = np.arange(len(eyes))
        vertices = np.repeat(numbers, [len(eye.samples.ids) for eye in eyes])
        between = np.repeat(numbers, [eye.samples.corners.shape[1] for eye in eyes])
        self._eye_of_sample = np.concatenate([vertices, between])
        self._runs = _runs([len(eye.samples.ids) for eye in eyes])
        radii = self._balls.radii.take(vertices)
        self._radii = self._balls.radii.astype(np.float32)
        self._near = ((_STRETCHED * self._samples.spans) ** 2 / (6.0 * radii)).astype(np.float32)
        widest = np.array([eye.ball.profile.max() for eye in eyes]).take(vertices)
        self._far = ((widest + self._near) ** 2).astype(np.float32)
        at_rest = self._samples.places(subject.vertices).T.astype(np.float32)
        at_rest -= (
            np.stack([eye.ball.centre for eye in eyes], axis=1).astype(np.float32).take(self._eye_of_sample, axis=1)
        )
        self._allowed = np.maximum(-self._balls.clearance(at_rest, self._eye_of_sample), 0.0)
        self._spreading = Spreading.beside([eye.spreading for eye in eyes])
        self._ids = np.concatenate([eye.ids for eye in eyes])
        self._eye_of_id = np.repeat(numbers, [len(eye.ids) for eye in eyes])
        first = np.cumsum([0, *(len(eye.ids) for eye in eyes)])
        # Where the samples' vertices are among those that move.
        self._own = np.concatenate([first[i] + np.arange(len(eye.samples.ids)) for i, eye in enumerate(eyes)])
        self._lashes = np.concatenate([eye.followers[0] for eye in eyes])
        self._roots = np.concatenate([first[i] + eye.followers[1] for i, eye in enumerate(eyes)])
        self._at_rest = subject.vertices[self._samples.ids]
        self._nothing = NOTHING * subject.height

    def apply(self, vertices: Singles) -> Iterator[Moved]:
        """Correct the pose ``vertices``, shape (N, 3), in place."""
        balls = self._balls
        linear, centres, look = balls.motion_of(vertices.take(balls.witnesses, axis=0))
        looks = bool(look.any())
        if self._turning is not None:
            yield from self._turning.apply(vertices, centres, looks)
        places = vertices.take(self._samples.ids, axis=0)
        if not looks and np.array_equal(places, self._at_rest):
            return
        back: Array = np.asarray(np.linalg.inv(linear), dtype=np.float64)
        rows = np.ascontiguousarray(places.T)
        turns, shifts = back.astype(np.float32), -np.einsum("eij,ej->ei", back, centres).astype(np.float32)
        near = self._may_touch(rows, turns, shifts)
        if not look.all():
            moved = (places.take(near, axis=0) != self._at_rest.take(near, axis=0)).any(axis=1)
            near = near[moved | look.take(self._eye_of_sample.take(near))]
        if not len(near):
            return

        def pushes(points: Singles, numbers: Ids) -> Singles:
            eyes = self._eye_of_sample.take(numbers)
            resting = np.einsum("nij,jn->in", turns.take(eyes, axis=0), points) + shifts.T.take(eyes, axis=1)
            depth = -balls.clearance(resting, eyes) - self._allowed.take(numbers)
            radius = self._radii.take(eyes)
            return hinge(depth, _START * radius, _MARGIN * radius)

        push = self._samples.greatest(rows, near, pushes)
        if push.max() <= self._nothing:
            return
        field = self._spreading(push)
        field[self._own] = np.maximum(field.take(self._own), push)
        pushed = np.flatnonzero(field)
        ids, eyes = self._ids.take(pushed), self._eye_of_id.take(pushed)
        before = vertices.take(ids, axis=0)
        points = before - centres.take(eyes, axis=0)
        x, y, z = np.einsum("nij,nj->in", back.take(eyes, axis=0), points)
        move = points.T * (field.take(pushed) / np.maximum(np.sqrt(x * x + y * y + z * z), 1e-9))
        yield moved_by(vertices, ids, before, move)
        if len(self._lashes):
            whole = np.zeros((3, len(field)))
            whole[:, pushed] = move
            yield moved_by(vertices, self._lashes, vertices.take(self._lashes, axis=0), whole.take(self._roots, axis=1))

    def _may_touch(self, rows: Singles, turns: Singles, shifts: Singles) -> Ids:
        """Return which of the samples' vertices may be near enough to their ball, (n,).

        Args:
            rows: Where they are in the pose, coordinates by rows, shape (3, V).
            turns: From the pose to the balls at rest, shape (E, 3, 3).
            shifts: What is added then, shape (E, 3).
        """
        resting = np.empty_like(rows)
        for run, turn, shift in zip(self._runs, turns, shifts, strict=True):
            resting[:, run] = turn @ rows[:, run] + shift[:, None]
        x, y, z = resting
        close = np.flatnonzero(x * x + y * y + z * z < self._far)
        clearance = self._balls.clearance(resting.take(close, axis=1), self._eye_of_sample.take(close))
        near: Ids = close[clearance < self._near.take(close)]
        return near


class _Turning:
    """Turns lids that have passed each other back to where they meet."""

    def __init__(self, subject: Subject, eyes: Sequence[_Eye]) -> None:
        """Prepare for those of the ``eyes`` of ``subject`` whose lids have edges."""
        lids = [
            (number, _Lids.of(subject, eye.ball, eye.edges, eye.distances))
            for number, eye in enumerate(eyes)
            if eye.edges is not None and eye.distances is not None
        ]
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
        self._runs = _runs([len(ids) for ids in (*edges, *rims)])
        self._eye_of_seen = np.repeat(
            [*np.repeat(numbers, 3), *numbers, *numbers], [len(ids) for ids in (*edges, *rims)]
        )
        self._at_rest = subject.vertices[self._seen]

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
    def of(cls, subject: Subject, ball: Eyeball, edges: LidEdges, distances: list[Array]) -> Self:
        """Return the lids with ``edges`` before a ``ball`` of ``subject``."""
        skin = skin_ids(subject)
        reach = _TURNS * ball.radius
        near = skin[np.minimum(distances[0], distances[1])[skin] < reach]
        points = subject.vertices[near].astype(np.float64) - ball.centre
        azimuth, elevation, _ = azimuth_and_elevation(points)
        upper = _upper_share(distances, near)
        outward = np.sign(ball.centre[0]) or 1.0
        curves = edges.curves(subject.vertices, ball.centre)
        starts, ends = zip(*(_known(curve.azimuth) for curve in curves), strict=True)
        first, last = max(starts), min(ends)
        on_edge = (azimuth > first) & (azimuth < last) & (ball.clearance(points)[0] >= 0.0)
        along, up = outward * azimuth / _SPACING, elevation / _SPACING
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
        lashes, roots = _followers(subject, ball, edges, near[turning])
        return cls(
            near[turning],
            edges,
            [np.searchsorted(turning, rim) for rim in rims],
            allowed,
            [spreading.at(turning) for spreading in spreadings],
            lashes,
            roots,
        )


def _runs(lengths: Sequence[int]) -> list[slice]:
    """Return where runs of such ``lengths``, one after another, lie."""
    return [slice(*run) for run in itertools.pairwise(np.cumsum([0, *lengths]).tolist())]


def _upper_share(distances: list[Array] | None, ids: Ids) -> Array:
    """Return the share of the vertices ``ids`` in the upper lid, 1/2 at the corners, by ``distances`` to the edges."""
    if distances is None:
        return np.full(len(ids), 0.5)
    upper, lower = (np.minimum(distance[ids], 1e6) for distance in distances)
    return 1.0 - fading((lower - upper) / np.maximum(lower + upper, 1e-9), -0.3, 0.3)


def _azimuth(subject: Subject, ball: Eyeball, ids: Ids) -> Array:
    return azimuth_and_elevation(subject.vertices[ids].astype(np.float64) - ball.centre)[0]


def _known(azimuth: Array) -> tuple[float, float]:
    """Return between which angles an edge is known whose points lie at the rising ``azimuth``, shape (n,)."""
    first = 1 if azimuth[1] - azimuth[0] > _UNKNOWN else 0
    last = -2 if azimuth[-1] - azimuth[-2] > _UNKNOWN else -1
    return float(azimuth[first]), float(azimuth[last])


def _lashes(subject: Subject, ball: Eyeball, edges: LidEdges | None) -> list[tuple[Ids, bool]]:
    """Return the pieces of lashes on the lids of ``ball``, each with whether they are those of the upper lid."""
    found = []
    for part in subject.parts if edges is not None else ():
        if part.material != "lashes":
            continue
        for ids in pieces(subject, part):
            points = subject.vertices[ids].astype(np.float64)
            if np.abs(points.mean(axis=0) - ball.centre)[0] > 1.2 * ball.radius:
                continue
            assert edges is not None
            near = [
                np.linalg.norm(points[:, None] - subject.vertices[edge][None], axis=2).min(axis=1).mean()
                for edge in (edges.upper, edges.lower)
            ]
            found.append((ids, bool(near[0] < near[1])))
    return found


def _followers(subject: Subject, ball: Eyeball, edges: LidEdges | None, skin: Ids) -> tuple[Ids, Ids]:
    """Return the vertices of lashes, and the index into ``skin`` of the edge's vertex that each goes with.

    Those that go with none of ``skin`` are left out.
    """
    ids, roots = [np.zeros(0, dtype=np.intp)], [np.zeros(0, dtype=np.intp)]
    place = np.full(len(subject.vertices), -1, dtype=np.intp)
    place[skin] = np.arange(len(skin))
    for lashes, is_upper in _lashes(subject, ball, edges):
        assert edges is not None
        edge = edges.upper if is_upper else edges.lower
        between = np.abs(_azimuth(subject, ball, lashes)[:, None] - _azimuth(subject, ball, edge)[None])
        ids.append(lashes)
        roots.append(place[edge[between.argmin(axis=1)]])
    found, root = np.concatenate(ids), np.concatenate(roots)
    return found[root >= 0], root[root >= 0]


def lid_contacts(subject: Subject, balls: list[Eyeball]) -> list[LidContact]:
    """Return the contact of lids with those of ``balls`` that have skin before them.

    Eyes whose surroundings have vertices in common are looked at one after another, all others together.
    """
    eyes = [
        _Eye.of(subject, ball, edges)
        for ball, edges in zip(balls, find_all_edges(subject, balls), strict=True)
        if len(over_the_ball(subject, ball))
    ]
    together: list[list[_Eye]] = []
    for eye in eyes:
        own = _surroundings(subject, eye)
        if together and not any(np.isin(own, _surroundings(subject, other)).any() for other in together[-1]):
            together[-1].append(eye)
        else:
            together.append([eye])
    return [LidContact(subject, group) for group in together]


def _surroundings(subject: Subject, eye: _Eye) -> Ids:
    """Return all vertices that contact at the ``eye`` looks at or moves."""
    skin = skin_ids(subject)
    turning = np.zeros(0, dtype=np.intp)
    if eye.distances is not None:
        turning = skin[np.minimum(*eye.distances)[skin] < _TURNS * eye.ball.radius]
    return np.concatenate([eye.samples.ids, eye.ids, eye.followers[0], turning])
