"""Lids stop at each other and slide on the eyeball.

Lid on lid: where the edges have passed each other by an angle o, seen from the centre of the eye, the upper lid goes
back by a share of o and the lower lid by the rest, so that both meet; the skin around turns with them, less and less.
Lid on ball: skin at a direction d from the centre whose distance is below the ball's radius rho(d), sclera or cornea,
goes out along d; the skin around goes with it.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from faceposer.model.contact.eyeballs import Eyeball
from faceposer.model.contact.frames import pieces
from faceposer.model.contact.lids import (
    LidEdges,
    azimuth_and_elevation,
    find_edges,
    over_the_ball,
    skin_ids,
)
from faceposer.model.contact.lips import surface_distance, triangles_among
from faceposer.model.contact.samples import SurfaceSamples
from faceposer.model.contact.spreading import Spreading, fading, hinge
from faceposer.model.subject import Subject

Array = NDArray[np.float64]
Ids = NDArray[np.intp]
Vertices = NDArray[np.floating]

# Share of an overlap that the upper lid gives way by: it is the one that moves.
_UPPER_SHARE = 0.8
# In radii of the ball: how far from the edges skin turns with them, where pushes begin to fade and have faded, how near
# a vertex is whose neighbours may lie deeper, and what is not felt.
_TURNS, _FADES, _FADED, _NEAR, _SLACK = 0.75, 0.4, 0.8, 0.12, 0.0012
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
        self._samples = SurfaceSamples.of(triangles_among(subject, near), near)
        points = subject.vertices[self._samples.ids].astype(np.float64) - ball.centre
        azimuth, elevation, _ = azimuth_and_elevation(points)
        layer = _upper_share(distances, self._samples.ids)
        fade = fading(ball.clearance(points)[0], _FADES * ball.radius, _FADED * ball.radius)
        outward = np.sign(ball.centre[0]) or 1.0
        self._spreading = Spreading.over(outward * azimuth / _SPACING, elevation / _SPACING, layer, fade)
        self._allowed = np.zeros(len(self._samples))
        at_rest = self._samples.places(subject.vertices) - ball.centre
        self._allowed = np.maximum(-ball.clearance(at_rest)[0], 0.0)
        self._followers = _followers(subject, ball, edges, self._samples.ids)

    def apply(self, vertices: NDArray[np.float32]) -> None:
        """Correct the pose ``vertices``, shape (N, 3), in place."""
        linear, centre = self._ball.motion(vertices)
        if self._turning is not None:
            self._turning.apply(vertices, centre)
        points = vertices[self._samples.ids] - centre
        back = np.linalg.inv(linear).T
        clearance, distance = self._ball.clearance(points @ back)
        near = clearance < _NEAR * self._ball.radius
        if not near.any():
            return
        own = hinge(-clearance - self._allowed[: len(points)], _SLACK * self._ball.radius)
        push = self._samples.greatest(
            points,
            own,
            near,
            lambda places, numbers: hinge(
                -self._ball.clearance(places @ back)[0] - self._allowed[numbers], _SLACK * self._ball.radius
            ),
        )
        if not push.any():
            return
        push = np.maximum(push, self._spreading(push))
        moved = points * (push / distance)[:, None]
        vertices[self._samples.ids] += moved.astype(np.float32)
        lashes, roots = self._followers
        vertices[lashes] += moved[roots].astype(np.float32)


class _Turning:
    """Turns lids that have passed each other back to where they meet."""

    def __init__(self, subject: Subject, ball: Eyeball, edges: LidEdges, distances: list[Array]) -> None:
        self._ball, self._edges = ball, edges
        self._allowed = [np.maximum(angle, 0.0) for angle in edges.overlap(ball, subject.vertices)]
        skin = skin_ids(subject)
        reach = _TURNS * ball.radius
        near = skin[np.minimum(distances[0], distances[1])[skin] < reach]
        upper = _upper_share(distances, near)
        azimuth = _azimuth(subject, ball, near)
        blocks = [
            _rows(_azimuth(subject, ball, ids), azimuth, share * fading(distance[near], 0.0, reach))
            for ids, distance, share in zip(
                (edges.upper, edges.lower), distances, (upper, 1.0 - upper), strict=True
            )
        ]
        ids, rows = [near], [sparse.hstack(blocks)]
        for lashes, is_upper in _lashes(subject, ball, edges):
            place, ones = _azimuth(subject, ball, lashes), np.ones(len(lashes))
            ids.append(lashes)
            rows.append(
                sparse.hstack(
                    [
                        _rows(_azimuth(subject, ball, edge), place, ones * (own == is_upper))
                        for edge, own in ((edges.upper, True), (edges.lower, False))
                    ]
                )
            )
        self._ids = np.concatenate(ids)
        self._weights = sparse.csr_array(sparse.vstack(rows))

    def apply(self, vertices: NDArray[np.float32], centre: Array) -> None:
        upper, lower = self._edges.overlap(self._ball, vertices)
        back_up = _UPPER_SHARE * hinge(upper - self._allowed[0], _SLACK)
        back_down = (_UPPER_SHARE - 1.0) * hinge(lower - self._allowed[1], _SLACK)
        if not (back_up.any() or back_down.any()):
            return
        angle = self._weights @ np.concatenate([back_up, back_down])
        points = vertices[self._ids] - centre
        across = np.maximum(np.sqrt(points[:, 0] ** 2 + points[:, 2] ** 2), 1e-9)
        cosine, sine = np.cos(angle), np.sin(angle)
        shrink = cosine - sine * points[:, 1] / across
        turned = np.column_stack(
            [points[:, 0] * shrink, across * sine + points[:, 1] * cosine, points[:, 2] * shrink]
        )
        vertices[self._ids] += (turned - points).astype(np.float32)


def _upper_share(distances: list[Array] | None, ids: Ids) -> Array:
    """Return the share of the vertices ``ids`` in the upper lid, 1/2 at the corners, from ``distances`` to the edges."""
    if distances is None:
        return np.full(len(ids), 0.5)
    upper, lower = (np.minimum(distance[ids], 1e6) for distance in distances)
    return 1.0 - fading((lower - upper) / np.maximum(lower + upper, 1e-9), -0.3, 0.3)


def _azimuth(subject: Subject, ball: Eyeball, ids: Ids) -> Array:
    return azimuth_and_elevation(subject.vertices[ids].astype(np.float64) - ball.centre)[0]


def _rows(edge: Array, places: Array, factors: Array) -> sparse.csr_array:
    """Return linear interpolation between ascending azimuths of an ``edge`` (e,) at ``places`` (n,), (n, e)."""
    edge = np.maximum.accumulate(edge)
    high = np.clip(np.searchsorted(edge, places), 1, len(edge) - 1)
    share = np.clip((places - edge[high - 1]) / np.maximum(edge[high] - edge[high - 1], 1e-9), 0.0, 1.0)
    rows = np.arange(len(places))
    values = np.concatenate([factors * (1.0 - share), factors * share])
    indices = (np.concatenate([rows, rows]), np.concatenate([high - 1, high]))
    return sparse.csr_array((values, indices), shape=(len(places), len(edge)))


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
    for lashes, is_upper in _lashes(subject, ball, edges):
        assert edges is not None
        edge = edges.upper if is_upper else edges.lower
        between = np.abs(_azimuth(subject, ball, lashes)[:, None] - _azimuth(subject, ball, edge)[None])
        ids.append(lashes)
        roots.append(np.searchsorted(skin, edge[between.argmin(axis=1)]))
    return np.concatenate(ids), np.concatenate(roots)


def lid_contacts(subject: Subject, balls: list[Eyeball]) -> list[LidContact]:
    """Return the contact of lids with each of ``balls`` that has skin before it."""
    return [LidContact(subject, ball, find_edges(subject, ball)) for ball in balls if len(over_the_ball(subject, ball))]
