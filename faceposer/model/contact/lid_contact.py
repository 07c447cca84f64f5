"""Lids stop at each other and slide on the eyeball.

Lid on lid: where the edges have passed each other by an angle o, seen from the centre of the eye, the upper lid goes
back by a share of o and the lower lid by the rest, so that both meet; the skin around turns with them, less and less.
Lid on ball: skin at a direction d from the centre whose distance is below the ball's radius rho(d), sclera or cornea,
goes out along d; the skin around goes with it.
"""

from dataclasses import dataclass

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
from faceposer.model.contact.spreading import Spreading, fading, hinge
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
        self._far = (float(ball.profile.max()) + self._near) ** 2
        self._ids = np.concatenate([near[touches], near[~touches]])
        points = subject.vertices[self._ids] - ball.centre
        azimuth, elevation, _ = azimuth_and_elevation(points)
        layer = _upper_share(distances, self._ids)
        fade = fading(ball.clearance(points)[0], _FADES * ball.radius, _FADED * ball.radius)
        outward = np.sign(ball.centre[0]) or 1.0
        self._spreading = Spreading.over(outward * azimuth / _SPACING, elevation / _SPACING, layer, fade)
        self._allowed = np.zeros(len(self._samples))
        at_rest = self._samples.places(subject.vertices) - ball.centre
        self._allowed = np.maximum(-ball.clearance(at_rest)[0], 0.0)
        self._followers = _followers(subject, ball, edges, self._ids)
        self._ball_at_rest = subject.vertices[ball.frame.witnesses]
        self._at_rest = subject.vertices[self._samples.ids]

    def apply(self, vertices: NDArray[np.float32]) -> None:
        """Correct the pose ``vertices``, shape (N, 3), in place."""
        looks = not np.array_equal(vertices.take(self._ball.frame.witnesses, axis=0), self._ball_at_rest)
        linear, centre = self._ball.motion(vertices)
        if self._turning is not None and (looks or self._turning.moves(vertices)):
            for shares in _SHARES:
                if not self._turning.apply(vertices, centre, shares):
                    break
        places = vertices.take(self._samples.ids, axis=0)
        differs = places != self._at_rest
        moved = differs[:, 0] | differs[:, 1] | differs[:, 2]
        if not (looks or moved.any()):
            return
        points = places - centre
        back = np.linalg.inv(linear).T
        resting = points @ back
        squared = np.einsum("nd,nd->n", resting, resting)
        close = np.flatnonzero(squared < self._far if looks else (squared < self._far) & moved)
        if not len(close):
            return
        start, margin = _START * self._ball.radius, _MARGIN * self._ball.radius
        clearance, _ = self._ball.clearance(resting[close])
        own = np.zeros(len(points))
        own[close] = hinge(-clearance - self._allowed[close], start, margin)
        near = close[clearance < self._near[close]]
        push = np.zeros(len(self._ids))
        push[: len(points)] = self._samples.greatest(
            points,
            own,
            near,
            lambda places, numbers: hinge(
                -self._ball.clearance(places @ back)[0] - self._allowed[numbers], start, margin
            ),
        )
        if not push.any():
            return
        push = np.maximum(push, self._spreading(push))
        pushed = np.flatnonzero(push)
        ids = self._ids[pushed]
        before = vertices.take(ids, axis=0)
        points = before - centre
        resting = points @ back
        factor = push[pushed] / np.maximum(np.sqrt(np.einsum("nd,nd->n", resting, resting)), 1e-9)
        move = (points * factor[:, None]).astype(np.float32)
        vertices[ids] = before + move
        lashes, roots = self._followers
        if len(lashes):
            whole = np.zeros((len(push), 3), dtype=np.float32)
            whole[pushed] = move
            vertices[lashes] += whole[roots]


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
        self._layers: list[_Layer] = []
        curves = edges.curves(subject.vertices, ball.centre)
        starts, ends = zip(*(_known(curve.azimuth) for curve in curves), strict=True)
        first, last = max(starts), min(ends)
        on_edge = (azimuth > first) & (azimuth < last) & (ball.clearance(points)[0] >= 0.0)
        for number, (distance, share) in enumerate(zip(distances, (upper, 1.0 - upper), strict=True)):
            sign = 1.0 - 2.0 * number
            keys = np.flatnonzero(on_edge & (share > 0.5) & (distance[near] < _RIM * ball.radius))
            behind = np.maximum(sign * (elevation[keys] - curves[number](azimuth[keys])), 0.0)
            across = sign * (curves[1 - number](azimuth[keys]) - elevation[keys]) + behind
            fade = share * fading(distance[near], 0.0, reach)
            along, up = outward * azimuth / _SPACING, elevation / _SPACING
            spreading = Spreading.over(along, up, share, fade)
            self._layers.append(_Layer(near[keys], keys, behind - np.maximum(across, PRESSED), sign, spreading))
        self._near = near
        lashes, roots = _followers(subject, ball, edges, near)
        self._ids = np.concatenate([near, lashes])
        self._roots = roots
        edge = (edges.upper, edges.lower, edges.corners)
        self._seen = np.unique(np.concatenate([*edge, *(layer.ids for layer in self._layers)]))
        self._at_rest = subject.vertices[self._seen]

    def moves(self, vertices: NDArray[np.float32]) -> bool:
        """Return whether edges or rims of the lids lie elsewhere in the pose ``vertices``, (N, 3), than at rest."""
        return not np.array_equal(vertices.take(self._seen, axis=0), self._at_rest)

    def apply(self, vertices: NDArray[np.float32], centre: Array, shares: tuple[float, float]) -> bool:
        """Turn the lids of the pose ``vertices``, (N, 3), of an eye at ``centre``, in place; return whether any did.

        The upper and the lower one give way by ``shares`` of how far they have passed each other.
        """
        curves = self._edges.curves(vertices, centre)
        angle = np.zeros(len(self._near))
        for layer, curve, part in zip(self._layers, curves[::-1], shares, strict=True):
            azimuth, elevation, _ = azimuth_and_elevation(vertices[layer.ids].astype(np.float64) - centre)
            past = layer.sign * (curve(azimuth) - elevation) + layer.allowed
            push = part * hinge(past, _TURN_START, _TURN_MARGIN)
            if push.any():
                whole = np.zeros(len(self._near))
                whole[layer.keys] = push
                angle += layer.sign * np.maximum(whole, layer.spreading(whole))
        if not angle.any():
            return False
        angle = np.concatenate([angle, angle[self._roots]])
        points = vertices[self._ids] - centre
        across = np.maximum(np.sqrt(points[:, 0] ** 2 + points[:, 2] ** 2), 1e-9)
        cosine, sine = np.cos(angle), np.sin(angle)
        shrink = cosine - sine * points[:, 1] / across - 1.0
        up = across * sine + points[:, 1] * (cosine - 1.0)
        moved = np.column_stack([points[:, 0] * shrink, up, points[:, 2] * shrink])
        vertices[self._ids] += moved.astype(np.float32)
        return True


@dataclass(frozen=True, eq=False)
class _Layer:
    """The upper lid (sign 1) or the lower lid (sign -1).

    Attributes:
        ids: Vertices of the rim, shape (k,).
        keys: Their indices among all vertices that turn, shape (k,).
        allowed: How far each lies behind its edge, less the overlap that it may have, shape (k,).
        sign: Direction, up or down, in which the lid gives way.
        spreading: From the rim to all vertices that turn.
    """

    ids: Ids
    keys: Ids
    allowed: Array
    sign: float
    spreading: Spreading


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
    """Return the vertices of lashes, and the index into ``skin`` of the edge's vertex that each goes with."""
    ids, roots = [np.zeros(0, dtype=np.intp)], [np.zeros(0, dtype=np.intp)]
    place = np.zeros(len(subject.vertices), dtype=np.intp)
    place[skin] = np.arange(len(skin))
    for lashes, is_upper in _lashes(subject, ball, edges):
        assert edges is not None
        edge = edges.upper if is_upper else edges.lower
        between = np.abs(_azimuth(subject, ball, lashes)[:, None] - _azimuth(subject, ball, edge)[None])
        ids.append(lashes)
        roots.append(place[edge[between.argmin(axis=1)]])
    return np.concatenate(ids), np.concatenate(roots)


def lid_contacts(subject: Subject, balls: list[Eyeball]) -> list[LidContact]:
    """Return the contact of lids with each of ``balls`` that has skin before it."""
    return [
        LidContact(subject, ball, edges)
        for ball, edges in zip(balls, find_all_edges(subject, balls), strict=True)
        if len(over_the_ball(subject, ball))
    ]
