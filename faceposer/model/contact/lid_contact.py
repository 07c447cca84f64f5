"""Lids stop at each other and slide on the eyeball.

Lid on lid: where the edges have passed each other by an angle o, seen from the centre of the eye, the upper lid goes
back by a share of o and the lower lid by the rest, so that both meet; the skin around turns with them, less and less.
Lid on ball: skin at a direction d from the centre whose distance is below the ball's radius rho(d), sclera or cornea,
goes out along d; the skin around goes with it.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from faceposer.model.character import Character
from faceposer.model.contact.eyeballs import Eyeball, Eyeballs
from faceposer.model.contact.lid_turning import SPACING, TURNS, Turning, followers_of, runs_of, upper_share
from faceposer.model.contact.lids import (
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

Array = NDArray[np.float64]
Singles = NDArray[np.float32]
Ids = NDArray[np.intp]
Vertices = NDArray[np.floating]

# In radii of the ball: up to which clearance in the neutral face skin may come to touch the ball; where pushes begin to
# fade and have faded.
_TOUCHES, _FADES, _FADED = 0.8, 0.4, 0.8
# A sphere of radius R bulges by s^2 / 6 R through a triangle with edges s, here of the neutral ones times this factor.
_STRETCHED = 3.0
# In radii of the ball: start and margin of the pushes out of it.
_START, _MARGIN = 0.001, 0.018


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
    def of(cls, character: Character, ball: Eyeball, edges: LidEdges | None) -> Self:
        """Return the eye of the ``character`` with a ``ball``, and ``edges`` of its lids if there are any."""
        distances = None
        if edges is not None:
            reach = 4.0 * ball.radius
            distances = [surface_distance(character, ids, reach) for ids in (edges.upper, edges.lower)]
        near = over_the_ball(character, ball)
        clearance, _ = ball.clearance(character.vertices[near] - ball.centre)
        touches = np.isin(near, with_neighbours(character, near[clearance < _TOUCHES * ball.radius]))
        samples = skin_samples(character, near[touches])
        pushed = np.arange(int(touches.sum()))
        ids = np.concatenate([near[touches], near[~touches]])
        points = character.vertices[ids] - ball.centre
        azimuth, elevation, _ = azimuth_and_elevation(points)
        layer = upper_share(distances, ids)
        fade = fading(ball.clearance(points)[0], _FADES * ball.radius, _FADED * ball.radius)
        outward = np.sign(ball.centre[0]) or 1.0
        spreading = Spreading.over(outward * azimuth / SPACING, elevation / SPACING, layer, fade, pushed)
        moving = np.concatenate([pushed, np.setdiff1d(spreading.reaches, pushed)])
        followers = followers_of(character, ball, edges, ids[moving])
        return cls(ball, edges, distances, samples, ids[moving], spreading.at(moving), followers)


class LidContact:
    """Keeps the lids of eyes off their balls and off each other.

    What surrounds one eye has no vertex in common with what surrounds another; all are looked at together.
    """

    def __init__(self, character: Character, eyes: Sequence[_Eye]) -> None:
        """Prepare for the ``eyes`` of ``character``."""
        self._balls = Eyeballs([eye.ball for eye in eyes], character.vertices)
        edged = [
            (number, eye.ball, eye.edges, eye.distances)
            for number, eye in enumerate(eyes)
            if eye.edges is not None and eye.distances is not None
        ]
        self._turning = Turning(character, edged) if edged else None
        self._samples = SurfaceSamples.joined([eye.samples for eye in eyes])
        numbers = np.arange(len(eyes))
        vertices = np.repeat(numbers, [len(eye.samples.ids) for eye in eyes])
        between = np.repeat(numbers, [eye.samples.corners.shape[1] for eye in eyes])
        self._eye_of_sample = np.concatenate([vertices, between])
        self._runs = runs_of([len(eye.samples.ids) for eye in eyes])
        radii = self._balls.radii.take(vertices)
        self._radii = self._balls.radii.astype(np.float32)
        self._near = ((_STRETCHED * self._samples.spans) ** 2 / (6.0 * radii)).astype(np.float32)
        widest = np.array([eye.ball.profile.max() for eye in eyes]).take(vertices)
        self._far = ((widest + self._near) ** 2).astype(np.float32)
        at_rest = self._samples.places(character.vertices).T.astype(np.float32)
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
        self._at_rest = character.vertices[self._samples.ids]
        self._nothing = NOTHING * character.height

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


def lid_contacts(character: Character, balls: list[Eyeball]) -> list[LidContact]:
    """Return the contact of lids with those of ``balls`` that have skin before them.

    Eyes whose surroundings have vertices in common are looked at one after another, all others together.
    """
    eyes = [
        _Eye.of(character, ball, edges)
        for ball, edges in zip(balls, find_all_edges(character, balls), strict=True)
        if len(over_the_ball(character, ball))
    ]
    together: list[list[_Eye]] = []
    for eye in eyes:
        own = _surroundings(character, eye)
        if together and not any(np.isin(own, _surroundings(character, other)).any() for other in together[-1]):
            together[-1].append(eye)
        else:
            together.append([eye])
    return [LidContact(character, group) for group in together]


def _surroundings(character: Character, eye: _Eye) -> Ids:
    """Return all vertices that contact at the ``eye`` looks at or moves."""
    skin = skin_ids(character)
    turning = np.zeros(0, dtype=np.intp)
    if eye.distances is not None:
        turning = skin[np.minimum(*eye.distances)[skin] < TURNS * eye.ball.radius]
    return np.concatenate([eye.samples.ids, eye.ids, eye.followers[0], turning])
