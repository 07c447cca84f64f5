"""Lids stop at each other and slide on the eyeball.

Lid on lid: where the edges have passed each other by an angle o, seen from the centre of the eye, the upper lid goes
back by a share of o and the lower lid by the rest, so that both meet; the skin around turns with them, less and less.
Lid on ball: skin at a direction d from the centre whose distance is below the ball's radius rho(d), sclera or cornea,
goes out along d; the skin around goes with it.
"""

import itertools

import numpy as np
from numpy.typing import NDArray

from faceposer.model.contact.eyeballs import Eyeball
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
from faceposer.model.contact.spreading import NOTHING, Spreading, fading, farthest, hinge
from faceposer.model.subject import Subject

Array = NDArray[np.float64]
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
# Share that single precision may be off by.
_ROUNDING = 1e-5
# Distance of the control points that spread pushes, in radians.
_SPACING = 0.2


class LidContact:
    """Keeps the lids of one eye off its ball and off each other."""

    def __init__(self, subject: Subject, ball: Eyeball, edges: LidEdges | None) -> None:
        """Prepare for an eye of ``subject``, with the edges of its lids if there are any."""
        self._ball = ball
        distances = None
        if edges is not None:
            reach = 4.0 * ball.radius
            distances = [surface_distance(subject, ids, reach) for ids in (edges.upper, edges.lower)]
        self._turning = None if edges is None or distances is None else _Turning(subject, ball, edges, distances)
        near = over_the_ball(subject, ball)
        clearance, _ = ball.clearance(subject.vertices[near] - ball.centre)
        touches = np.isin(near, with_neighbours(subject, near[clearance < _TOUCHES * ball.radius]))
        self._samples = skin_samples(subject, near[touches])
        self._near = (_STRETCHED * self._samples.spans) ** 2 / (6.0 * ball.radius)
        self._far = (((1.0 + _ROUNDING) * (float(ball.profile.max()) + self._near)) ** 2).astype(np.float32)
        pushed = np.arange(int(touches.sum()))
        ids = np.concatenate([near[touches], near[~touches]])
        points = subject.vertices[ids] - ball.centre
        azimuth, elevation, _ = azimuth_and_elevation(points)
        layer = _upper_share(distances, ids)
        fade = fading(ball.clearance(points)[0], _FADES * ball.radius, _FADED * ball.radius)
        outward = np.sign(ball.centre[0]) or 1.0
        spreading = Spreading.over(outward * azimuth / _SPACING, elevation / _SPACING, layer, fade, pushed)
        moving = np.concatenate([pushed, np.setdiff1d(spreading.reaches, pushed)])
        self._ids, self._spreading = ids[moving], spreading.at(moving)
        self._allowed = np.zeros(len(self._samples))
        at_rest = self._samples.places(subject.vertices) - ball.centre
        self._allowed = np.maximum(-ball.clearance(at_rest)[0], 0.0)
        self._followers = _followers(subject, ball, edges, self._ids)
        self._ball_at_rest = subject.vertices[ball.frame.witnesses]
        self._at_rest = subject.vertices[self._samples.ids]
        self._nothing = NOTHING * subject.height

    def apply(self, vertices: NDArray[np.float32]) -> float:
        """Correct the pose ``vertices``, shape (N, 3), in place; return how far it moves any of them at most."""
        ball = self._ball
        witnesses = vertices.take(ball.frame.witnesses, axis=0)
        looks = not np.array_equal(witnesses, self._ball_at_rest)
        linear, centre = ball.motion_of(witnesses)
        farthest_moved = 0.0
        if self._turning is not None:
            for time in range(len(_SHARES)):
                turned = self._turning.apply(vertices, centre, time, looks)
                if turned == 0.0:
                    break
                farthest_moved += turned
        places = vertices.take(self._samples.ids, axis=0)
        if not looks and np.array_equal(places, self._at_rest):
            return farthest_moved
        back = np.linalg.inv(linear).T
        # In single precision all that may lie deep, then exactly how deep it does.
        x, y, z = back.T.astype(np.float32) @ (places.T - centre.astype(np.float32)[:, None])
        close = np.flatnonzero(x * x + y * y + z * z < self._far)
        if not looks:
            close = close[(places.take(close, axis=0) != self._at_rest.take(close, axis=0)).any(axis=1)]
        if not len(close):
            return farthest_moved
        start, margin = _START * ball.radius, _MARGIN * ball.radius
        resting = np.stack([x.take(close), y.take(close), z.take(close)], axis=1)
        clearance = ball.clearance(resting)[0] - _ROUNDING * ball.radius
        near = close[clearance < self._near.take(close)]
        if not len(near):
            return farthest_moved
        push = self._samples.greatest(
            places,
            near,
            lambda points, numbers: hinge(
                -ball.clearance((points - centre) @ back)[0] - self._allowed.take(numbers), start, margin
            ),
        )
        if push.max() <= self._nothing:
            return farthest_moved
        field = self._spreading(push)
        field[: len(push)] = np.maximum(field[: len(push)], push)
        pushed = np.flatnonzero(field)
        ids = self._ids.take(pushed)
        before = vertices.take(ids, axis=0)
        points = before.T - centre[:, None]
        x, y, z = back.T @ points
        move = points * (field.take(pushed) / np.maximum(np.sqrt(x * x + y * y + z * z), 1e-9))
        vertices[ids] = before + move.T.astype(np.float32)
        lashes, roots = self._followers
        if len(lashes):
            whole = np.zeros((len(field), 3), dtype=np.float32)
            whole[pushed] = move.T
            vertices[lashes] += whole[roots]
        return farthest_moved + farthest(move)


class _Turning:
    """Turns lids that have passed each other back to where they meet."""

    def __init__(self, subject: Subject, ball: Eyeball, edges: LidEdges, distances: list[Array]) -> None:
        self._edges = edges
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
            # How far each lies behind its edge, less the overlap that it may have.
            allowed.append(behind - np.maximum(across, PRESSED))
            spreadings.append(Spreading.over(along, up, share, fade, rim))
        turning = np.unique(np.concatenate([*rims, *(spreading.reaches for spreading in spreadings)]))
        self._count = len(turning)
        self._spreading = Spreading.beside([spreading.at(turning) for spreading in spreadings])
        # Where the rims' own turns lie among those of both lids, one after the other.
        self._own = np.concatenate([np.searchsorted(turning, rim) + i * len(turning) for i, rim in enumerate(rims)])
        self._allowed = np.concatenate(allowed)
        sizes = [len(rim) for rim in rims]
        self._shares = np.repeat(np.array(_SHARES), sizes, axis=1)
        lashes, self._roots = _followers(subject, ball, edges, near[turning])
        self._ids = np.concatenate([near[turning], lashes])
        # Edges, corners and rims, one after another.
        self._seen = np.concatenate([edges.upper, edges.lower, edges.corners, *(near[rim] for rim in rims)])
        bounds = np.cumsum([0, len(edges.upper), len(edges.lower), len(edges.corners), *sizes]).tolist()
        self._runs = [slice(*run) for run in itertools.pairwise(bounds)]
        self._at_rest = subject.vertices[self._seen]

    def apply(self, vertices: NDArray[np.float32], centre: Array, time: int, looks: bool) -> float:
        """Turn the lids of the pose ``vertices``, (N, 3), of an eye at ``centre``, in place.

        Args:
            vertices: Shape (N, 3).
            centre: Of the eye, shape (3,).
            time: How often they have been turned before.
            looks: Whether the eye is moved; if not, lids that are at rest are not looked at.

        Returns:
            How far any vertex is moved at most; 0 if none is.
        """
        places = vertices.take(self._seen, axis=0)
        if not looks and np.array_equal(places, self._at_rest):
            return 0.0
        azimuth, elevation, _ = azimuth_and_elevation(places - centre)
        azimuths, elevations = ([each[run] for run in self._runs] for each in (azimuth, elevation))
        upper, lower = self._edges.curves_through(azimuths, elevations)
        past = np.concatenate([lower(azimuths[3]) - elevations[3], elevations[4] - upper(azimuths[4])])
        past += self._allowed
        if past.max(initial=0.0) <= 0.0:
            return 0.0
        turns = self._shares[time] * hinge(past, _TURN_START, _TURN_MARGIN)
        both = self._spreading(turns)
        both[self._own] = np.maximum(both[self._own], turns)
        angle = both[: self._count] - both[self._count :]
        angle = np.concatenate([angle, angle.take(self._roots)])
        turned = np.flatnonzero(angle)
        ids, angle = self._ids.take(turned), angle.take(turned)
        before = vertices.take(ids, axis=0)
        x, y, z = before.T - centre[:, None]
        across = np.maximum(np.sqrt(x * x + z * z), 1e-9)
        cosine, sine = np.cos(angle), np.sin(angle)
        shrink = cosine - sine * y / across - 1.0
        move = np.stack([x * shrink, across * sine + y * (cosine - 1.0), z * shrink])
        vertices[ids] = before + move.T.astype(np.float32)
        return farthest(move)


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
    """Return the contact of lids with each of ``balls`` that has skin before it."""
    return [
        LidContact(subject, ball, edges)
        for ball, edges in zip(balls, find_all_edges(subject, balls), strict=True)
        if len(over_the_ball(subject, ball))
    ]
